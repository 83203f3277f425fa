//! Both inversions of a hemisphere's distribution.

use crate::arrays::{numbers, save};
use crate::work::{Result, Work, repeated};
use lightcast_core::image::PolarShape;
use lightcast_core::sampling::{Bicontinuous, Standard};
use serde::Deserialize;
use std::hint::black_box;
use std::path::Path;

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Inversion {
    Standard,
    Bicontinuous,
}

/// The part of the sampling that is timed.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    Cdf,
    Samples,
}

pub enum Distribution {
    Standard(Standard),
    Bicontinuous(Bicontinuous),
}

impl Distribution {
    pub fn new(inversion: Inversion, shape: PolarShape) -> Self {
        let z = |row: f64| 1.0 - (shape.theta_max_rad() * row / shape.rows() as f64).cos();
        match inversion {
            Inversion::Standard => {
                let edges: Vec<f64> = (0..=shape.rows()).map(|row| z(row as f64)).collect();
                Self::Standard(Standard::new(shape.columns(), &edges))
            }
            Inversion::Bicontinuous => {
                let centres: Vec<f64> = (0..shape.rows()).map(|row| z(row as f64 + 0.5)).collect();
                Self::Bicontinuous(Bicontinuous::new(shape.columns(), &centres, z(shape.rows() as f64)))
            }
        }
    }

    pub fn update(&mut self, values: &[f32]) {
        match self {
            Self::Standard(standard) => standard.update(values),
            Self::Bicontinuous(bicontinuous) => bicontinuous.update(values),
        }
    }

    pub fn sample(&self, u: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Standard(standard) => standard.sample(u),
            Self::Bicontinuous(bicontinuous) => bicontinuous.sample(u),
        }
    }

    fn pdf(&self, x: [f64; 2]) -> f64 {
        match self {
            Self::Standard(standard) => standard.pdf(x),
            Self::Bicontinuous(bicontinuous) => bicontinuous.pdf(x),
        }
    }
}

pub fn sampling(
    mut distribution: Distribution,
    part: Part,
    values: Vec<f32>,
    points: &Path,
    samples: &Path,
) -> Result<Work> {
    let points = numbers(points, f64::from_le_bytes)?.as_chunks::<2>().0.to_vec();
    distribution.update(&values);
    let results = points.iter().flat_map(|&u| {
        let x = distribution.sample(u);
        [x[0], x[1], distribution.pdf(x)]
    });
    save(samples, results.map(f64::to_le_bytes))?;
    Ok(match part {
        Part::Cdf => repeated(move || {
            distribution.update(black_box(&values));
            Ok(())
        }),
        Part::Samples => {
            let mut positions = vec![[0.0; 2]; points.len()];
            repeated(move || {
                for (position, &u) in positions.iter_mut().zip(&points) {
                    *position = distribution.sample(u);
                }
                Ok(black_box(&mut positions)[0])
            })
        }
    })
}
