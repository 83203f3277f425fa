//! Mean radiance over a pixel's solid angle.
//!
//! A pixel is cut into `n x n` cells. Each is a spherical quadrilateral between four directions and is
//! weighted by its solid angle: constant scenes stay constant with any lens, and radiance times the pixel's
//! solid angle sums to the scene's power. Within a [`Detail`] the cells become as fine as it requires, so
//! that a sun much smaller than a pixel keeps its power at any position.

use super::emitter::Detail;
use glam::{DMat3, DVec2, DVec3};
use lightcast_core::camera::Projection;

/// Most cells across a pixel. With more, a lamp seen edge-on would cost more than the rest of a picture.
const CELLS_MAX: usize = 256;

/// The directions of pixels.
#[derive(Clone, Copy, Debug)]
pub struct FrameView {
    /// Maps a position in the picture to a direction in the camera frame.
    pub projection: Projection,
    /// Camera frame to world.
    pub world_from_camera: DMat3,
}

impl FrameView {
    /// Unit direction, in the world, of a position in the picture (half-pixel centres); `None` outside the
    /// field of view.
    fn direction(&self, x: f64, y: f64) -> Option<DVec3> {
        self.projection.unproject(DVec2::new(x, y)).map(|direction| self.world_from_camera * direction)
    }
}

/// Working memory of one thread.
#[derive(Default)]
pub struct PixelIntegral {
    upper: Vec<Option<DVec3>>,
    lower: Vec<Option<DVec3>>,
}

impl PixelIntegral {
    /// Mean of `radiance` over the part of pixel (`column`, `row`) inside the field of view, by at least
    /// `cells x cells` cells; 0 outside of it.
    pub fn mean(
        &mut self,
        view: &FrameView,
        [column, row]: [usize; 2],
        cells: usize,
        details: &[Detail],
        radiance: impl Fn(DVec3) -> [f64; 3],
    ) -> [f64; 3] {
        let cells = cells_needed(view, [column, row], cells, details);
        let (left, top) = (column as f64, row as f64);
        let step = 1.0 / cells as f64;
        let corners = |line: &mut Vec<Option<DVec3>>, j: usize| {
            line.clear();
            line.extend((0..=cells).map(|i| view.direction(left + i as f64 * step, top + j as f64 * step)));
        };
        let (mut sum, mut weight) = ([0.0; 3], 0.0);
        corners(&mut self.lower, 0);
        for j in 0..cells {
            std::mem::swap(&mut self.upper, &mut self.lower);
            corners(&mut self.lower, j + 1);
            for i in 0..cells {
                let (Some(a), Some(b), Some(c), Some(d)) =
                    (self.upper[i], self.upper[i + 1], self.lower[i + 1], self.lower[i])
                else {
                    continue;
                };
                // Half the cross product of the diagonals: exact for a flat quadrilateral, and for a
                // spherical one up to a factor that neighbours share.
                let solid_angle = 0.5 * (c - a).cross(d - b).length();
                let Some(middle) = (a + b + c + d).try_normalize() else { continue };
                let value = radiance(middle);
                for channel in 0..3 {
                    sum[channel] += value[channel] * solid_angle;
                }
                weight += solid_angle;
            }
        }
        if weight > 0.0 { sum.map(|value| value / weight) } else { [0.0; 3] }
    }
}

/// Cells across a pixel: `least`, or as many as the finest detail that may lie in it requires.
fn cells_needed(view: &FrameView, [column, row]: [usize; 2], least: usize, details: &[Detail]) -> usize {
    let (x, y) = (column as f64, row as f64);
    let corners = [(x, y), (x + 1.0, y), (x + 1.0, y + 1.0), (x, y + 1.0)].map(|(x, y)| view.direction(x, y));
    let mut inside = corners.into_iter().flatten();
    let Some(first) = inside.next() else { return least };
    // The distance from one corner across the pixel: an upper bound of the distance to any point of it, up to
    // the curvature. A pixel cut by the rim may extend further than its remaining corners.
    let whole = corners.iter().all(Option::is_some);
    let Some(reach) = (if whole {
        inside.map(|corner| (corner - first).length()).reduce(f64::max)
    } else {
        view.direction(x + 0.5, y + 0.5).map(|middle| 4.0 * (middle - first).length())
    }) else {
        return least;
    };
    let mut cells = least;
    for detail in details {
        // A chord is shorter than its arc, so this never misses a detail.
        if (first - detail.direction).length() < detail.radius_rad + 1.1 * reach {
            let side = reach / std::f64::consts::SQRT_2;
            // A float beyond the range of integers saturates at the largest one.
            cells = cells.max((side / detail.cell_rad).ceil() as usize);
        }
    }
    cells.min(CELLS_MAX.max(least))
}

#[cfg(test)]
mod tests {
    use super::super::emitter::Emitter;
    use super::*;
    use lightcast_core::camera::{LOOKING_UP, Lens, LensParameters};
    use lightcast_core::image::LatLongCentres;
    use lightcast_core::math::zone_solid_angle;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn fisheye(side: usize, k: [f64; 4]) -> (FrameView, Lens) {
        let f = 0.5 * side as f64 / 95f64.to_radians();
        let lens = Lens::new(LensParameters {
            width: side,
            height: side,
            fx: f,
            fy: f,
            cx: 0.5 * side as f64,
            cy: 0.5 * side as f64,
            k,
            field_of_view_rad: 185f64.to_radians(),
        })
        .unwrap();
        (FrameView { projection: Projection::Fisheye(lens), world_from_camera: LOOKING_UP }, lens)
    }

    fn lat_long(width: usize, height: usize) -> FrameView {
        let projection = Projection::LatLong { width, height, centres: LatLongCentres::Half };
        FrameView { projection, world_from_camera: DMat3::IDENTITY }
    }

