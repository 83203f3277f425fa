//! The first sites: well-spread points mapped by the inverse transform (METHODS section 5).

use crate::image::{PolarMap, PolarShape, luminance};
use crate::math::direction_at_height;
use crate::sampling::{Bicontinuous, sample_points};

/// Points of the unit square, and the distribution of one map after another.
#[derive(Clone, Debug)]
pub(super) struct Seeds {
    points: Vec<[f64; 2]>,
    distribution: Bicontinuous,
    importance: Vec<f32>,
}

impl Seeds {
    /// `count` points after `relaxation_steps` steps of relaxation, for maps of one shape.
    pub(super) fn new(shape: PolarShape, count: usize, relaxation_steps: usize) -> Self {
        let centres: Vec<f64> = (0..shape.rows()).map(|row| shape.height(row as f64 + 0.5)).collect();
        Self {
            points: sample_points(count, relaxation_steps),
            distribution: Bicontinuous::new(shape.columns(), &centres, shape.height(shape.rows() as f64)),
            importance: vec![0.0; shape.len()],
        }
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
        self.distribution.update(&self.importance);
        sites.clear();
        sites.extend(self.points.iter().map(|&u| {
            let [z, phi_rad] = self.distribution.sample(u);
            direction_at_height(z, phi_rad).as_vec3().to_array()
        }));
    }
}

/// Importance of a pixel for the sites of cells: luminance^0.75. Sites by luminance itself crowd in the
/// brightest spots, where one light is as good as ten.
pub fn dampened_luminance(pixel: [f32; 3]) -> f32 {
    let root = luminance(pixel).sqrt();
    root * root.sqrt()
}
