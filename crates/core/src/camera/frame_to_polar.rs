//! Frame to polar map by exact area weights, METHODS section 4.
//!
//! Map pixel i has the radiance `sum_j (overlap_ij / Omega_i) L_j` over the frame's pixels j, with the
//! overlap and the map pixel's `Omega_i` in solid angle: constant frames give constant maps, and the map's
//! power is the frame's. The overlaps are those of polygons that tile the field of view (`footprints`), in
//! the equal-area cylinder where map pixels are rectangles (`overlap`).
//!
//! A frame is streamed once, in bands of rows that are turned into radiance in a buffer that stays in the
//! second-level cache (`area_matrix`). A mosaic is not demosaiced: its pixels at one position in the period
//! form a picture of their own (`mosaic`), and every colour comes straight from the pixels that saw it. An
//! upright lat-long picture needs no matrix (`lat_long`).

use super::area_matrix::AreaMatrix;
use super::band_kernels::{PLANE, decode_codes, decode_radiance};
use super::footprints::Footprints;
use super::lat_long::LatLongWeights;
use super::mosaic::Mosaic;
use super::response::CodeLookup;
use super::{ColourMatrix, PixelCounts, Projection, Response};
use crate::error::{Error, Result};
use crate::image::{Bayer, Frame, Pixels, PolarMap, PolarShape};
use glam::{DMat3, DQuat, DVec3};

/// The weights of a frame's pixels in a polar map's, for one lens, rotation and map.
#[derive(Clone, Debug)]
pub struct FrameToPolar {
    width: usize,
    height: usize,
    shape: PolarShape,
    weights: Weights,
    coverage: Vec<f32>,
    rec709_from_sensor: Option<ColourMatrix>,
    /// Radiance of the current band, one plane per channel of the frame.
    radiance: Vec<f32>,
    /// Map under construction, one plane per channel. It is in f64 because a map pixel may be the sum of
    /// thousands of parts.
    sums: Vec<f64>,
}

#[derive(Clone, Debug)]
enum Weights {
    /// Every pixel has all channels.
    Whole(Box<AreaMatrix>),
    Mosaic(Mosaic),
    /// Every pixel has all channels, and those of the map are seen whole.
    LatLong(LatLongWeights),
}

impl FrameToPolar {
    /// Computes the weights, which takes seconds for millions of pixels, unless the picture is lat-long and
    /// upright. `world_from_camera` is a rotation; the default is [`super::LOOKING_UP`] for a fisheye and the
    /// identity for a lat-long picture.
    ///
    /// # Errors
    /// `Usage` for a matrix that is not a rotation, and for frames beyond 65,535 a side or 2^27 pixels in
    /// all.
    pub fn new(projection: &Projection, world_from_camera: DMat3, shape: PolarShape) -> Result<Self> {
        let world_from_camera = check(projection, world_from_camera)?;
        match *projection {
            Projection::LatLong { width, height, centres } if world_from_camera == DMat3::IDENTITY => {
                let weights = Weights::LatLong(LatLongWeights::new(width, height, centres, shape));
                Ok(Self::with_weights(projection, shape, weights, vec![1.0; shape.len()]))
            }
            _ => Ok(Self::by_matrix(projection, world_from_camera, shape)),
        }
    }

    /// With a matrix, whatever the projection; all has been checked.
    pub(super) fn by_matrix(projection: &Projection, world_from_camera: DMat3, shape: PolarShape) -> Self {
        let mut coverage_sr = vec![0.0; shape.len()];
        let footprints = Footprints::new(projection, world_from_camera);
        let matrix = AreaMatrix::new(footprints, shape, 1.0, &mut coverage_sr);
        let weights = Weights::Whole(Box::new(matrix));
        Self::with_weights(projection, shape, weights, fractions(&coverage_sr, shape))
    }

    /// The same for frames of a mosaic sensor, whose codes have one colour per pixel. A pixel of the frame
    /// stands for the area of four pixels about its own centre, so the colours lie where they were seen, not
    /// half a pixel apart; each of the two greens has half the weight.
    ///
    /// # Errors
    /// As [`Self::new`]; and `Usage` for a lat-long picture and for an odd number of columns or rows.
    pub fn mosaic(
        projection: &Projection,
        bayer: Bayer,
        world_from_camera: DMat3,
        shape: PolarShape,
    ) -> Result<Self> {
        let world_from_camera = check(projection, world_from_camera)?;
        let mut coverage_sr = vec![0.0; shape.len()];
        let mosaic = Mosaic::new(projection, bayer, world_from_camera, shape, &mut coverage_sr)?;
        let weights = Weights::Mosaic(mosaic);
        Ok(Self::with_weights(projection, shape, weights, fractions(&coverage_sr, shape)))
    }

