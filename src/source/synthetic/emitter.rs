//! Flat emitters with a soft edge: the sun's disc and lamps.

use crate::error::{Error, Place, Result};
use glam::DVec3;
use lightcast_core::math::direction;

/// Outline of an emitter in its own plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// The ellipse with the two half axes `half_u` and `half_v`.
    Disc,
    /// The rectangle with these two half axes.
    Rectangle,
}

/// Half the width of the soft edge, as a fraction of the half axis. The edge makes the pixel integral smooth
/// in the emitter's position, so that a few dozen cells across yield its power to four digits; a hard edge
/// would need thousands. The value is the largest that still looks like an edge.
const EDGE: f64 = 0.15;

/// Cells across a half axis that the pixel integral needs: the soft edge is then five cells wide.
const CELLS_PER_HALF_AXIS: f64 = 16.0;

/// A flat patch of constant radiance, seen from the origin. It may have any position and orientation; the sun
/// is a disc at distance 1.
#[derive(Clone, Copy, Debug)]
pub struct Emitter {
    /// Middle of the patch, relative to the camera.
    pub centre: DVec3,
    /// Vector from the centre to the middle of one side.
    pub half_u: DVec3,
    /// The other half axis, perpendicular to the first.
    pub half_v: DVec3,
    /// Its outline.
    pub shape: Shape,
    /// RGB radiance.
    pub radiance: [f64; 3],
}

impl Emitter {
    /// A far disc that faces the camera: direction by azimuth (from +X towards +Z) and elevation, angular
    /// radius, all in degrees.
    pub fn far_disc(azimuth_deg: f64, elevation_deg: f64, radius_deg: f64, radiance: [f64; 3]) -> Self {
        let (theta_rad, phi_rad) = ((90.0 - elevation_deg).to_radians(), azimuth_deg.to_radians());
        let centre = direction(theta_rad, phi_rad);
        // The half axes are along the derivatives of `direction` by phi and theta, as unit vectors also at
        // the pole.
        let half_u = DVec3::new(-phi_rad.sin(), 0.0, phi_rad.cos());
        let half_v = half_u.cross(centre);
        let scale = radius_deg.to_radians().tan();
        Self { centre, half_u: half_u * scale, half_v: half_v * scale, shape: Shape::Disc, radiance }
    }

    /// Coverage of a direction (unit vector) by the emitter: 1 inside, 0 outside, smooth in between.
    pub fn profile(&self, direction: DVec3) -> f64 {
        let normal = self.half_u.cross(self.half_v);
        let (height, slope) = (self.centre.dot(normal), direction.dot(normal));
        // Only emitters in front of the camera count, and not edge-on.
        if height * slope <= 0.0 {
            return 0.0;
        }
        let offset = direction * (height / slope) - self.centre;
        let u = offset.dot(self.half_u) / self.half_u.length_squared();
        let v = offset.dot(self.half_v) / self.half_v.length_squared();
        match self.shape {
            Shape::Disc => edge(u.hypot(v)),
            Shape::Rectangle => edge(u.abs()) * edge(v.abs()),
        }
    }

    /// Area in the plane, soft edge included. The edge is symmetric, which leaves a rectangle's area
    /// unchanged; a disc gains the variance of the edge, `EDGE^2 / 5` for the cubic step.
    pub fn area(&self) -> f64 {
        let square = self.half_u.length() * self.half_v.length();
        match self.shape {
            Shape::Disc => std::f64::consts::PI * square * (1.0 + EDGE * EDGE / 5.0),
            Shape::Rectangle => 4.0 * square,
        }
    }

    /// Where the pixel integral must be fine.
    pub fn detail(&self) -> Detail {
        let reach = match self.shape {
            Shape::Disc => self.half_u.length().max(self.half_v.length()),
            Shape::Rectangle => self.half_u.length().hypot(self.half_v.length()),
        } * (1.0 + EDGE);
        let distance = self.centre.length();
        // Seen obliquely, the short side shrinks by the cosine.
        let normal = self.half_u.cross(self.half_v).normalize_or_zero();
        let slant = (self.centre.dot(normal).abs() / distance).max(0.05);
        let short = self.half_u.length().min(self.half_v.length());
        Detail {
            direction: self.centre / distance,
            radius_rad: if reach < distance {
                (reach / distance).asin()
            } else {
                std::f64::consts::FRAC_PI_2
            },
            cell_rad: short * slant / distance / CELLS_PER_HALF_AXIS,
        }
    }
}

