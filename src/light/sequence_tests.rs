//! Persistent lights over long sequences: what does not wear out, and what recovers.

use super::test_maps::real_map;
use super::{Extractor, Light, LightList, Options, Sampler};
use crate::image::{PolarMap, PolarShape, luminance};
use crate::math::{angle_between, fibonacci_sphere};
use glam::DVec3;

const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);

/// The map turned by whole columns: what stood in column c stands in column c - `columns`.
fn turned(map: &PolarMap, columns: usize, turned: &mut PolarMap) {
    for (to, from) in turned.pixels.chunks_exact_mut(360).zip(map.pixels.chunks_exact(360)) {
        to[..360 - columns].copy_from_slice(&from[columns..]);
        to[360 - columns..].copy_from_slice(&from[..columns]);
    }
}

fn direction(light: &Light) -> DVec3 {
    DVec3::from(light.direction.map(f64::from))
}

/// The irradiance measure of METHODS section 9 in f64, for turned maps: the lights are turned back instead.
struct Measure {
    normals: Vec<DVec3>,
    reference: Vec<f64>,
}

impl Measure {
    fn new(map: &PolarMap) -> Self {
        let normals: Vec<DVec3> = fibonacci_sphere(300).collect();
        let mut reference = vec![0.0; 300];
        for row in 0..map.shape.rows {
            for column in 0..map.shape.columns {
                let flux = f64::from(luminance(map.pixels[row * map.shape.columns + column]))
                    * map.shape.pixel_solid_angle(row);
                let d = map.shape.pixel_direction(row, column);
                for (sum, n) in reference.iter_mut().zip(&normals) {
                    *sum += flux * n.dot(d).max(0.0);
                }
            }
        }
        Self { normals, reference }
    }

    fn error(&self, lights: &[Light], turn_rad: f64) -> f64 {
        let (sin, cos) = turn_rad.sin_cos();
        let mut values = vec![0.0; self.normals.len()];
        for light in lights {
            let d = direction(light);
            let back = DVec3::new(cos * d.x - sin * d.z, d.y, sin * d.x + cos * d.z);
            let power = f64::from(light.luminance());
            for (value, n) in values.iter_mut().zip(&self.normals) {
                *value += power * n.dot(back).max(0.0);
            }
        }
        let squares: f64 = values.iter().zip(&self.reference).map(|(v, r)| (v - r).powi(2)).sum();
        (squares / 300.0).sqrt() / (self.reference.iter().sum::<f64>() / 300.0)
    }
}

/// Worst and 99th percentile.
fn worst_and_p99(values: &mut [f64]) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    [values[values.len() - 1], values[(values.len() - 1) * 99 / 100]]
}

/// A hundred turns of the garden, `step` columns a frame: no turn is worse than the first.
fn hundred_turns(name: &str, step: usize) {
    let Some(map) = real_map(name, "chinese_garden_1k.hdr", SHAPE) else { return };
    let measure = Measure::new(&map);
    let mut extractor = Extractor::new(SHAPE, &Options { count: 128, ..Options::default() }).unwrap();
    let (mut list, mut frame, mut last) = (LightList::default(), map.clone(), Vec::new());
    let (mut first, mut highest) = ([0.0; 4], [0.0; 4]);
    for turn in 0..100 {
        let (mut errors, mut motions) = (Vec::new(), Vec::new());
        for column in (0..360).step_by(step) {
            turned(&map, column, &mut frame);
            extractor.extract(&frame, &mut list);
            errors.push(measure.error(&list.lights, (column as f64).to_radians()));
            let pairs = list.lights.iter().zip(&last);
            motions.extend(pairs.map(|(a, b)| angle_between(direction(a), direction(b)).to_degrees()));
            last.clone_from(&list.lights);
        }
        let ([error, error_p99], [motion, motion_p99]) =
            (worst_and_p99(&mut errors), worst_and_p99(&mut motions));
        let figures = [error, error_p99, motion, motion_p99];
        if turn == 0 {
            first = figures;
        } else {
            highest = [0, 1, 2, 3].map(|i| figures[i].max(highest[i]));
        }
    }
    println!("{step} columns a frame: error worst, p99; motion worst, p99 in degrees");
    println!("  turn 1      {first:.5?}\n  turns 2-100 {highest:.5?} (the highest of any turn)");
    for i in [0, 1, 3] {
        assert!(highest[i] <= first[i], "{first:?} {highest:?}");
    }
    // The farthest step of 99 turns is an extreme of 99 times as many as that of one turn.
    assert!(highest[2] <= 1.1 * first[2], "{first:?} {highest:?}");
}

#[test]
fn a_hundred_turns_of_a_sunny_panorama_wear_nothing_out() {
    hundred_turns("a_hundred_turns_of_a_sunny_panorama_wear_nothing_out", 1);
}

#[test]
fn a_hundred_fast_turns_of_a_sunny_panorama_wear_nothing_out() {
    hundred_turns("a_hundred_fast_turns_of_a_sunny_panorama_wear_nothing_out", 4);
}

fn errors_after_a_cut(from: &PolarMap, to: &PolarMap, frames: usize) -> Vec<f64> {
    let measure = Measure::new(to);
    let mut extractor = Extractor::new(to.shape, &Options { count: 128, ..Options::default() }).unwrap();
    let mut list = LightList::default();
    for _ in 0..10 {
        extractor.extract(from, &mut list);
    }
    (0..frames)
        .map(|_| {
            extractor.extract(to, &mut list);
            measure.error(&list.lights, 0.0)
        })
        .collect()
}

#[test]
fn cuts_recover() {
    let maps = super::test_maps::real_maps("cuts_recover", SHAPE);
    let point =
        PolarMap::from_fn(SHAPE, |row, column| if (row, column) == (40, 200) { [1e8; 3] } else { [1e-3; 3] });
    let black_but_one = PolarMap::from_fn(SHAPE, |row, column| [f32::from((row, column) == (40, 200)); 3]);
    let black = PolarMap::black(SHAPE);
    let (mut ratios, mut settled) = (vec![Vec::new(); 40], 0);
    for (to_name, to) in &maps {
        let mut fresh = LightList::default();
        let options = Options { count: 128, sampler: Sampler::Refined, ..Options::default() };
        Extractor::new(SHAPE, &options).unwrap().extract(to, &mut fresh);
        let fresh_error = Measure::new(to).error(&fresh.lights, 0.0);
        let mut cuts: Vec<(&str, &PolarMap)> = maps.iter().map(|(name, map)| (name.as_str(), map)).collect();
        cuts.extend([("point", &point), ("black but one", &black_but_one), ("black", &black)]);
        for (from_name, from) in cuts {
            let errors = errors_after_a_cut(from, to, 40);
            let r = |i: usize| errors[i] / fresh_error;
            println!(
                "{from_name:30} to {to_name:30} {fresh_error:.5}: x {:.2} {:.2} {:.2} {:.2} {:.2} {:.2}",
                r(0),
                r(1),
                r(4),
                r(9),
                r(24),
                r(39)
            );
            for (i, e) in errors.iter().enumerate() {
                ratios[i].push(e / fresh_error);
            }
            settled += 1;
        }
    }
    for i in [0, 1, 2, 4, 9, 24, 39] {
        if settled > 0 {
            ratios[i].sort_by(f64::total_cmp);
            println!(
                "frame {i}: median {:.2} p90 {:.2} max {:.2}",
                ratios[i][settled / 2],
                ratios[i][settled * 9 / 10],
                ratios[i][settled - 1]
            );
        }
    }
}