    fn with_weights(
        projection: &Projection,
        shape: PolarShape,
        weights: Weights,
        coverage: Vec<f32>,
    ) -> Self {
        Self {
            width: projection.width(),
            height: projection.height(),
            shape,
            weights,
            coverage,
            rec709_from_sensor: None,
            radiance: vec![0.0; 3 * PLANE],
            sums: vec![0.0; 3 * shape.len()],
        }
    }

    /// Takes the frames' three channels as a sensor's own colours, and converts them to Rec. 709.
    #[must_use]
    pub fn with_colours(self, rec709_from_sensor: ColourMatrix) -> Self {
        Self { rec709_from_sensor: Some(rec709_from_sensor), ..self }
    }

    /// The shape of the map that frames are turned into.
    pub fn shape(&self) -> PolarShape {
        self.shape
    }

    /// Fraction of every map pixel's solid angle that the frame sees, row-major. Where it is below 1, at the
    /// rim of the lens, the map is dimmer by the same factor: energy is preserved, not made up. It is the
    /// same for all colours of a mosaic.
    pub fn coverage(&self) -> &[f32] {
        &self.coverage
    }

    /// Bytes of the weights that every frame streams.
    pub fn streamed_bytes(&self) -> usize {
        match &self.weights {
            Weights::Whole(matrix) => matrix.streamed_bytes(),
            Weights::Mosaic(mosaic) => mosaic.streamed_bytes(),
            Weights::LatLong(weights) => weights.bytes(),
        }
    }

    /// Fills `map` from a frame of raw codes (through the response) or of linear radiance (as it is: the
    /// response is for codes) and gives it the frame's stamp. One channel fills all three. Returns the counts
    /// of the pixels that hold no valid radiance, among those that the map sees; every pixel of a mosaic
    /// counts once.
    ///
    /// Rounding stays below 1e-5 of every map pixel, relative to the colours before the colour matrix if
    /// there is one: weights and radiances are rounded once to f32, the sum of a map pixel's part in a band
    /// at most 70 times, and these sums are added in f64. Allocates only when `map` has another shape.
    ///
    /// # Errors
    /// `BadFrame`, naming what the frame has and what the calibration wants: size, channels, mosaic, samples,
    /// codes without a response, and a colour matrix for frames without colours.
    pub fn apply(&mut self, frame: &Frame, response: &Response, map: &mut PolarMap) -> Result<PixelCounts> {
        self.check_frame(frame, response)?;
        let lookup = response.lookup();
        let (counts, channels) = match (&mut self.weights, &frame.pixels) {
            (Weights::Mosaic(mosaic), Pixels::Codes(codes)) => {
                self.sums.fill(0.0);
                let (planes, _) = self.radiance.as_chunks_mut::<PLANE>();
                (mosaic.add(codes, lookup, &mut planes[0], &mut self.sums), 3)
            }
            (Weights::Whole(matrix), _) => {
                let sums = &mut self.sums[..frame.channels * self.shape.len()];
                sums.fill(0.0);
                (add_whole(matrix, frame, lookup, &mut self.radiance, sums), frame.channels)
            }
            (Weights::LatLong(weights), _) => {
                let sums = &mut self.sums[..frame.channels * self.shape.len()];
                sums.fill(0.0);
                (weights.add(frame, lookup, &mut self.radiance, sums), frame.channels)
            }
            (Weights::Mosaic(_), Pixels::Radiance(_)) => {
                return Err(Error::bad_frame(
                    "the frame is a mosaic of radiance; a mosaic must hold the sensor's raw codes",
                ));
            }
        };
        self.write(channels, map);
        map.stamp = frame.stamp;
        Ok(counts)
    }

    fn write(&self, channels: usize, map: &mut PolarMap) {
        if map.shape != self.shape || map.pixels.len() != self.shape.len() {
            *map = PolarMap::black(self.shape);
        }
        // Weights that add up to 1 + 1e-7 may exceed the range of f32.
        let round = |sum: f64| sum.min(f64::from(f32::MAX)) as f32;
        if channels == 1 {
            for (pixel, &sum) in map.pixels.iter_mut().zip(&self.sums) {
                *pixel = [round(sum); 3];
            }
            return;
        }
        let (red, others) = self.sums.split_at(self.shape.len());
        let (green, blue) = others.split_at(self.shape.len());
        let colours = red.iter().zip(green).zip(blue).map(|((&red, &green), &blue)| [red, green, blue]);
        match &self.rec709_from_sensor {
            None => {
                for (pixel, colour) in map.pixels.iter_mut().zip(colours) {
                    *pixel = colour.map(round);
                }
            }
            Some(matrix) => {
                for (pixel, colour) in map.pixels.iter_mut().zip(colours) {
                    *pixel = matrix.rec709(DVec3::from(colour)).to_array().map(round);
                }
            }
        }
    }

