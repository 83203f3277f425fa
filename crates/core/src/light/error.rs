//! The error that every list carries: relative RMS difference between the irradiances of the lights and of
//! the map over the 300 normals of METHODS section 9, computed cheaply enough for every frame.
//!
//! With `max(0, c) = (c + |c|) / 2` the irradiance at a normal n is `(S(n) + n . V) / 2`, where `V = sum f w`
//! and `S(n) = sum f |n . w|`.

use super::prefix::Prefixes;
use super::{Light, ReferencedList};
use crate::math::fibonacci_sphere;
use glam::Vec3;
use multiversion::multiversion;

/// Normals at which irradiances are compared.
pub const NORMAL_COUNT: usize = 300;
/// Normals evaluated side by side.
pub(super) const LANES: usize = 16;
/// Terms summed in f32 before they go to an f64 sum: so few terms lose less than 1e-6 of their sum.
const TERMS_IN_F32: usize = 64;

/// Light that arrives from an angular extent about one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contribution {
    /// Sum of flux times direction.
    pub(super) vector: [f32; 3],
    /// Half the width of the extent, times flux.
    pub(super) half_width: f32,
    /// `1 / (2 half_width)`, 0 for a directional light.
    inverse: f32,
}

impl Contribution {
    /// The flux is taken as spread evenly to `half_width` (an angle times flux) on either side of `vector`:
    /// the mean of `|n . w|` over it is `|c|` where the horizon of n does not cut the extent, and `(c^2 +
    /// a^2) / 2 a` where it does. 0 makes a directional light.
    pub(super) fn new(vector: Vec3, half_width: f32) -> Self {
        let inverse = if half_width > 0.0 { 0.5 / half_width } else { 0.0 };
        // The inverse of a subnormal width overflows; an extent so narrow is a direction.
        let (half_width, inverse) = if inverse.is_finite() { (half_width, inverse) } else { (0.0, 0.0) };
        Self { vector: vector.to_array(), half_width, inverse }
    }
}

/// The normals, and the irradiances there of the contributions that were summed last.
#[derive(Clone, Debug)]
pub(super) struct NormalSphere {
    x: Vec<[f32; LANES]>,
    y: Vec<[f32; LANES]>,
    z: Vec<[f32; LANES]>,
    irradiances: Vec<f32>,
}

impl NormalSphere {
    pub(super) fn new() -> Self {
        let groups = NORMAL_COUNT.div_ceil(LANES);
        let mut normals: Vec<Vec3> = fibonacci_sphere(NORMAL_COUNT).map(|n| n.as_vec3()).collect();
        normals.resize(groups * LANES, Vec3::ZERO);
        let axis = |axis: usize| -> Vec<[f32; LANES]> {
            normals.chunks_exact(LANES).map(|group| std::array::from_fn(|lane| group[lane][axis])).collect()
        };
        Self { x: axis(0), y: axis(1), z: axis(2), irradiances: Vec::with_capacity(groups * LANES) }
    }

    /// The axes' coordinates of the normals, [`LANES`] at a time; after [`NORMAL_COUNT`] they are zero.
    pub(super) fn groups(&self) -> impl Iterator<Item = [&[f32; LANES]; 3]> {
        self.x.iter().zip(&self.y).zip(&self.z).map(|((x, y), z)| [x, y, z])
    }

    /// Irradiances at the [`NORMAL_COUNT`] normals.
    pub(super) fn irradiances(&mut self, contributions: &[Contribution]) -> &[f32] {
        self.irradiances.clear();
        for ((x, y), z) in self.x.iter().zip(&self.y).zip(&self.z) {
            self.irradiances.extend(sum(x, y, z, contributions).map(|doubled| (0.5 * doubled) as f32));
        }
        &self.irradiances[..NORMAL_COUNT]
    }
}

/// `S(n) + n . V` at a group of normals.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
fn sum(x: &[f32; LANES], y: &[f32; LANES], z: &[f32; LANES], contributions: &[Contribution]) -> [f64; LANES] {
    sum_body(x, y, z, contributions)
}

#[inline(always)]
fn sum_body(
    x: &[f32; LANES],
    y: &[f32; LANES],
    z: &[f32; LANES],
    contributions: &[Contribution],
) -> [f64; LANES] {
    sum_terms(contributions, |&Contribution { vector, half_width, inverse }, lane| {
        let along = x[lane] * vector[0] + y[lane] * vector[1] + z[lane] * vector[2];
        let distance = along.abs();
        let cut = half_width - if distance < half_width { distance } else { half_width };
        (along + distance) + cut * cut * inverse
    })
}

