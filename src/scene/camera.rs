use super::Bounds;
use glam::{Mat3, Vec3};

/// How far above the horizon a camera of [`Camera::framing`] stands, seen from the centre of what it shows,
/// and how far to the right of +Z.
const ELEVATION_RAD: f32 = 20.0 * std::f32::consts::PI / 180.0;
const AZIMUTH_RAD: f32 = 30.0 * std::f32::consts::PI / 180.0;

/// Vertical field of view of [`Camera::framing`].
const FOV_RAD: f32 = 40.0 * std::f32::consts::PI / 180.0;

/// Largest fraction of the picture's width and height that a framed box fills.
const FILLED: f32 = 0.9;

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
    /// A camera that shows all of `bounds` in a picture of `aspect` (width over height), from 20 degrees
    /// above, 30 degrees to the right of +Z, with a vertical field of view of 40 degrees.
    ///
    /// The box fills at most nine tenths of the picture's width and of its height, and exactly nine tenths of
    /// one of them. A point and the empty box are shown as if they were a unit cube. An `aspect` that is not
    /// finite and > 0 counts as 1.
    pub fn framing(bounds: &Bounds, aspect: f32) -> Self {
        let aspect = if aspect.is_finite() && aspect > 0.0 { aspect } else { 1.0 };
        let centre = bounds.centre();
        let half = if bounds.radius() > 0.0 { bounds.half_extents() } else { Vec3::splat(0.5) };
        let bounds = Bounds { min: centre - half, max: centre + half };

        let (sin_elevation, cos_elevation) = ELEVATION_RAD.sin_cos();
        let (sin_azimuth, cos_azimuth) = AZIMUTH_RAD.sin_cos();
        let back = Vec3::new(cos_elevation * sin_azimuth, sin_elevation, cos_elevation * cos_azimuth);
        let right = Vec3::new(cos_azimuth, 0.0, -sin_azimuth);
        let up = back.cross(right);
        let slope_y = (0.5 * FOV_RAD).tan() * FILLED;
        let slope_x = slope_y * aspect;
        // Every corner requires a distance at which it is just inside the edges.
        let (mut distance, mut nearest) = (0.0_f32, 0.0_f32);
        for corner in bounds.corners() {
            let offset = corner - centre;
            let towards = offset.dot(back);
            let (x, y) = (offset.dot(right).abs() / slope_x, offset.dot(up).abs() / slope_y);
            distance = distance.max(towards + x.max(y));
            nearest = nearest.max(towards);
        }
        Self {
            eye: centre + back * distance,
            target: centre,
            up: Vec3::Y,
            vertical_fov_rad: FOV_RAD,
            // Half the distance to the box, so that objects moving towards the camera are not clipped at
            // once.
            near: (0.5 * (distance - nearest)).max(1e-3 * distance),
        }
    }

    /// The rotation from the axes of the world to those of the camera: +X right, +Y up, looking along -Z.
    ///
    /// Where the camera's fields are degenerate, the camera looks along -Z (eye and target at the same
    /// point), or some other axis of the world is up (`up` along the optical axis); the result is always a
    /// rotation.
    pub fn view_from_world(&self) -> Mat3 {
        let forward = (self.target - self.eye).try_normalize().unwrap_or(Vec3::NEG_Z);
        // The cross product of parallel vectors is only rounding error and counts as zero.
        let right = forward.cross(self.up.normalize_or_zero());
        let right = if right.length() > 1e-3 { right } else { forward.any_orthonormal_vector() };
        let right = right.normalize_or_zero();
        Mat3::from_cols(right, right.cross(forward), -forward).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest |x| and |y| of the box in the picture, whose edges are at -1 and 1.
    fn extent(camera: &Camera, bounds: &Bounds, aspect: f32) -> Vec3 {
        let view = camera.view_from_world();
        let slope = (0.5 * camera.vertical_fov_rad).tan();
        bounds.corners().into_iter().fold(Vec3::new(0.0, 0.0, f32::INFINITY), |most, corner| {
            let p = view * (corner - camera.eye);
            let (x, y) = (p.x.abs() / (-p.z * slope * aspect), p.y.abs() / (-p.z * slope));
            Vec3::new(most.x.max(x), most.y.max(y), most.z.min(-p.z))
        })
    }

    #[test]
    fn the_whole_box_is_framed_and_it_fills_the_picture() {
        for (min, max) in [
            (Vec3::ZERO, Vec3::ONE),
            (Vec3::new(-50.0, 3.0, 1.0), Vec3::new(70.0, 3.5, 2.0)),
            (Vec3::splat(1e-5), Vec3::splat(2e-5)),
            (Vec3::new(0.0, -1e6, 0.0), Vec3::new(0.0, 1e6, 1e5)),
        ] {
            for aspect in [0.5, 1.0, 16.0 / 9.0] {
                let bounds = Bounds { min, max };
                let camera = Camera::framing(&bounds, aspect);
                let most = extent(&camera, &bounds, aspect);
                assert!((most.x.max(most.y) - 0.9).abs() < 1e-3, "{most} {bounds:?}");
                assert!(0.0 < camera.near && camera.near < most.z, "{} {most}", camera.near);
                assert!(camera.eye.y > camera.target.y);
            }
        }
    }

    #[test]
    fn nothing_to_frame_gives_a_camera_all_the_same() {
        for bounds in [Bounds::EMPTY, Bounds::of([Vec3::ZERO])] {
            for aspect in [f32::NAN, 0.0, -1.0, f32::INFINITY, 1.0] {
                let cube = Bounds { min: Vec3::splat(-0.5), max: Vec3::splat(0.5) };
                assert_eq!(Camera::framing(&bounds, aspect), Camera::framing(&cube, 1.0));
            }
        }
    }

    #[test]
    fn degenerate_cameras_still_have_a_rotation() {
        let sound = Camera::framing(&Bounds::EMPTY, 1.0);
        for camera in [
            Camera { eye: sound.target, ..sound },
            Camera { up: Vec3::ZERO, ..sound },
            Camera { up: sound.target - sound.eye, ..sound },
        ] {
            let view = camera.view_from_world();
            assert!((view.determinant() - 1.0).abs() < 1e-5 && view.is_finite(), "{view}");
            assert!((view * view.transpose()).abs_diff_eq(Mat3::IDENTITY, 1e-5), "{view}");
        }
    }
}
