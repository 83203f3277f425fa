//! What a pixel sees: directions for positions in the picture.

use crate::camera::Lens;
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Projection of a synthetic picture. Pixel positions have half-pixel centres: the first pixel is
/// [0, 1] x [0, 1].
#[derive(Clone, Debug)]
pub enum View {
    /// The whole sphere in OpenEXR's orientation: image centre +Z, left of centre +X, first row up.
    LatLong {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// Through a lens.
    Fisheye {
        /// The lens, with the size of the picture.
        lens: Lens,
        /// Rotation from the camera frame (+Z the axis, +X right, +Y down) to the world.
        world_from_camera: DMat3,
    },
}

impl View {
    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::LatLong { width, height } => (*width, *height),
            Self::Fisheye { lens, .. } => (lens.parameters().width, lens.parameters().height),
        }
    }

    /// Unit direction in the world of a position; `None` outside the lens's field of view.
    pub fn direction(&self, x: f64, y: f64) -> Option<DVec3> {
        match self {
            Self::LatLong { width, height } => {
                let theta_rad = PI * y / *height as f64;
                Some(crate::math::direction(theta_rad, TAU * x / *width as f64 - FRAC_PI_2))
            }
            Self::Fisheye { lens, world_from_camera } => {
                lens.unproject(DVec2::new(x, y)).map(|direction| *world_from_camera * direction)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lat_long_is_oriented_as_open_exr_says() {
        let view = View::LatLong { width: 8, height: 4 };
        for (x, y, expected) in
            [(4.0, 2.0, DVec3::Z), (2.0, 2.0, DVec3::X), (6.0, 2.0, DVec3::NEG_X), (0.0, 2.0, DVec3::NEG_Z)]
        {
            assert!((view.direction(x, y).unwrap() - expected).length() < 1e-12);
        }
        assert!((view.direction(5.0, 0.0).unwrap() - DVec3::Y).length() < 1e-12);
    }
}
