//! The two-dimensional distributions on real and degenerate maps: round trips, density, integral.

use super::{Bicontinuous, Standard, sample_points};
use crate::image::{PolarMap, PolarShape, luminance_f64};
use crate::test_data::{hard_maps, real_maps};
use std::f64::consts::TAU;

enum Either {
    Standard(Standard),
    Bicontinuous(Bicontinuous),
    Normalised(Bicontinuous),
}

impl Either {
    fn all(shape: PolarShape, values: &[f32]) -> [Self; 3] {
        let z = |row: f64| 2.0 * (0.5 * shape.theta_max_rad() * row / shape.rows() as f64).sin().powi(2);
        let edges: Vec<f64> = (0..=shape.rows()).map(|row| z(row as f64)).collect();
        let centres: Vec<f64> = (0..shape.rows()).map(|row| z(row as f64 + 0.5)).collect();
        let mut standard = Standard::new(shape.columns(), &edges);
        let mut bicontinuous = Bicontinuous::new(shape.columns(), &centres, z(shape.rows() as f64));
        let mut normalised = bicontinuous.clone().with_normalised_rows();
        standard.update(values);
        bicontinuous.update(values);
        normalised.update(values);
        [Self::Standard(standard), Self::Bicontinuous(bicontinuous), Self::Normalised(normalised)]
    }

    fn sample(&self, u: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Standard(d) => d.sample(u),
            Self::Bicontinuous(d) | Self::Normalised(d) => d.sample(u),
        }
    }

    fn pdf(&self, x: [f64; 2]) -> f64 {
        match self {
            Self::Standard(d) => d.pdf(x),
            Self::Bicontinuous(d) | Self::Normalised(d) => d.pdf(x),
        }
    }

    fn invert(&self, x: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Standard(d) => d.invert(x),
            Self::Bicontinuous(d) | Self::Normalised(d) => d.invert(x),
        }
    }

    fn integral(&self) -> f64 {
        match self {
            Self::Standard(d) => d.integral(),
            Self::Bicontinuous(d) | Self::Normalised(d) => d.integral(),
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Standard(_) => "standard",
            Self::Bicontinuous(_) => "bicontinuous",
            Self::Normalised(_) => "bicontinuous, rows normalised",
        }
    }
}

fn luminances(map: &PolarMap) -> Vec<f32> {
    map.pixels.iter().map(|&pixel| crate::image::luminance(pixel)).collect()
}

/// Edges of z between which densities are linear, or with normalised rows quadratic: the pole, row edges and
/// row centres, the rim.
fn knots(shape: PolarShape) -> Vec<f64> {
    (0..=2 * shape.rows())
        .map(|i| 2.0 * (0.25 * shape.theta_max_rad() * i as f64 / shape.rows() as f64).sin().powi(2))
        .collect()
}

