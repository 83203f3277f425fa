//! Where sites begin: at what the inverse transform makes of well-spread points (METHODS section 5).

use super::Inversion;
use crate::image::{PolarMap, PolarShape, luminance};
use crate::sampling::{Bicontinuous, Standard, sample_points};

/// Points of the unit square, and the distribution of one map after another.
#[derive(Clone, Debug)]
pub(super) struct Seeds {
    points: Vec<[f64; 2]>,
    distribution: Distribution,
    importance: Vec<f32>,
}

#[derive(Clone, Debug)]
enum Distribution {
    Standard(Standard),
    Bicontinuous(Bicontinuous),
}

impl Seeds {
    /// `count` points after so many steps of relaxation, for maps of one shape.
    pub(super) fn new(
        shape: PolarShape,
        count: usize,
        relaxation_steps: usize,
        inversion: Inversion,
    ) -> Self {
        let z = |row: f64| 2.0 * (0.5 * shape.theta_max_rad * row / shape.rows as f64).sin().powi(2);
        let centres = || -> Vec<f64> { (0..shape.rows).map(|row| z(row as f64 + 0.5)).collect() };
        let bicontinuous = || Bicontinuous::new(shape.columns, &centres(), z(shape.rows as f64));
        let distribution = match inversion {
            Inversion::Standard => {
                let edges: Vec<f64> = (0..=shape.rows).map(|row| z(row as f64)).collect();
                Distribution::Standard(Standard::new(shape.columns, &edges))
            }
            Inversion::Bicontinuous => Distribution::Bicontinuous(bicontinuous()),
            Inversion::NormalisedRows => Distribution::Bicontinuous(bicontinuous().with_normalised_rows()),
        };
        Self {
            points: sample_points(count, relaxation_steps),
            distribution,
            importance: vec![0.0; shape.len()],
        }
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.points.len()
    }

    /// Fills `sites` with unit vectors distributed as `importance(pixel)` is; uniform over a map without any.
    pub(super) fn sites(
        &mut self,
        map: &PolarMap,
        importance: impl Fn([f32; 3]) -> f32,
        sites: &mut Vec<[f32; 3]>,
    ) {
        for (value, &pixel) in self.importance.iter_mut().zip(&map.pixels) {
            *value = importance(pixel);
        }
        sites.clear();
        match &mut self.distribution {
            Distribution::Standard(standard) => {
                standard.update(&self.importance);
                sites.extend(self.points.iter().map(|&u| site(standard.sample(u))));
            }
            Distribution::Bicontinuous(bicontinuous) => {
                bicontinuous.update(&self.importance);
                sites.extend(self.points.iter().map(|&u| site(bicontinuous.sample(u))));
            }
        }
    }
}

/// Importance for the sites of cells: luminance^0.75. Sites by luminance itself crowd in the brightest spots, where one
/// light is as good as ten.
pub(super) fn dampened(pixel: [f32; 3]) -> f32 {
    let root = luminance(pixel).sqrt();
    root * root.sqrt()
}

/// Unit vector of `[z, phi]`, z = 1 - cos theta.
fn site([z, phi]: [f64; 2]) -> [f32; 3] {
    let sin_theta = (z * (2.0 - z)).max(0.0).sqrt();
    let (sin_phi, cos_phi) = phi.sin_cos();
    [(sin_theta * cos_phi) as f32, (1.0 - z) as f32, (sin_theta * sin_phi) as f32]
}