    fn check_frame(&self, frame: &Frame, response: &Response) -> Result<()> {
        let Frame { width, height, channels, .. } = *frame;
        if (width, height) != (self.width, self.height) {
            return Err(Error::bad_frame(format!(
                "the frame has {width} x {height} pixels, its calibration is for {} x {}",
                self.width, self.height
            )));
        }
        if channels != 1 && channels != 3 {
            return Err(Error::bad_frame(format!(
                "the frame has {channels} channels, 1 (luminance) or 3 (RGB) can be used"
            )));
        }
        let expected = match &self.weights {
            Weights::Whole(_) | Weights::LatLong(_) => None,
            Weights::Mosaic(mosaic) => Some(mosaic.bayer()),
        };
        if frame.bayer != expected || (frame.bayer.is_some() && channels != 1) {
            let name = |bayer: Option<Bayer>| {
                bayer.map_or("no mosaic".to_owned(), |bayer| format!("a mosaic of colours {bayer}"))
            };
            return Err(Error::bad_frame(format!(
                "the frame is {} with {channels} channels, its calibration is for {}{}",
                name(frame.bayer),
                name(expected),
                if expected.is_some() { " with 1 channel" } else { "" }
            )));
        }
        if self.rec709_from_sensor.is_some() && channels == 1 && frame.bayer.is_none() {
            return Err(Error::bad_frame(
                "the frame has 1 channel and no colours, its calibration has a matrix for the sensor's colours; \
                 take away rec709_from_sensor",
            ));
        }
        let (samples, coded) = match &frame.pixels {
            Pixels::Codes(codes) => (codes.len(), true),
            Pixels::Radiance(radiance) => (radiance.len(), false),
        };
        if samples != width * height * channels {
            return Err(Error::bad_frame(format!(
                "the frame has {samples} samples, {width} x {height} pixels of {channels} channels are {}",
                width * height * channels
            )));
        }
        if coded && response.is_identity() {
            return Err(Error::bad_frame(
                "the frame holds raw sensor codes, its calibration has no response; add one (logarithmic, \
                 linear or piecewise-linear)",
            ));
        }
        Ok(())
    }
}

/// Solid angles of map pixels as fractions of the whole pixels.
fn fractions(solid_angles_sr: &[f64], shape: PolarShape) -> Vec<f32> {
    let fraction = |(cell, sr): (usize, &f64)| (sr / shape.pixel_solid_angle(cell / shape.columns())) as f32;
    solid_angles_sr.iter().enumerate().map(fraction).collect()
}

/// Adds a frame whose pixels have all channels to the sums, one plane per channel.
fn add_whole(
    matrix: &AreaMatrix,
    frame: &Frame,
    lookup: CodeLookup,
    radiance: &mut [f32],
    sums: &mut [f64],
) -> PixelCounts {
    let channels = frame.channels;
    let cells = sums.len() / channels;
    let mut counts = PixelCounts::default();
    for band in 0..matrix.band_count() {
        let first_pixel = matrix.first_pixel(band);
        for span in matrix.spans(band) {
            let samples = span.start * channels..span.end * channels;
            let planes = &mut radiance[span.start - first_pixel..];
            counts.add(&match &frame.pixels {
                Pixels::Codes(codes) => decode_codes(&codes[samples], channels, lookup, planes),
                Pixels::Radiance(values) => {
                    decode_radiance(&values[samples], channels, frame.saturation, planes)
                }
            });
        }
        let (planes, _) = radiance.as_chunks::<PLANE>();
        for (plane, sums) in planes.iter().zip(sums.chunks_exact_mut(cells)) {
            matrix.add(band, plane, sums);
        }
    }
    counts
}

/// Refuses arguments from which no matrix can be made, before anything is allocated for it, and returns the
/// exact rotation.
fn check(projection: &Projection, world_from_camera: DMat3) -> Result<DMat3> {
    projection.check_size()?;
    rotation(world_from_camera)
}

/// Refuses a matrix that is not a rotation, and removes the rounding errors from one that nearly is.
fn rotation(world_from_camera: DMat3) -> Result<DMat3> {
    let off = world_from_camera * world_from_camera.transpose() - DMat3::IDENTITY;
    let worst = off
        .to_cols_array()
        .into_iter()
        .fold(0.0f64, |worst, value| if value.is_nan() { f64::INFINITY } else { worst.max(value.abs()) });
    // Files give rotations with six digits or more; a matrix that is further off is a scale, a shear or a
    // mistake.
    if worst > 1e-5 || world_from_camera.determinant() <= 0.0 {
        let rows = world_from_camera.transpose().to_cols_array_2d();
        return Err(Error::usage(format!(
            "is not a rotation: its rows must be perpendicular unit vectors, right-handed (off by {worst:.1e}, \
             determinant {:.6})",
            world_from_camera.determinant(),
        ))
        .in_option("world_from_camera", Some(&format!("{rows:?}"))));
    }
    // An exact matrix stays as it is.
    Ok(if worst > 1e-14 {
        DMat3::from_quat(DQuat::from_mat3(&world_from_camera).normalize())
    } else {
        world_from_camera
    })
}
