//! Shadows of lights that have a spread, as the renderer draws them: a light is an even disc of radius
//! `sqrt(2) spread_rad`, whose RMS angle about its middle is the spread.

use super::{SPHERE_RADIUS, ground_points};
use crate::light::Light;
use glam::DVec3;
use std::f64::consts::{PI, SQRT_2};

/// A disc narrower than this is a direction.
const LEAST_RADIUS_RAD: f64 = 1e-9;

/// As [`super::Emitters::ground_cells`], with each light weighted by the part of its disc that the sphere
/// does not hide; the cosine is that of its direction. Discs and the sphere's outline are treated as circles
/// in a plane of angles.
pub fn soft_ground_cells(lights: &[Light], cells: usize, points: usize) -> Vec<f64> {
    let discs: Vec<(DVec3, f64, f64)> = lights
        .iter()
        .filter(|light| light.luminance() > 0.0 && light.direction[1] > 0.0)
        .map(|light| {
            let towards = DVec3::from(light.direction.map(f64::from));
            (towards, f64::from(light.luminance()) * towards.y, SQRT_2 * f64::from(light.spread_rad))
        })
        .collect();
    ground_points(cells, points, |x, z| {
        let to_centre = DVec3::new(-x, SPHERE_RADIUS, -z);
        let distance = to_centre.length();
        // Seen from the ground, the sphere's angular radius is at most a right angle: at the point where it
        // rests.
        let outline_rad = (SPHERE_RADIUS / distance).min(1.0).asin();
        let middle = to_centre / distance;
        let of_disc = |&(towards, irradiance, radius_rad): &(DVec3, f64, f64)| {
            let apart_rad = middle.dot(towards).clamp(-1.0, 1.0).acos();
            irradiance * (1.0 - hidden_part(apart_rad, outline_rad, radius_rad))
        };
        discs.iter().map(of_disc).sum()
    })
}

/// Part of a disc that a circle of radius `outline_rad`, `apart_rad` from its middle, covers.
fn hidden_part(apart_rad: f64, outline_rad: f64, radius_rad: f64) -> f64 {
    if radius_rad < LEAST_RADIUS_RAD {
        return if apart_rad < outline_rad { 1.0 } else { 0.0 };
    }
    if apart_rad >= outline_rad + radius_rad {
        return 0.0;
    }
    let smaller = outline_rad.min(radius_rad);
    if apart_rad <= (outline_rad - radius_rad).abs() {
        return (smaller / radius_rad).powi(2);
    }
    // Two segments, cut off by the chord through both points where the circles meet.
    let chord = (apart_rad.powi(2) + radius_rad.powi(2) - outline_rad.powi(2)) / (2.0 * apart_rad);
    let segment = |radius: f64, chord: f64| {
        let cosine = (chord / radius).clamp(-1.0, 1.0);
        radius * radius * (cosine.acos() - cosine * (1.0 - cosine * cosine).sqrt())
    };
    (segment(radius_rad, chord) + segment(outline_rad, apart_rad - chord)) / (PI * radius_rad * radius_rad)
}

#[cfg(test)]
mod tests {
    use super::super::{Emitters, relative_rms};
    use super::*;

    #[test]
    fn hidden_parts_are_those_of_counted_points() {
        for (apart, outline, radius) in [
            (0.3, 0.5, 0.1),
            (0.45, 0.5, 0.1),
            (0.5, 0.5, 0.1),
            (0.55, 0.5, 0.1),
            (0.61, 0.5, 0.1),
            (0.2, 0.1, 0.5),
            (0.45, 0.1, 0.5),
            (0.0, 0.1, 0.2),
            (0.3, 0.25, 0.25),
        ] {
            let (side, mut inside, mut hidden) = (2000, 0u64, 0u64);
            for i in 0..side {
                for j in 0..side {
                    let at = |i: usize| radius * ((2 * i + 1) as f64 / f64::from(side as u32) - 1.0);
                    let (x, y) = (at(i), at(j));
                    if x * x + y * y < radius * radius {
                        inside += 1;
                        hidden += u64::from((x - apart).powi(2) + y * y < outline * outline);
                    }
                }
            }
            let (counted, part) = (hidden as f64 / inside as f64, hidden_part(apart, outline, radius));
            assert!((part - counted).abs() < 2e-3, "{apart} {outline} {radius}: {part} {counted}");
        }
    }

    #[test]
    fn a_light_without_spread_throws_the_hard_shadow_and_a_narrow_one_nearly_the_same() {
        let light = |spread_rad| Light {
            id: 0,
            direction: crate::math::direction(0.7, 1.0).as_vec3().to_array(),
            irradiance: [3.0; 3],
            spread_rad,
        };
        let hard = Emitters::from_lights(&[light(0.0)]).ground_cells(10, 6);
        let difference = |spread_rad| relative_rms(&soft_ground_cells(&[light(spread_rad)], 10, 6), &hard);
        // A point on the very outline may fall to either side.
        assert!(difference(0.0) < 1e-12);
        assert!(difference(1e-3) < 0.01 && difference(0.1) > 0.02);
    }

    #[test]
    fn many_narrow_lights_of_a_disc_throw_the_shadow_of_the_disc() {
        let (spread_rad, towards) = (0.05, crate::math::direction(0.6, 2.0));
        let (east, north) = towards.any_orthonormal_pair();
        let count = 4000;
        let parts: Vec<Light> = (0..count)
            .map(|i| {
                let radius = SQRT_2 * spread_rad * ((f64::from(i) + 0.5) / f64::from(count)).sqrt();
                let (sin, cos) = (2.399_963 * f64::from(i)).sin_cos();
                let direction = (towards + (east * cos + north * sin) * radius.tan()).normalize_or(towards);
                let direction = direction.as_vec3().to_array();
                Light { id: i as u32, direction, irradiance: [1.0 / count as f32; 3], spread_rad: 0.0 }
            })
            .collect();
        let disc =
            Light { id: 0, direction: towards.as_vec3().to_array(), irradiance: [1.0; 3], spread_rad: 0.05 };
        let reference = Emitters::from_lights(&parts).ground_cells(10, 6);
        let soft = relative_rms(&soft_ground_cells(&[disc], 10, 6), &reference);
        let hard = relative_rms(&Emitters::from_lights(&[disc]).ground_cells(10, 6), &reference);
        assert!(soft < 2e-3 && hard > 5.0 * soft, "{soft} {hard}");
    }
}