fn check(name: &str, map: &PolarMap) {
    let shape = map.shape;
    let values = luminances(map);
    let knots = knots(shape);
    let z_max = knots[knots.len() - 1];
    for distribution in Either::all(shape, &values) {
        let case = format!("{name}, {}", distribution.name());

        // Gauss's rule with two points is exact for functions that are at most cubic in z between knots and
        // constant per column.
        let mut sum = 0.0;
        for knot in knots.windows(2) {
            let (middle, half) = (0.5 * (knot[0] + knot[1]), 0.5 * (knot[1] - knot[0]));
            for z in [middle - half / 3f64.sqrt(), middle + half / 3f64.sqrt()] {
                let row: f64 = (0..shape.columns())
                    .map(|c| distribution.pdf([z, TAU * (c as f64 + 0.5) / shape.columns() as f64]))
                    .sum();
                sum += row * half * TAU / shape.columns() as f64;
            }
        }
        assert!((sum - 1.0).abs() < 1e-6, "{case}: pdf integrates to {sum}");

        for u in sample_points(1000, 0) {
            let x = distribution.sample(u);
            let pdf = distribution.pdf(x);
            assert!((0.0..=z_max).contains(&x[0]) && (0.0..TAU).contains(&x[1]), "{case}: {u:?} to {x:?}");
            assert!(pdf > 0.0 && pdf.is_finite(), "{case}: a sample at {x:?} with density {pdf}");
            let back = distribution.invert(x);
            // One step of f64 in x moves u by the density times the step; 1e8 over a small pixel still leaves
            // 1e-9.
            assert!(
                (back[0] - u[0]).abs() < 1e-9 && (back[1] - u[1]).abs() < 1e-9,
                "{case}: {u:?} to {back:?}"
            );
        }

        // The round trip from positions: CDFs carry errors of a few 1e-16, which move a position by that over
        // the density.
        for [a, b] in sample_points(1000, 0) {
            let x = [a * z_max, b * TAU];
            let u = distribution.invert(x);
            assert!(u.iter().all(|u| (0.0..=1.0).contains(u)), "{case}: {x:?} to {u:?}");
            let pdf = distribution.pdf(x);
            if pdf > 1e-6 {
                let back = distribution.sample(u);
                let apart = (back[0] - x[0]).hypot(back[1] - x[1]);
                assert!(apart < 1e-9 + 1e-13 / pdf, "{case}: {x:?} to {back:?}, density {pdf}");
            }
        }

        // Degenerate arguments.
        for u in [[0.0, 0.0], [1.0, 1.0], [0.5, 0.5], [0.0, 1.0], [f64::NAN, f64::NAN], [-1.0, 2.0]] {
            let x = distribution.sample(u);
            assert!((0.0..=z_max).contains(&x[0]) && (0.0..TAU).contains(&x[1]), "{case}: {u:?} to {x:?}");
            assert!(distribution.invert(u).iter().all(|v| (0.0..=1.0).contains(v)), "{case}");
        }
        assert_eq!(distribution.pdf([-0.1, 0.0]), 0.0, "{case}");
        assert_eq!(distribution.pdf([0.0, TAU]), 0.0, "{case}");
    }
}

#[test]
fn round_trips_on_hard_maps() {
    for (name, map) in hard_maps() {
        check(name, &map);
    }
}

#[test]
fn round_trips_on_real_maps() {
    for (name, map) in real_maps(PolarShape::hemisphere(360, 90)) {
        check(&name, &map);
    }
    for (name, map) in real_maps(PolarShape::sphere(120, 60)) {
        check(&format!("{name} (sphere)"), &map);
    }
}

#[test]
fn samples_have_the_density_that_pdf_says() {
    let shape = PolarShape::hemisphere(24, 8);
    let map = PolarMap::from_fn(shape, |row, column| {
        [(1 + row) as f32 * if column > 15 { 5.0 } else { 1.0 } + if column == 3 { 20.0 } else { 0.0 }; 3]
    });
    let knots = knots(shape);
    // 2^10 3^6 Halton points put the right number into every elementary box, so cells come out within a few
    // per cent.
    let count = 746_496;
    for distribution in Either::all(shape, &luminances(&map)) {
        let mut hits = vec![0usize; 16 * 24];
        for u in sample_points(count, 0) {
            let [z, phi] = distribution.sample(u);
            let band = knots.partition_point(|&k| k <= z).clamp(1, 16) - 1;
            hits[band * 24 + (phi / TAU * 24.0) as usize] += 1;
        }
        for band in 0..16 {
            for column in 0..24 {
                let x = [0.5 * (knots[band] + knots[band + 1]), TAU * (column as f64 + 0.5) / 24.0];
                let expected = distribution.pdf(x) * (knots[band + 1] - knots[band]) * TAU / 24.0;
                let found = hits[band * 24 + column] as f64 / count as f64;
                assert!(
                    (found - expected).abs() < 0.02 * expected + 3e-5,
                    "{} {band} {column}: {found} {expected}",
                    distribution.name()
                );
            }
        }
    }
}

