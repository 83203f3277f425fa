use super::Lens;
use crate::error::{Error, Result};
use crate::image::LatLongCentres;
use crate::math::direction;
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// `world_from_camera` of a camera on its back, the default for a fisheye: x (right) to +X, y (down) to -Z, z
/// (the optical axis) to +Y.
pub const LOOKING_UP: DMat3 = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);

/// How a frame's pixels lie on the sphere of directions, in the camera frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Lat-long picture in OpenEXR's orientation: image centre +Z, left of centre +X, top row +Y; its
    /// "camera" frame is +Y up, so the identity as `world_from_camera` leaves it upright.
    LatLong {
        /// Columns over the full turn.
        width: usize,
        /// Rows from +Y down to -Y.
        height: usize,
        /// Where pixel centres lie.
        centres: LatLongCentres,
    },
    /// Fisheye lens.
    Fisheye(Lens),
}

impl Projection {
    /// Columns of the frames.
    pub fn width(&self) -> usize {
        match self {
            Self::LatLong { width, .. } => *width,
            Self::Fisheye(lens) => lens.parameters().width,
        }
    }

    /// Rows of the frames.
    pub fn height(&self) -> usize {
        match self {
            Self::LatLong { height, .. } => *height,
            Self::Fisheye(lens) => lens.parameters().height,
        }
    }

    /// Unit direction in the camera frame of a position in the frame: pixel (column, row) extends from
    /// (column, row) to (column + 1, row + 1). `None` outside a lens's field of view. Positions outside a
    /// lat-long picture are clamped to it.
    ///
    /// With centres on the ends the pixels at the borders are cut in half there: they reach from the border
    /// to the middle between their own and the next centre, so that the pixels tile the sphere once.
    pub fn unproject(&self, position: DVec2) -> Option<DVec3> {
        match self {
            Self::LatLong { width, height, centres } => {
                let u = border_fraction(position.x, *width, *centres);
                let v = border_fraction(position.y, *height, *centres);
                Some(direction(PI * v, TAU * u - PI / 2.0))
            }
            Self::Fisheye(lens) => lens.unproject(position),
        }
    }

    /// Refuses sizes that no frame has, before anything is allocated for them.
    pub(super) fn check_size(&self) -> Result<()> {
        let (width, height) = (self.width(), self.height());
        // Column numbers are kept in 16 bits; 2^27 pixels is a 16,384 x 8,192 panorama.
        for (name, side_px) in [("width", width), ("height", height)] {
            if !(1..=65_535).contains(&side_px) {
                return Err(
                    Error::usage("frames have 1 to 65535 pixels a side").in_option(name, Some(&side_px))
                );
            }
        }
        if width * height > 1 << 27 {
            let fault = format!("frames have at most 2^27 pixels in all, these have {height} rows");
            return Err(Error::usage(fault).in_option("width", Some(&width)));
        }
        Ok(())
    }
}

/// Fraction of the picture left of `position`, which counts pixels from the border.
pub(super) fn border_fraction(position: f64, count: usize, centres: LatLongCentres) -> f64 {
    let position = position.clamp(0.0, count as f64);
    match centres {
        LatLongCentres::Ends if count > 1 => {
            let border = |index: f64| ((index - 0.5) / (count as f64 - 1.0)).clamp(0.0, 1.0);
            let index = position.floor().min(count as f64 - 1.0);
            border(index) + (position - index) * (border(index + 1.0) - border(index))
        }
        _ => position / count as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lat_long_orientation_is_openexrs() {
        let picture = Projection::LatLong { width: 8, height: 4, centres: LatLongCentres::Half };
        for (x, y, expected) in [
            (4.0, 2.0, DVec3::Z),
            (2.0, 2.0, DVec3::X),
            (6.0, 2.0, DVec3::NEG_X),
            (0.0, 2.0, DVec3::NEG_Z),
            (3.0, 0.0, DVec3::Y),
            (3.0, 4.0, DVec3::NEG_Y),
        ] {
            let found = picture.unproject(DVec2::new(x, y)).unwrap();
            assert!((found - expected).length() < 1e-15, "{x} {y}: {found}");
        }
    }

    #[test]
    fn pixels_with_centres_on_the_ends_are_halved_at_the_borders() {
        let picture = Projection::LatLong { width: 5, height: 3, centres: LatLongCentres::Ends };
        // Column 1 of 5 is centred at a quarter turn from the left border, which is -Z: that is +X.
        let found = picture.unproject(DVec2::new(1.5, 1.5)).unwrap();
        assert!((found - DVec3::X).length() < 1e-15, "{found}");
        assert!((border_fraction(1.0, 5, LatLongCentres::Ends) - 0.125).abs() < 1e-15);
        assert_eq!(border_fraction(5.0, 5, LatLongCentres::Ends), 1.0);
        assert_eq!(border_fraction(0.5, 1, LatLongCentres::Ends), 0.5);
    }

    #[test]
    fn looking_up_is_a_rotation_that_lifts_the_axis() {
        assert_eq!(LOOKING_UP.determinant(), 1.0);
        assert_eq!(LOOKING_UP * DVec3::Z, DVec3::Y);
        assert_eq!(LOOKING_UP * DVec3::X, DVec3::X);
        assert_eq!(LOOKING_UP * DVec3::Y, DVec3::NEG_Z);
    }
}
