//! A naive implementation of the paper's method (Havran et al. 2005, sections 3.1 to 3.3), entirely in f32,
//! with which [`super::stability`] compares. Nothing else uses it, and it handles no special cases that the
//! paper does not mention.

use lightcast_core::image::{PolarMap, luminance};
use lightcast_core::light::Light;
use lightcast_core::math::disc_from_square;
use std::collections::VecDeque;
use std::f32::consts::TAU;

/// The paper's weights w1 to w9, as printed.
const WEIGHTS: [f32; 9] = [0.06216, 0.01296, -0.13816, 0.28315, 0.65223, 0.28315, -0.13816, 0.01296, 0.06216];

/// Edges of the rows as z = 1 - cos theta.
fn z_edges(map: &PolarMap) -> Vec<f32> {
    let step = map.shape.theta_max_rad() as f32 / map.shape.rows() as f32;
    (0..=map.shape.rows()).map(|row| 1.0 - (row as f32 * step).cos()).collect()
}

/// Luminous power: the sum of luminance times solid angle, in f32.
pub(super) fn power(map: &PolarMap) -> f32 {
    let (z, d_phi) = (z_edges(map), TAU / map.shape.columns() as f32);
    let mut sum = 0.0f32;
    for (row, pixels) in map.pixels.chunks_exact(map.shape.columns()).enumerate() {
        for &pixel in pixels {
            sum += luminance(pixel) * (z[row + 1] - z[row]) * d_phi;
        }
    }
    sum
}

/// Cumulative sums, normalised by the last.
fn cumulative(values: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut sum = 0.0f32;
    let mut table = vec![0.0];
    table.extend(values.map(|value| {
        sum += value;
        sum
    }));
    table.iter().map(|value| value / sum).collect()
}

/// The position of `u` in a cumulative table, in intervals.
fn inverse(count: usize, u: f32, table: impl Fn(usize) -> f32) -> f32 {
    let mut index = 0;
    while index + 1 < count && table(index + 1) <= u {
        index += 1;
    }
    index as f32 + (u - table(index)) / (table(index + 1) - table(index))
}

/// Lights of equal power at the bicontinuous inverse transform of `points`, with the chromaticities of their
/// pixels.
pub(super) fn lights(map: &PolarMap, points: &[[f64; 2]]) -> Vec<Light> {
    let (columns, rows) = (map.shape.columns(), map.shape.rows());
    let z = z_edges(map);
    let row_luminances =
        |row: usize| map.pixels[row * columns..][..columns].iter().map(|&pixel| luminance(pixel));
    let rings: Vec<Vec<f32>> = (0..rows).map(|row| cumulative(row_luminances(row))).collect();
    let radial = cumulative((0..rows).map(|row| row_luminances(row).sum::<f32>() * (z[row + 1] - z[row])));
    let share = power(map) / points.len() as f32;
    let light = |(id, point): (usize, &[f64; 2])| {
        let [r, phi_d] = disc_from_square(*point).map(|value| value as f32);
        let place = inverse(rows, r * r, |index| radial[index]);
        let row = (place as usize).min(rows - 1);
        let height = z[row] + (place - row as f32) * (z[row + 1] - z[row]);
        // Rings are at the centres of rows, with linear interpolation between them.
        let below = (place - 0.5).max(0.0);
        let (upper, x) = (below as usize, below - below.floor());
        let (upper, lower) = (upper.min(rows - 1), (upper + 1).min(rows - 1));
        let ring = |index: usize| (1.0 - x) * rings[upper][index] + x * rings[lower][index];
        let column = inverse(columns, phi_d / TAU, ring);
        let phi = column / columns as f32 * TAU;
        let cos_theta = 1.0 - height;
        let sin_theta = (1.0 - cos_theta * cos_theta).sqrt();
        let pixel = map.pixels[row * columns + (column as usize).min(columns - 1)];
        Light {
            id: id as u32,
            direction: [sin_theta * phi.cos(), cos_theta, sin_theta * phi.sin()],
            irradiance: pixel.map(|value| value / luminance(pixel) * share),
            spread_rad: 0.0,
        }
    };
    points.iter().enumerate().map(light).collect()
}

/// The paper's filter on one light: nine weights divided by their sum, applied to power and direction
/// separately.
pub(super) struct Filter {
    /// Newest first.
    history: VecDeque<([f32; 3], f32)>,
}

impl Filter {
    /// A filter whose history is filled with one light.
    pub(super) fn new(direction: [f32; 3], power: f32) -> Self {
        Self { history: [(direction, power); 9].into() }
    }

    /// The filtered direction and power for these inputs.
    pub(super) fn step(&mut self, direction: [f32; 3], power: f32) -> ([f32; 3], f32) {
        self.history.pop_back();
        self.history.push_front((direction, power));
        let total: f32 = WEIGHTS.iter().sum();
        let (mut vector, mut sum) = ([0.0f32; 3], 0.0f32);
        for (&(direction, power), weight) in self.history.iter().zip(WEIGHTS) {
            for axis in 0..3 {
                vector[axis] += weight / total * direction[axis];
            }
            sum += weight / total * power;
        }
        let length = vector.iter().map(|value| value * value).sum::<f32>().sqrt();
        (vector.map(|value| value / length), sum)
    }
}