#[test]
fn normalised_rows_move_a_sun_of_one_row_and_unnormalised_ones_do_not() {
    // A sun of one pixel over a dim map: between its row and the next the unnormalised ring keeps to the
    // sun's azimuth, the normalised one at half way gives half of its samples to the rest of the ring.
    let shape = PolarShape::hemisphere(64, 32);
    let mut values = vec![1.0; shape.len()];
    values[20 * 64 + 40] = 1e6;
    let [_, plain, normalised] = Either::all(shape, &values);
    let z = |row: f64| 2.0 * (0.25 * std::f64::consts::PI * row / 32.0).sin().powi(2);
    let half_way = 0.5 * (z(20.5) + z(21.5));
    let in_sun = |distribution: &Either| {
        let at = |phi: f64| distribution.pdf([half_way, phi]);
        let ring: f64 = (0..64).map(|c| at(TAU * (f64::from(c) + 0.5) / 64.0)).sum();
        at(TAU * 40.5 / 64.0) / ring
    };
    assert!(in_sun(&plain) > 0.999, "{}", in_sun(&plain));
    assert!((in_sun(&normalised) - 0.5 * (1.0 + 1.0 / 64.0)).abs() < 1e-3, "{}", in_sun(&normalised));
}

#[test]
fn standard_integral_is_the_power_of_the_map() {
    for (name, map) in real_maps(PolarShape::hemisphere(360, 90)) {
        let values = luminances(&map);
        let power = luminance_f64(map.power());
        let [standard, bicontinuous, _] = Either::all(map.shape, &values);
        assert!((standard.integral() / power - 1.0).abs() < 1e-6, "{name}");
        // Interpolation between row centres moves a sun's power a little; the trapezoid's weight of a row is
        // the mean of its neighbours' heights.
        assert!(
            (bicontinuous.integral() / power - 1.0).abs() < 0.01,
            "{name}: {}",
            bicontinuous.integral() / power
        );
    }
}

#[test]
fn integrals_of_8192_x_2048_values_lose_no_small_ones_beside_1e8() {
    let shape = PolarShape::hemisphere(8192, 2048);
    let (row, column) = (1100, 4);
    let mut values = vec![1.0f32; shape.len()];
    values[row * 8192 + column] = 1e8;
    let expected = TAU + (1e8 - 1.0) * shape.pixel_solid_angle(row);
    for distribution in Either::all(shape, &values) {
        let (name, integral) = (distribution.name(), distribution.integral());
        // Interpolation between row centres moves a sun's power by the heights of the neighbours, here by
        // 1e-7.
        assert!((integral / expected - 1.0).abs() < 1e-6, "{name}: {integral} {expected}");
        // The sun's part of the samples is the sun's part of the power.
        let count = 7776;
        let hits = sample_points(count, 0)
            .into_iter()
            .map(|u| distribution.sample(u))
            .filter(|&x| distribution.pdf(x) > 1.0);
        let part = hits.count() as f64 / count as f64;
        let sun = 1.0 - TAU / expected;
        assert!((part - sun).abs() < 0.01, "{name}: {part} {sun}");
    }
}

#[test]
fn zero_rows_are_uniform_in_azimuth_and_zero_maps_uniform() {
    let shape = PolarShape::hemisphere(8, 4);
    for distribution in Either::all(shape, &[0.0; 32]) {
        let uniform = 1.0 / TAU;
        assert!((distribution.pdf([0.3, 1.0]) - uniform).abs() < 1e-15);
        assert_eq!(distribution.integral(), 0.0);
    }
    let mut values = [0.0; 32];
    values[8..16].fill(1.0);
    let [standard, bicontinuous, _] = Either::all(shape, &values);
    for phi in [1.0, 2.0] {
        assert_eq!(standard.pdf([0.9, phi]), 0.0);
        assert!((standard.invert([0.9, phi])[0] - phi / TAU).abs() < 1e-15);
        let u = bicontinuous.invert([0.999, phi]);
        assert!(u.iter().all(|v| v.is_finite()));
    }
}

#[test]
fn values_that_are_no_radiances_count_as_documented() {
    let shape = PolarShape::hemisphere(3, 1);
    for (bad, good) in
        [([f32::NAN, 1.0, -5.0], [0.0, 1.0, 0.0]), ([f32::INFINITY, 0.0, 0.0], [f32::MAX, 0.0, 0.0])]
    {
        for (a, b) in Either::all(shape, &bad).iter().zip(&Either::all(shape, &good)) {
            assert_eq!(a.sample([0.3, 0.6]), b.sample([0.3, 0.6]));
        }
    }
}
