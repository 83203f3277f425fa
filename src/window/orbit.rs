use crate::scene::Camera;
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// Smallest angle of the eye from straight above or below the target: there the up vector is degenerate, and
/// [`Camera::view_from_world`] chooses another one below 1e-3.
const POLE_GAP_RAD: f64 = 1e-2;
/// Factor on the distance for one notch of the wheel.
const NOTCH: f64 = 0.9;
/// Largest factor by which the distance grows or shrinks from that of the first camera.
const ZOOM_RANGE: f64 = 1e3;
/// Distance of the near plane as a fraction of the distance to the target. With reversed depth such a close
/// near plane costs no precision, and a camera that is moved freely clips nothing.
const NEAR: f64 = 1e-3;

/// A camera that orbits a point and looks at it, upright.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Orbit {
    target: DVec3,
    /// Angles of the eye as seen from the target: azimuth from +Z towards +X, elevation from the horizon up.
    azimuth_rad: f64,
    elevation_rad: f64,
    distance: f64,
    first_distance: f64,
    vertical_fov_rad: f64,
}

impl Orbit {
    /// Starts at the position of `camera`, turned upright.
    pub fn new(camera: &Camera) -> Self {
        let target = camera.target.as_dvec3();
        let offset = camera.eye.as_dvec3() - target;
        let distance = offset.length().max(f64::from(f32::MIN_POSITIVE));
        Self {
            target,
            azimuth_rad: offset.x.atan2(offset.z),
            elevation_rad: clamped((offset.y / distance).clamp(-1.0, 1.0).asin()),
            distance,
            first_distance: distance,
            vertical_fov_rad: f64::from(camera.vertical_fov_rad),
        }
    }

    /// The current camera.
    pub fn camera(&self) -> Camera {
        Camera {
            eye: (self.target + self.distance * self.back()).as_vec3(),
            target: self.target.as_vec3(),
            up: glam::Vec3::Y,
            vertical_fov_rad: self.vertical_fov_rad as f32,
            near: (NEAR * self.distance) as f32,
        }
    }

    /// Handles a drag to the right and down by `[right, down]` pixels in a window `height_px` high: the scene
    /// turns with the pointer, half a turn over the height of the window.
    pub fn turn(&mut self, [right_px, down_px]: [f64; 2], height_px: u32) {
        let rad_per_px = PI / f64::from(height_px.max(1));
        self.azimuth_rad = (self.azimuth_rad - right_px * rad_per_px).rem_euclid(2.0 * PI);
        self.elevation_rad = clamped(self.elevation_rad + down_px * rad_per_px);
    }

    /// Handles a drag as [`Self::turn`] does: points at the target's distance move with the pointer.
    pub fn pan(&mut self, [right_px, down_px]: [f64; 2], height_px: u32) {
        let per_px = 2.0 * self.distance * (0.5 * self.vertical_fov_rad).tan() / f64::from(height_px.max(1));
        let right = DVec3::new(self.azimuth_rad.cos(), 0.0, -self.azimuth_rad.sin());
        let up = self.back().cross(right);
        self.target += (up * down_px - right * right_px) * per_px;
    }

    /// Moves closer by `notches` of the wheel, or away if they are negative.
    pub fn zoom(&mut self, notches: f64) {
        let range = self.first_distance / ZOOM_RANGE..=self.first_distance * ZOOM_RANGE;
        self.distance = (self.distance * NOTCH.powf(notches)).clamp(*range.start(), *range.end());
    }

    /// Unit vector from the target to the eye.
    fn back(&self) -> DVec3 {
        let (sin_elevation, cos_elevation) = self.elevation_rad.sin_cos();
        let (sin_azimuth, cos_azimuth) = self.azimuth_rad.sin_cos();
        DVec3::new(cos_elevation * sin_azimuth, sin_elevation, cos_elevation * cos_azimuth)
    }
}

fn clamped(elevation_rad: f64) -> f64 {
    elevation_rad.clamp(POLE_GAP_RAD - FRAC_PI_2, FRAC_PI_2 - POLE_GAP_RAD)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn camera() -> Camera {
        Camera {
            eye: Vec3::new(1.0, 2.0, 5.0),
            target: Vec3::new(1.0, 2.0, 1.0),
            up: Vec3::Y,
            vertical_fov_rad: 2.0 * 0.5f32.atan(),
            near: 0.1,
        }
    }

    fn assert_near(a: Vec3, b: [f32; 3]) {
        assert!(a.distance(Vec3::from(b)) < 1e-5, "{a} {b:?}");
    }

    #[test]
    fn it_starts_where_the_camera_is() {
        for eye in [[1.0, 2.0, 5.0], [-3.0, 4.0, 1.5], [1.0, 1.0, -8.0]] {
            let orbit = Orbit::new(&Camera { eye: eye.into(), ..camera() });
            assert_near(orbit.camera().eye, eye);
            assert_near(orbit.camera().target, [1.0, 2.0, 1.0]);
        }
    }

    #[test]
    fn a_drag_over_half_the_window_turns_by_a_quarter() {
        let mut orbit = Orbit::new(&camera());
        orbit.turn([-100.0, 0.0], 200);
        assert_near(orbit.camera().eye, [5.0, 2.0, 1.0]);
        orbit.turn([100.0, 50.0], 200);
        let diagonal = 4.0 * 0.5f32.sqrt();
        assert_near(orbit.camera().eye, [1.0, 2.0 + diagonal, 1.0 + diagonal]);
    }

    #[test]
    fn it_stops_short_of_the_poles_and_stays_upright() {
        let mut orbit = Orbit::new(&camera());
        for down_px in [1e6, -1e6] {
            orbit.turn([3.0, down_px], 200);
            let camera = orbit.camera();
            let forward = (camera.target - camera.eye).normalize_or_zero();
            assert!((forward.y.abs() - 1.0).abs() < 1e-4 && forward.y * down_px as f32 <= 0.0);
            let side = camera.view_from_world().row(0).truncate();
            assert!(side.y.abs() < 1e-4, "level: {side}");
        }
        let above = Camera { eye: Vec3::new(1.0, 9.0, 1.0), up: Vec3::Z, ..camera() };
        assert!(Orbit::new(&above).camera().view_from_world().is_finite());
    }

    #[test]
    fn a_pan_moves_the_target_with_the_hand() {
        // The window shows 2 * 4 * 0.5 = 4 units at the target's distance.
        let mut orbit = Orbit::new(&camera());
        orbit.pan([50.0, 0.0], 200);
        assert_near(orbit.camera().target, [0.0, 2.0, 1.0]);
        assert_near(orbit.camera().eye, [0.0, 2.0, 5.0]);
        orbit.pan([0.0, 25.0], 200);
        assert_near(orbit.camera().target, [0.0, 2.5, 1.0]);
    }

    #[test]
    fn the_wheel_goes_nearer_by_a_tenth_and_not_through_the_target() {
        let mut orbit = Orbit::new(&camera());
        orbit.zoom(1.0);
        assert_near(orbit.camera().eye, [1.0, 2.0, 4.6]);
        orbit.zoom(-1.0);
        assert_near(orbit.camera().eye, [1.0, 2.0, 5.0]);
        for (notches, distance) in [(1e9, 4e-3), (-1e9, 4e3)] {
            orbit.zoom(notches);
            let camera = orbit.camera();
            assert!((camera.eye.distance(camera.target) / distance - 1.0).abs() < 1e-3);
        }
    }
}