    /// Solid angle of a pixel by 200 x 200 cells of two spherical triangles each (van Oosterom and Strackee
    /// 1983).
    fn solid_angle(view: &FrameView, column: usize, row: usize) -> f64 {
        let n = 200;
        let at = |i: usize, j: usize| {
            view.direction(column as f64 + i as f64 / n as f64, row as f64 + j as f64 / n as f64)
        };
        let triangle = |a: DVec3, b: DVec3, c: DVec3| {
            2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
        };
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                if let (Some(a), Some(b), Some(c), Some(d)) =
                    (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1))
                {
                    sum += triangle(a, b, c) + triangle(a, c, d);
                }
            }
        }
        sum
    }

    /// Ratio of the power in a picture of one emitter on black to the closed form.
    fn power_ratio(view: &FrameView, sun: &Emitter) -> f64 {
        let details = [sun.detail()];
        let (width, height) = (view.projection.width(), view.projection.height());
        let mut integral = PixelIntegral::default();
        let mut power = 0.0;
        for row in 0..height {
            for column in 0..width {
                let mean = integral.mean(view, [column, row], 4, &details, |d| [sun.profile(d) * 1e6; 3]);
                if mean[0] > 0.0 {
                    power += mean[0] * solid_angle(view, column, row);
                }
            }
        }
        // The area of a disc at distance 1 and its solid angle differ by 3/2 of the squared radius: 3e-5 for
        // the sun.
        power / (1e6 * sun.area())
    }

    #[test]
    fn a_sun_smaller_than_a_pixel_keeps_its_power_at_every_sub_pixel_position_of_a_fisheye() {
        let (view, _) = fisheye(64, [0.02, -0.004, 0.0008, 0.0]);
        let mut worst: f64 = 0.0;
        for i in 0..40 {
            // A pixel is about 3 degrees wide: the steps are an odd fraction of that, from the zenith to the
            // horizon.
            let (azimuth, elevation) = (17.3 * f64::from(i), 90.0 - 2.19 * f64::from(i));
            let sun = Emitter::far_disc(azimuth, elevation, 0.2666, [1.0; 3]);
            worst = worst.max((power_ratio(&view, &sun) - 1.0).abs());
        }
        println!("worst relative error of the sun's power: {worst:.2e}");
        assert!(worst < 1e-3, "{worst}");
    }

    #[test]
    fn a_sun_on_pole_seam_and_corner_keeps_its_power_in_a_lat_long_picture() {
        let view = lat_long(72, 36);
        for (azimuth, elevation) in [(0.0, 90.0), (-90.0, 20.0), (45.0, 45.0), (47.5, 42.5), (33.0, 89.9)] {
            let sun = Emitter::far_disc(azimuth, elevation, 0.2666, [1.0; 3]);
            let ratio = power_ratio(&view, &sun);
            assert!((ratio - 1.0).abs() < 1e-3, "{azimuth} {elevation}: {ratio}");
        }
    }

    #[test]
    fn one_larger_than_many_pixels_keeps_its_power_too() {
        let (view, _) = fisheye(64, [0.0; 4]);
        let lamp = Emitter {
            centre: DVec3::new(0.8, 1.4, -0.3),
            half_u: DVec3::new(0.6, 0.0, 0.0),
            half_v: DVec3::new(0.0, 0.0, 0.1),
            shape: super::super::emitter::Shape::Rectangle,
            radiance: [1.0; 3],
        };
        // Solid angle of a rectangle parallel to the xz-plane at height h: a sum over its corners of atan(x z
        // / (h r)).
        let (mut expected, h) = (0.0, lamp.centre.y);
        for (x, sign_x) in [(1.4f64, 1.0), (0.2, -1.0)] {
            for (z, sign_z) in [(-0.2f64, 1.0), (-0.4, -1.0)] {
                expected += sign_x * sign_z * (x * z / (h * (x * x + z * z + h * h).sqrt())).atan();
            }
        }
        let power = power_ratio(&view, &lamp) * lamp.area();
        // The soft edge changes the solid angle only in second order.
        assert!((power / expected - 1.0).abs() < 1e-3, "{power} {expected}");
    }

    #[test]
    fn constant_scenes_stay_constant_and_nothing_shines_outside_the_field_of_view() {
        let (view, lens) = fisheye(31, [0.01, 0.0, 0.0, 0.0]);
        let mut integral = PixelIntegral::default();
        let mut dark = 0;
        for row in 0..31 {
            for column in 0..31 {
                let mean = integral.mean(&view, [column, row], 3, &[], |_| [2.0, 1.0, 0.5]);
                if mean == [0.0; 3] {
                    let middle = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                    assert!(lens.unproject(middle).is_none_or(|d| d.z < 0.0));
                    dark += 1;
                } else {
                    assert!((mean[0] - 2.0).abs() < 1e-12 && (mean[2] - 0.5).abs() < 1e-12);
                }
            }
        }
        assert!((100..400).contains(&dark), "{dark}");
    }

    #[test]
    fn solid_angles_weigh_the_cells() {
        // Radiance cos(theta) over one quarter-turn pixel from the pole to the equator: mean 1/2 by solid
        // angle.
        let view = lat_long(4, 2);
        let mean = PixelIntegral::default().mean(&view, [1, 0], 200, &[], |d| [d.y; 3]);
        assert!((mean[0] - 0.5).abs() < 1e-4, "{}", mean[0]);
        let expected = zone_solid_angle(0.0, FRAC_PI_2, 0.25);
        assert!((solid_angle(&view, 1, 0) / expected - 1.0).abs() < 1e-4);
        assert!((4.0 * expected - 2.0 * PI).abs() < 1e-12);
    }
}
