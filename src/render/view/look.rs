use crate::error::{Error, Result};
use lightcast_core::image::PolarMap;

/// How radiance is mapped to a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Look {
    /// What is shown where there is no surface.
    pub background: Background,
    /// Factor on radiance before the tone curve.
    pub exposure: Exposure,
    /// How exposed radiance is mapped to the range of a screen.
    pub tone: Tone,
}

/// What is shown where there is no surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Background {
    /// Grey at a quarter of the picture's log-average; it is not radiance of the scene.
    #[default]
    Grey,
    /// This radiance, exposed like everything else.
    Colour([f32; 3]),
    /// The map along the view ray; black below its rim.
    Panorama(PolarMap),
    /// Nothing: pictures have an alpha channel, the fraction of a pixel that shows a surface.
    Transparent,
}

/// Factor on radiance before the tone curve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// The factor that maps the picture's log-average to its key, smoothed over time.
    #[default]
    Automatic,
    /// Two to the power of this, independent of the picture.
    Stops(f32),
}

/// How exposed radiance is mapped to the range of a screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// Reinhard's global operator (2002, equations 2 and 4), then the curve of sRGB.
    #[default]
    Reinhard,
    /// The curve of sRGB alone: values above 1 clip.
    Srgb,
    /// None: codes are proportional to radiance up to 1.
    None,
}

/// Most stops by which pictures are made brighter or darker: more would exceed the range of floats.
const MOST_STOPS: f32 = 64.0;

impl Look {
    /// Whether pictures have an alpha channel.
    pub fn is_transparent(&self) -> bool {
        self.background == Background::Transparent
    }

    /// Refuses a look that cannot be drawn.
    pub(in crate::render) fn check(&self, limits: &wgpu::Limits) -> Result<()> {
        if let Exposure::Stops(stops) = self.exposure
            && !(-MOST_STOPS..=MOST_STOPS).contains(&stops)
        {
            return Err(Error::usage(format!(
                "an exposure of {stops:?} stops; give {:?} to {MOST_STOPS:?}",
                -MOST_STOPS
            )));
        }
        match &self.background {
            Background::Colour(colour) if !colour.iter().all(|v| v.is_finite() && *v >= 0.0) => {
                Err(Error::usage(format!("a background of {colour:?}; give three numbers of at least 0")))
            }
            Background::Panorama(map) => {
                let (side, most) =
                    (map.shape.columns().max(map.shape.rows()), limits.max_texture_dimension_2d);
                if side > most as usize {
                    return Err(Error::usage(format!(
                        "a background of {side} pixels along a side; this device holds {most}"
                    )));
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }
}