/// A part of a scene with detail that may be finer than a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Detail {
    /// Axis of a cone that contains it.
    pub direction: DVec3,
    /// Half-angle of the cone.
    pub radius_rad: f64,
    /// Size of the cells that integrate its power to 1e-4.
    pub cell_rad: f64,
}

/// Cubic step from 1 at `1 - EDGE` to 0 at `1 + EDGE`.
fn edge(distance: f64) -> f64 {
    let x = ((1.0 + EDGE - distance) / (2.0 * EDGE)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Refuses a value of `key` that cannot be a radiance held in f32: negative, not finite, or too large.
pub(super) fn check_radiance(key: &str, rgb: [f64; 3]) -> Result<()> {
    if rgb.into_iter().all(|value| (0.0..=f64::from(f32::MAX)).contains(&value)) {
        return Ok(());
    }
    Err(Error::usage("must be finite and not negative").at(Place::key(key)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::math::angle_between;

    /// Midpoint sum of `profile` over a plane at the emitter, in its own coordinates.
    fn summed_area(emitter: &Emitter) -> f64 {
        let n = 400;
        let step = 2.4 / f64::from(n);
        let cell = emitter.half_u.length() * emitter.half_v.length() * step * step;
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let (u, v) = (-1.2 + (f64::from(i) + 0.5) * step, -1.2 + (f64::from(j) + 0.5) * step);
                let point = emitter.centre + emitter.half_u * u + emitter.half_v * v;
                sum += emitter.profile(point.normalize_or_zero()) * cell;
            }
        }
        sum
    }

    #[test]
    fn areas_are_those_of_the_closed_form() {
        let sun = Emitter::far_disc(30.0, 50.0, 0.2666, [1.0; 3]);
        let lamp = Emitter {
            centre: DVec3::new(1.0, 2.5, -0.5),
            half_u: DVec3::new(0.6, 0.0, 0.0),
            half_v: DVec3::new(0.0, 0.0, 0.15),
            shape: Shape::Rectangle,
            radiance: [1.0; 3],
        };
        for emitter in [sun, lamp] {
            assert!((summed_area(&emitter) / emitter.area() - 1.0).abs() < 1e-5, "{emitter:?}");
        }
    }

    #[test]
    fn far_discs_stand_where_they_are_told_also_at_the_pole() {
        for (azimuth, elevation) in [(0.0, 0.0), (90.0, 30.0), (123.0, 90.0), (-20.0, -5.0)] {
            let sun = Emitter::far_disc(azimuth, elevation, 0.2666, [1.0; 3]);
            let (theta, phi) = ((90.0 - elevation).to_radians(), azimuth.to_radians());
            assert!(angle_between(sun.centre, direction(theta, phi)) < 1e-12);
            assert_eq!(sun.profile(sun.centre), 1.0);
            assert_eq!(sun.profile(-sun.centre), 0.0);
            let rim = (sun.centre + sun.half_u).normalize_or_zero();
            assert!((angle_between(rim, sun.centre) - 0.2666f64.to_radians()).abs() < 1e-9);
            assert!((sun.profile(rim) - 0.5).abs() < 1e-9);
        }
    }

    #[test]
    fn nothing_shines_outside_the_cone_of_its_detail() {
        let sun = Emitter::far_disc(30.0, 50.0, 5.0, [1.0; 3]);
        let detail = sun.detail();
        for i in 0..360 {
            let turn = f64::from(i).to_radians();
            let out = sun.half_u * turn.cos() + sun.half_v * turn.sin();
            let beyond = (sun.centre + out * 1.17).normalize_or_zero();
            assert!(angle_between(beyond, detail.direction) > detail.radius_rad);
            assert_eq!(sun.profile(beyond), 0.0);
        }
    }
}
