//! The error that every list carries: relative RMS difference between the irradiances of the lights and of the map
//! over the sphere of normals (METHODS section 9), by means cheap enough for every frame.
//!
//! The normals come in opposite pairs. With `max(0, c) = (c + |c|) / 2` the irradiances at n and -n share one
//! sum: `E(+-n) = (S(n) +- n . V) / 2`, where `S(n) = sum f |n . w|` and `V = sum f w`.

use super::{Light, prefix};
use crate::math::fibonacci_sphere;
use glam::{DVec3, Vec3};

/// Pairs of opposite normals; with 150 the figure has the 300 normals of METHODS section 9.
const PAIRS: usize = 150;

/// Irradiances at the estimator's normals: the sums that all contributions share.
#[derive(Clone, Debug)]
pub(super) struct IrradianceSums {
    x: [f32; PAIRS],
    y: [f32; PAIRS],
    z: [f32; PAIRS],
    absolute: [f32; PAIRS],
    vector: Vec3,
}

impl IrradianceSums {
    pub(super) fn new() -> Self {
        let mut sums = Self {
            x: [0.0; PAIRS],
            y: [0.0; PAIRS],
            z: [0.0; PAIRS],
            absolute: [0.0; PAIRS],
            vector: Vec3::ZERO,
        };
        for (i, n) in fibonacci_sphere(2 * PAIRS).take(PAIRS).map(DVec3::as_vec3).enumerate() {
            (sums.x[i], sums.y[i], sums.z[i]) = (n.x, n.y, n.z);
        }
        sums
    }

    pub(super) fn clear(&mut self) {
        self.absolute = [0.0; PAIRS];
        self.vector = Vec3::ZERO;
    }

    /// Adds light that arrives from an angular extent about one direction: `vector` is the sum of flux times
    /// direction, `half_width` the half width of the flux in the same unit, so that the mean of `|n . w|` over
    /// the extent is `|c|` where the horizon of n does not cut it and `(c^2 + a^2) / 2 a` where it does (flux
    /// spread evenly over [c - a, c + a]). Zero for a directional light.
    #[inline(always)]
    pub(super) fn add(&mut self, vector: Vec3, half_width: f32) {
        // The inverse of a subnormal width is infinite, and NaN once it meets a zero.
        let inverse = if half_width >= f32::MIN_POSITIVE { 0.5 / half_width } else { 0.0 };
        for i in 0..PAIRS {
            let cosine = (self.x[i] * vector.x + self.y[i] * vector.y + self.z[i] * vector.z).abs();
            let cut = half_width - cosine.min(half_width);
            self.absolute[i] += cosine + cut * (cut * inverse);
        }
        self.vector += vector;
    }

    /// Irradiances at the first normals of all pairs, then at their opposites.
    pub(super) fn irradiances(&self) -> impl Iterator<Item = f32> {
        [1.0, -1.0].into_iter().flat_map(move |sign| {
            (0..PAIRS).map(move |i| {
                let along = self.x[i] * self.vector.x + self.y[i] * self.vector.y + self.z[i] * self.vector.z;
                0.5 * (self.absolute[i] + sign * along)
            })
        })
    }
}

/// Error of lists against reference irradiances; holds only scratch memory.
#[derive(Clone, Debug)]
pub struct ListError {
    sums: IrradianceSums,
    short: Vec<Light>,
}

impl Default for ListError {
    fn default() -> Self {
        Self::new()
    }
}

impl ListError {
    /// Ready to measure.
    pub fn new() -> Self {
        Self { sums: IrradianceSums::new(), short: Vec::new() }
    }

    /// RMS over the normals of the irradiance of `lights` less `reference`, relative to the mean of `reference`
    /// (which is [`super::LightList::reference_irradiance`], luminous). Where the reference is dark, relative to
    /// the mean of the lights; 0 where both are. An empty reference gives 0.
    pub fn relative_error(&mut self, lights: &[Light], reference: &[f32]) -> f32 {
        self.sums.clear();
        for light in lights {
            self.sums.add(Vec3::from(light.direction) * light.luminance(), 0.0);
        }
        let (mut squares, mut total, mut light_total) = (0.0f64, 0.0f64, 0.0f64);
        for (value, &reference) in self.sums.irradiances().zip(reference) {
            squares += f64::from(value - reference).powi(2);
            total += f64::from(reference);
            light_total += f64::from(value);
        }
        let total = if total > 0.0 { total } else { light_total };
        if total > 0.0 { ((squares * reference.len() as f64).sqrt() / total) as f32 } else { 0.0 }
    }

    /// Errors of the prefixes of 8, 16, 32, ... lights and of the whole list, as pairs of length and error.
    pub fn prefix_errors(&mut self, lights: &[Light], reference: &[f32], errors: &mut Vec<(u32, f32)>) {
        errors.clear();
        let mut short = std::mem::take(&mut self.short);
        let mut count = 8;
        while count < lights.len() {
            prefix(lights, count, &mut short);
            errors.push((count as u32, self.relative_error(&short, reference)));
            count *= 2;
        }
        errors.push((lights.len() as u32, self.relative_error(lights, reference)));
        self.short = short;
    }
}
