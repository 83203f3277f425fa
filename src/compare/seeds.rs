//! Sites placed by each of the inverse transforms of METHODS section 5.

use lightcast_core::image::{PolarMap, PolarShape};
use lightcast_core::math::direction_at_height;
use lightcast_core::sampling::{Bicontinuous, Standard, sample_points};

/// Which inverse transform places samples (METHODS section 5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Inversion {
    /// [`Bicontinuous`]: that of the live path.
    #[default]
    Bicontinuous,
    /// [`Bicontinuous`] with rows normalised before they are interpolated, as in the paper.
    NormalisedRows,
    /// [`Standard`], the baseline.
    Standard,
}

/// Points of the unit square, and the distribution of the current map.
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
    /// `count` points after `relaxation_steps` steps of relaxation, for maps of one shape.
    pub(super) fn new(
        shape: PolarShape,
        count: usize,
        relaxation_steps: usize,
        inversion: Inversion,
    ) -> Self {
        let rows = shape.rows();
        let bicontinuous = || {
            let centres: Vec<f64> = (0..rows).map(|row| shape.height(row as f64 + 0.5)).collect();
            Bicontinuous::new(shape.columns(), &centres, shape.height(rows as f64))
        };
        let distribution = match inversion {
            Inversion::Standard => {
                let edges: Vec<f64> = (0..=rows).map(|row| shape.height(row as f64)).collect();
                Distribution::Standard(Standard::new(shape.columns(), &edges))
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

    /// Fills `sites` with unit vectors distributed according to `importance(pixel)`; uniform over a map
    /// without any importance.
    pub(super) fn sites(
        &mut self,
        map: &PolarMap,
        importance: impl Fn([f32; 3]) -> f32,
        sites: &mut Vec<[f32; 3]>,
    ) {
        for (value, &pixel) in self.importance.iter_mut().zip(&map.pixels) {
            *value = importance(pixel);
        }
        let site = |[z, phi_rad]: [f64; 2]| direction_at_height(z, phi_rad).as_vec3().to_array();
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
