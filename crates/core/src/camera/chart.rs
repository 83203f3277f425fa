//! Curves on the sphere as polylines in the equal-area cylinder (phi, z = cos theta), where the pixels of a
//! polar map are rectangles and areas are solid angles.

use glam::DVec3;
use std::f64::consts::TAU;

/// A point (phi in radians, z). Phi is unwrapped along a polyline: it may leave [0, 2 pi).
pub(super) type ChartPoint = [f64; 2];

/// A direction in the chart.
#[derive(Clone, Copy, Debug)]
pub(super) struct SkyPoint {
    phi_rad: f64,
    z: f64,
    /// So close to a pole that phi is noise.
    at_pole: bool,
}

impl SkyPoint {
    /// From a unit vector in the world frame.
    pub(super) fn new(world: DVec3) -> Self {
        // At 1e-9 from the pole a unit vector's rounding turns phi by 1e-7, and everything nearer covers
        // 3e-18 sr: neither is visible in a map.
        let across_squared = world.x * world.x + world.z * world.z;
        Self { phi_rad: world.z.atan2(world.x), z: world.y, at_pole: across_squared < 1e-18 }
    }
}

/// The turn from one azimuth to another by the shorter way, in [-pi, pi].
pub(super) fn turn_rad(from_rad: f64, to_rad: f64) -> f64 {
    let difference = to_rad - from_rad;
    // Nearly every call is of this kind: neighbouring points away from the seam. Rounding to the nearest turn
    // costs more.
    if difference.abs() <= TAU / 2.0 { difference } else { difference - TAU * (difference / TAU).round() }
}

/// Appends a point, unwrapping its phi against the last one.
pub(super) fn push_point(points: &mut Vec<ChartPoint>, phi_rad: f64, z: f64) {
    let phi_rad = points.last().map_or(phi_rad, |last| last[0] + turn_rad(last[0], phi_rad));
    if points.last() != Some(&[phi_rad, z]) {
        points.push([phi_rad, z]);
    }
}

/// Most halvings. An edge that passes exactly through a pole halves its error four times per level; twelve
/// levels leave 1e-7 of the pixel.
const DEPTH_MAX: u32 = 12;

/// Appends the curve from parameter 0 to 1 as a polyline, so that the area between the two is at most about
/// `tolerance_sr`. `start` and `end` are `curve(0)` and `curve(1)`.
///
/// The area between a smooth curve and its chord is 4/3 of the triangle with the curve's middle (the parabola
/// through the three points), and a quarter of it remains with two chords. Near a pole the chart bends even
/// straight lines, with a curvature of cot theta; the test measures it like any other. At a pole itself phi
/// has no value: the curve arrives there with the phi that it has just before.
pub(super) fn append_curve(
    points: &mut Vec<ChartPoint>,
    start: SkyPoint,
    end: SkyPoint,
    tolerance_sr: f64,
    curve: &mut impl FnMut(f64) -> SkyPoint,
) {
    // Below this a curve has no area that a map could show (and tolerances of zero-length edges are 0).
    let tolerance_sr = tolerance_sr.max(1e-20);
    refine(points, (0.0, start), (1.0, end), tolerance_sr, DEPTH_MAX, curve);
}

