//! Direction and spread of the output, with frames weighted by power and equally.

use super::*;
use crate::image::Stamp;
use crate::light::Light;
use crate::math::{angle_between, direction};
use crate::temporal::test_taps::taps;

fn filter(directions: Directions, frames: impl Iterator<Item = Light>) -> Vec<Light> {
    let mut filter = LightFilter::new(taps(25.0), directions);
    let (mut list, mut filtered) = (ReferencedList::default(), ReferencedList::default());
    frames
        .enumerate()
        .map(|(t, light)| {
            list.list.stamp = Stamp {
                sequence: t as u64,
                capture_time_ns: 40_000_000 * t as i64,
                lost_before: 0,
                frame_rate_hz: 25.0,
            };
            list.list.lights = vec![light];
            filter.step(&list, &mut filtered);
            filtered.list.lights[0]
        })
        .collect()
}

fn light(towards: DVec3, irradiance: f32, spread_rad: f32) -> Light {
    Light { id: 0, direction: towards.as_vec3().to_array(), irradiance: [irradiance; 3], spread_rad }
}

fn towards(light: &Light) -> DVec3 {
    DVec3::from(light.direction.map(f64::from))
}

#[test]
fn where_a_light_had_no_power_its_direction_does_not_count() {
    let (idle, lit) = (direction(1.2, 0.0), direction(0.3, 2.0));
    let frames = || (0..40).map(|t| if t < 15 { light(idle, 0.0, 0.0) } else { light(lit, 5.0, 0.02) });
    let off = |lights: &[Light]| {
        let shining = lights.iter().filter(|light| light.irradiance[0] > 0.0);
        shining.map(|light| angle_between(towards(light), lit)).fold(0.0, f64::max)
    };
    assert!(off(&filter(Directions::ByPower, frames())) < 1e-6);
    // With the paper's filter it comes from in between.
    assert!(off(&filter(Directions::Alike, frames())) > 0.5);
}

#[test]
fn a_light_that_flickers_and_swings_stands_where_its_power_is() {
    // Bright on one side, dim on the other, at 12.5 Hz: of ten units of light nine come from the first.
    let (bright, dim) = (direction(0.5, 1.0), direction(0.5, 1.4));
    let frames = (0..60).map(|t| if t % 2 == 0 { light(bright, 9.0, 0.0) } else { light(dim, 1.0, 0.0) });
    let expected = (9.0 * bright + dim).normalize_or(DVec3::Y);
    let found = filter(Directions::ByPower, frames);
    // The stop band lets some per cent of the flicker pass.
    for light in &found[20..] {
        let off = angle_between(towards(light), expected);
        assert!(off < 0.1 * angle_between(bright, dim), "{off}");
    }
}

#[test]
fn light_that_stands_still_keeps_its_spread_exactly() {
    for spread_rad in [0.0, 1e-3, 0.0033, 0.3, 1.5] {
        let frames = (0..20).map(|_| light(direction(0.9, 4.0), 3.0, spread_rad));
        for light in filter(Directions::ByPower, frames) {
            assert!((light.spread_rad - spread_rad).abs() < 1e-5 * spread_rad.max(1e-4), "{light:?}");
        }
    }
}

/// Value at x of the shadow's edge of an even disc of radius 1, from 0 to 1: the share of the disc left of x.
fn edge(x: f64) -> f64 {
    let x = x.clamp(-1.0, 1.0);
    0.5 + (x * (1.0 - x * x).sqrt() + x.asin()) / PI
}

#[test]
fn a_third_of_the_motion_as_spread_fits_the_edge_of_the_filtered_shadow() {
    let taps = taps(25.0);
    let centre = taps.order() as f64 / 2.0;
    let offsets = || taps.as_slice().iter().enumerate().map(|(k, tap)| (*tap, k as f64 - centre));
    let variance: f64 = offsets().map(|(tap, offset)| tap * offset * offset).sum();
    // A disc of some spread, in steps of the light per frame, whose shadow moves over the window: squared
    // error of the edge that a disc with a share of the motion throws.
    let error = |own: f64, share: f64| -> f64 {
        let radius = |variance: f64| (2.0 * variance).sqrt();
        let (own_radius, radius) = (radius(own * own), radius(own * own + share * variance));
        let profile = |x: f64, radius: f64| edge(x / radius);
        let steps = (-800..800).map(|i| 0.01 * f64::from(i));
        let squares = steps.map(|x| {
            let truth: f64 = offsets().map(|(tap, offset)| tap * profile(x - offset, own_radius)).sum();
            (truth - profile(x, radius)).powi(2)
        });
        squares.sum()
    };
    for own in [0.2, 0.4, 0.8, 1.2] {
        let best = (1..=100)
            .map(|i| 0.01 * f64::from(i))
            .min_by(|a, b| error(own, *a).total_cmp(&error(own, *b)))
            .unwrap();
        println!(
            "spread {own} steps: best share {best:.2}, errors {:.3} at a third, {:.3} at it, {:.3} for all",
            error(own, MOTION_SHARE),
            error(own, best),
            error(own, 1.0)
        );
        assert!((0.2..0.5).contains(&best), "{own}: {best}");
        assert!(error(own, MOTION_SHARE) < 1.1 * error(own, best), "{own}");
        assert!(error(own, MOTION_SHARE) < error(own, 1.0) && error(own, MOTION_SHARE) < error(own, 0.01));
    }
}
