//! Projection from the world to the picture.

use crate::scene::Camera;
use glam::dcamera::rh;
use glam::{DMat4, DVec3};
use lightcast_core::sampling::halton;

/// Offset of a sample from the centre of its pixel: points of the Halton sequence; the centre if there is one
/// sample.
pub(super) fn pixel_offset(sample: u32, samples: u32) -> [f64; 2] {
    if samples == 1 {
        return [0.0; 2];
    }
    [2, 3].map(|base| halton(u64::from(sample) + 1, base) - 0.5)
}

/// Projection from positions relative to the eye, along the axes of the world, so that scenes far from the
/// origin keep their precision. Reversed depth without a far plane; `offset_px` shifts the picture by
/// fractions of a pixel.
pub(super) fn clip_from_eye(camera: &Camera, [width, height]: [u32; 2], offset_px: [f64; 2]) -> DMat4 {
    let aspect = f64::from(width) / f64::from(height);
    let clip_from_view = rh::proj::directx::perspective_infinite_reverse(
        f64::from(camera.vertical_fov_rad),
        aspect,
        f64::from(camera.near),
    );
    let offset =
        DVec3::new(2.0 * offset_px[0] / f64::from(width), 2.0 * offset_px[1] / f64::from(height), 0.0);
    DMat4::from_translation(offset) * clip_from_view * DMat4::from_mat3(camera.view_from_world().as_dmat3())
}