fn refine(
    points: &mut Vec<ChartPoint>,
    start: (f64, SkyPoint),
    end: (f64, SkyPoint),
    tolerance_sr: f64,
    depth: u32,
    curve: &mut impl FnMut(f64) -> SkyPoint,
) {
    let middle_at = 0.5 * (start.0 + end.0);
    let middle = curve(middle_at);
    let (mut a, mut b) = (start.1, end.1);
    if middle.at_pole && a.at_pole && b.at_pole {
        return;
    }
    let deviation_sr = if middle.at_pole {
        f64::INFINITY
    } else {
        if a.at_pole {
            a.phi_rad = middle.phi_rad;
        }
        if b.at_pole {
            b.phi_rad = middle.phi_rad;
        }
        let to_middle = turn_rad(a.phi_rad, middle.phi_rad);
        let to_end = to_middle + turn_rad(middle.phi_rad, b.phi_rad);
        2.0 / 3.0 * (to_middle * (b.z - a.z) - to_end * (middle.z - a.z)).abs()
    };
    if deviation_sr <= 4.0 * tolerance_sr || depth == 0 {
        push_point(points, a.phi_rad, a.z);
        if deviation_sr > tolerance_sr && !middle.at_pole {
            push_point(points, middle.phi_rad, middle.z);
        }
        push_point(points, b.phi_rad, b.z);
    } else {
        let middle = (middle_at, middle);
        refine(points, start, middle, 0.5 * tolerance_sr, depth - 1, curve);
        refine(points, middle, end, 0.5 * tolerance_sr, depth - 1, curve);
    }
}

/// Closes a loop of unwrapped points that runs round its region in the direction in which the area is
/// positive (`integral z dphi` > 0). A loop that winds once round the axis contains a pole and is closed
/// along z = 1 (phi decreasing) or z = -1.
pub(super) fn close_loop(points: &mut Vec<ChartPoint>) {
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else { return };
    let end = last[0] + turn_rad(last[0], first[0]);
    let turns = ((end - first[0]) / TAU).round();
    if turns == 0.0 {
        points.push(first);
        return;
    }
    let pole = -turns.signum();
    points.extend([[end, first[1]], [end, pole], [first[0], pole], first]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::direction;

    fn area(points: &[ChartPoint]) -> f64 {
        points.windows(2).map(|p| 0.5 * (p[0][1] + p[1][1]) * (p[1][0] - p[0][0])).sum()
    }

    #[test]
    fn a_loop_round_a_pole_closes_to_its_cap() {
        for (pole, sense) in [(1.0, -1.0), (-1.0, 1.0)] {
            let mut points = Vec::new();
            for step in 0..=8 {
                let phi = sense * TAU * f64::from(step) / 8.0 + 3.0;
                push_point(&mut points, phi.rem_euclid(TAU), 0.75 * pole);
            }
            close_loop(&mut points);
            assert!((area(&points) - 0.25 * TAU).abs() < 1e-12, "{pole}: {}", area(&points));
        }
    }

    #[test]
    fn a_great_circle_beside_the_pole_keeps_its_area() {
        // Part of a great circle that passes the pole at 0.1 degrees, compared with ten thousand chords.
        let tilt = 0.1f64.to_radians();
        let mut curve = |t: f64| {
            let angle = (t - 0.5) * 3.0;
            SkyPoint::new(DVec3::new(angle.sin(), angle.cos() * tilt.cos(), angle.cos() * tilt.sin()))
        };
        let mut exact = Vec::new();
        for step in 0..=200_000 {
            let p = curve(f64::from(step) / 200_000.0);
            push_point(&mut exact, p.phi_rad, p.z);
        }
        let (start, end) = (curve(0.0), curve(1.0));
        let mut points = Vec::new();
        append_curve(&mut points, start, end, 1e-4, &mut curve);
        assert!((area(&points) - area(&exact)).abs() < 1e-4, "{} {}", area(&points), area(&exact));
        assert!(points.len() < 200, "{}", points.len());
    }

    #[test]
    fn a_curve_into_a_pole_arrives_along_its_meridian() {
        let mut curve = |t: f64| SkyPoint::new(direction(0.3 * (1.0 - t), 2.0));
        let (start, end) = (curve(0.0), curve(1.0));
        let mut points = Vec::new();
        append_curve(&mut points, start, end, 1e-9, &mut curve);
        assert!(points.iter().all(|p| (p[0] - 2.0).abs() < 1e-9), "{points:?}");
        assert_eq!(points.last().unwrap()[1], 1.0);
    }
}
