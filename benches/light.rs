//! Times of sampling and lights, beside the published ones where there are some (METHODS section 11).
//!
//! `cargo bench --bench light`. The map is a smooth sky with a sun and lamps; what the bytes are does not change
//! the work of the tables, and of the assignment only through where the sites crowd.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{Criterion, criterion_group, criterion_main};
use lightcast::image::{PolarMap, PolarShape, luminance};
use lightcast::light::{Extractor, Inversion, LightList, NearestSites, Options, Sampler, prefix};
use lightcast::sampling::{Bicontinuous, Standard, sample_points};
use std::hint::black_box;

/// A sky gradient, a sun two pixels wide at 50 degrees and some lamps.
fn map(shape: PolarShape) -> PolarMap {
    PolarMap::from_fn(shape, |row, column| {
        let (y, x) = (row as f64 / shape.rows as f64, column as f64 / shape.columns as f64);
        let near = |v: f64, u: f64, size: f64| (y - v).abs() < size && (x - u).abs() < 0.25 * size;
        if near(0.44, 0.3, 0.012) {
            [6e4, 5e4, 4e4]
        } else if near(0.7, 0.8, 0.03) || near(0.5, 0.05, 0.02) || near(0.2, 0.6, 0.02) {
            [90.0, 60.0, 30.0]
        } else {
            let sky = 0.3 + 0.5 * y as f32 + 0.2 * ((x * 25.0).sin() * (y * 9.0).cos()) as f32;
            [0.6 * sky, 0.8 * sky, sky]
        }
    })
}

fn lights(c: &mut Criterion) {
    c.bench_function("start-up: 300 relaxed points", |b| b.iter(|| sample_points(black_box(300), 4)));
    c.bench_function("start-up: 1024 relaxed points", |b| b.iter(|| sample_points(black_box(1024), 4)));
    for shape in [PolarShape::hemisphere(360, 90), PolarShape::hemisphere(1440, 360)] {
        let mut group = c.benchmark_group(format!("{} x {}", shape.columns, shape.rows));
        let map = map(shape);
        let values: Vec<f32> = map.pixels.iter().map(|&pixel| luminance(pixel)).collect();
        let z = |row: f64| 2.0 * (0.5 * shape.theta_max_rad * row / shape.rows as f64).sin().powi(2);
        let edges: Vec<f64> = (0..=shape.rows).map(|row| z(row as f64)).collect();
        let centres: Vec<f64> = (0..shape.rows).map(|row| z(row as f64 + 0.5)).collect();
        let mut standard = Standard::new(shape.columns, &edges);
        let mut bicontinuous = Bicontinuous::new(shape.columns, &centres, 1.0);
        group.bench_function("CDFs, standard", |b| b.iter(|| standard.update(black_box(&values))));
        group.bench_function("CDFs, bicontinuous", |b| b.iter(|| bicontinuous.update(black_box(&values))));
        let points = sample_points(300, 4);
        group.bench_function("300 samples, standard", |b| {
            b.iter(|| points.iter().map(|&u| standard.sample(black_box(u))[0]).sum::<f64>());
        });
        group.bench_function("300 samples, bicontinuous", |b| {
            b.iter(|| points.iter().map(|&u| bicontinuous.sample(black_box(u))[0]).sum::<f64>());
        });

        let mut list = LightList::default();
        for (name, sampler) in [
            ("equal-power", Sampler::EqualPower),
            ("refined", Sampler::Refined),
            ("persistent", Sampler::Persistent),
        ] {
            for count in [64, 300] {
                let options =
                    Options { count, sampler, inversion: Inversion::Bicontinuous, ..Options::default() };
                let mut extractor = Extractor::new(shape, &options).unwrap();
                group.bench_function(format!("lights alone, {count} {name}"), |b| {
                    b.iter(|| extractor.extract(black_box(&map), &mut list));
                });
                group.bench_function(format!("whole step, {count} {name}"), |b| {
                    b.iter(|| extractor.step(black_box(&map), &mut list));
                });
            }
        }
        let sites: Vec<[f32; 3]> = list.lights.iter().map(|light| light.direction).collect();
        let mut tables = NearestSites::new(shape, sites.len());
        let mut nearest = vec![0; shape.len()];
        group.bench_function("nearest of 300 sites", |b| {
            b.iter(|| tables.assign(black_box(&sites), &mut nearest));
        });
        let mut joined = Vec::new();
        group.bench_function("prefix of 64 of 300", |b| {
            b.iter(|| prefix(black_box(&list.lights), 64, &mut joined))
        });
        group.finish();
    }
}

criterion_group!(benches, lights);
criterion_main!(benches);