/// Sums of `term` over `terms` for every lane.
#[inline(always)]
pub(super) fn sum_terms<T>(terms: &[T], term: impl Fn(&T, usize) -> f32) -> [f64; LANES] {
    let mut sums = [0.0f64; LANES];
    for terms in terms.chunks(TERMS_IN_F32) {
        let mut partial = [0.0f32; LANES];
        for of in terms {
            for lane in 0..LANES {
                partial[lane] += term(of, lane);
            }
        }
        for lane in 0..LANES {
            sums[lane] += f64::from(partial[lane]);
        }
    }
    sums
}

/// Error of lists against reference irradiances; holds only scratch memory.
#[derive(Clone, Debug)]
pub struct ListError {
    normals: NormalSphere,
    contributions: Vec<Contribution>,
    prefixes: Prefixes,
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
        Self {
            normals: NormalSphere::new(),
            contributions: Vec::new(),
            prefixes: Prefixes::default(),
            short: Vec::new(),
        }
    }

    /// Fills in the error and the prefix errors of a list whose lights and reference irradiances are
    /// complete. Without a reference there is no error.
    pub fn measure(&mut self, referenced: &mut ReferencedList) {
        let ReferencedList { list, reference_irradiance } = referenced;
        if reference_irradiance.is_empty() {
            list.error = None;
            list.prefix_errors.clear();
            return;
        }
        self.prefix_errors(&list.lights, reference_irradiance, &mut list.prefix_errors);
        list.error = list.prefix_errors.last().map(|&(_, error)| error);
    }

    /// RMS over the normals of the irradiance of `lights` minus `reference`, relative to the mean of
    /// `reference` (which is [`ReferencedList::reference_irradiance`], luminous). Where the reference is
    /// dark, relative to the mean of the lights; 0 where both are. An empty reference gives 0. Never above
    /// `f32::MAX`.
    pub fn relative_error(&mut self, lights: &[Light], reference: &[f32]) -> f32 {
        self.contributions.clear();
        let lights = lights.iter().filter(|light| light.luminance() > 0.0);
        self.contributions.extend(
            lights.map(|light| Contribution::new(Vec3::from(light.direction) * light.luminance(), 0.0)),
        );
        relative_rms(self.normals.irradiances(&self.contributions), reference)
    }

    /// Errors of the prefixes of 8, 16, 32, ... lights and of the whole list, as pairs of length and error.
    fn prefix_errors(&mut self, lights: &[Light], reference: &[f32], errors: &mut Vec<(u32, f32)>) {
        errors.clear();
        let mut short = std::mem::take(&mut self.short);
        self.prefixes.load(lights);
        let mut count = 8;
        while count < lights.len() {
            self.prefixes.join(lights, count, &mut short, |_, _| {});
            errors.push((count as u32, self.relative_error(&short, reference)));
            count *= 2;
        }
        errors.push((lights.len() as u32, self.relative_error(lights, reference)));
        self.short = short;
    }
}

/// RMS of `values - reference` relative to the mean of `reference`, or of the values where the reference is
/// dark; 0 where both are. Never above `f32::MAX`.
pub(super) fn relative_rms(values: &[f32], reference: &[f32]) -> f32 {
    let (mut squares, mut total, mut value_total) = (0.0f64, 0.0f64, 0.0f64);
    for (&value, &reference) in values.iter().zip(reference) {
        squares += (f64::from(value) - f64::from(reference)).powi(2);
        total += f64::from(reference);
        value_total += f64::from(value);
    }
    let total = if total > 0.0 { total } else { value_total };
    let error = if total > 0.0 { (squares * reference.len() as f64).sqrt() / total } else { 0.0 };
    // Values near the limit of f32 overflow in the sums; `min` also takes the NaN of their differences.
    (error as f32).min(f32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_instruction_set_gives_the_bits_of_the_plain_code_and_both_the_sum() {
        let contributions: Vec<Contribution> = fibonacci_sphere(500)
            .enumerate()
            .map(|(i, towards)| {
                let half_width = if i % 3 == 0 { 0.0 } else { 0.04 * i as f32 };
                Contribution::new(towards.as_vec3() * i as f32, half_width)
            })
            .collect();
        let normals = NormalSphere::new();
        for group in 0..normals.x.len() {
            let (x, y, z) = (&normals.x[group], &normals.y[group], &normals.z[group]);
            let chosen = sum(x, y, z, &contributions);
            assert_eq!(chosen, sum_body(x, y, z, &contributions));
            for lane in 0..LANES {
                let n = glam::DVec3::new(x[lane].into(), y[lane].into(), z[lane].into());
                let exact: f64 = contributions
                    .iter()
                    .map(|c| {
                        let along = n.dot(glam::DVec3::from(c.vector.map(f64::from)));
                        let width = f64::from(c.half_width);
                        let cut = if along.abs() < width {
                            (along * along + width * width) / (2.0 * width)
                        } else {
                            along.abs()
                        };
                        along + cut
                    })
                    .sum();
                assert!((chosen[lane] - exact).abs() <= 1e-6 * exact.max(1.0), "{} {exact}", chosen[lane]);
            }
        }
    }
}
