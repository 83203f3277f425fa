//! Structured importance sampling: Agarwal, Ramamoorthi, Belongie and Jensen, *Structured Importance Sampling
//! of Environment Maps*, SIGGRAPH 2003.
//!
//! From the paper: the map is divided into six levels of radiance by thresholds at multiples of its standard
//! deviation, and these into connected components. A component of illumination L and solid angle dO has the
//! importance `L^a min(dO, dO_0)^b` with a = 1, b = 1/4 and dO_0 = 0.01 sr, so that a small bright source
//! gets fewer samples than by its power alone; the number of samples is proportional to it. They are spread
//! over the component by the farthest-point rule of Hochbaum and Shmoys, brightest levels first, away from
//! all samples placed before. Every sample takes the illumination of its stratum, integrated before
//! rendering.
//!
//! Chosen here: levels are disjoint, where the paper's lower levels include the higher ones and their
//! samples. Numbers of samples are rounded by Sainte-Lague's divisors, so that they add up. The very first
//! sample is the brightest pixel. Components without a sample, of which noisy maps have many, belong to the
//! nearest samples. A light has the mean direction of its stratum's flux, not that of the sample, which the
//! farthest-point rule often places at the stratum's edge.

use super::spare_lights::fill_up;
use glam::DVec3;
use lightcast_core::image::{PolarMap, luminance_f64};
use lightcast_core::light::{Light, Share, collect_component};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

const LEVEL_COUNT: usize = 6;
/// The paper's b and dO_0.
const SOLID_ANGLE_EXPONENT: f64 = 0.25;
const SOLID_ANGLE_MOST_SR: f64 = 0.01;
/// Marks a pixel without a site.
const NONE: u32 = u32::MAX;

/// Writes `count` lights (at least 1). Their sum is the RGB power of the map. A constant map, including a
/// black one, is one component; where the map has fewer than `count` pixels the remaining lights have no
/// power.
pub(super) fn structured(map: &PolarMap, count: usize, lights: &mut Vec<Light>) {
    let strata = Strata::new(map, count);
    let mut shares = vec![Share::default(); strata.sites.len()];
    for (index, &site) in strata.nearest.iter().enumerate() {
        shares[site as usize].add(&pixel_share(map, index));
    }
    lights.clear();
    let shares = shares.iter().zip(&strata.sites).enumerate();
    lights.extend(
        shares.map(|(id, (share, &site))| share.light(id as u32, direction(map, site).as_vec3().to_array())),
    );
    fill_up(lights, count);
}

/// Samples and their strata.
struct Strata {
    /// Pixels of the samples.
    sites: Vec<usize>,
    /// For every pixel the index of the site that it belongs to.
    nearest: Vec<u32>,
}

/// Connected pixels of one level.
#[derive(Clone, Debug)]
struct Component {
    level: usize,
    /// Range in the list of all components' pixels.
    members: Range<usize>,
    importance: f64,
}

impl Strata {
    fn new(map: &PolarMap, count: usize) -> Self {
        let (mut components, members) = components(map);
        // The sort is stable: components of one level stay in the order of their first pixels.
        components.sort_by_key(|component| Reverse(component.level));
        let counts = apportion(&components, count);
        let directions: Vec<DVec3> = (0..map.pixels.len()).map(|index| direction(map, index)).collect();
        let mut sites = Vec::with_capacity(count);
        // Dot products with the nearest of all sites, and with the nearest site of the pixel's own component.
        let mut closest = vec![f64::NEG_INFINITY; map.pixels.len()];
        let mut own = closest.clone();
        let (mut nearest, mut nearest_own) = (vec![NONE; map.pixels.len()], vec![NONE; map.pixels.len()]);
        for (component, count) in components.iter().zip(counts) {
            let pixels = &members[component.members.clone()];
            for _ in 0..count {
                let site = if sites.is_empty() {
                    pixels
                        .iter()
                        .copied()
                        .reduce(|a, b| if luminance(map, b) > luminance(map, a) { b } else { a })
                } else {
                    pixels.iter().copied().reduce(|a, b| if closest[b] < closest[a] { b } else { a })
                };
                let Some(site) = site else { break };
                let index = sites.len() as u32;
                for (pixel, direction) in directions.iter().enumerate() {
                    let dot = direction.dot(directions[site]);
                    if dot > closest[pixel] {
                        (closest[pixel], nearest[pixel]) = (dot, index);
                    }
                }
                for &pixel in pixels {
                    let dot = directions[pixel].dot(directions[site]);
                    if dot > own[pixel] {
                        (own[pixel], nearest_own[pixel]) = (dot, index);
                    }
                }
                sites.push(site);
            }
        }
        for (nearest, own) in nearest.iter_mut().zip(nearest_own) {
            if own != NONE {
                *nearest = own;
            }
        }
        Self { sites, nearest }
    }
}

/// Numbers of samples of the components, `count` in total, or as many as there are pixels if those are fewer:
/// in proportion to importance, by the divisors 1, 3, 5 ... (Sainte-Lague), and at most one per pixel.
fn apportion(components: &[Component], count: usize) -> Vec<usize> {
    let mut counts = vec![0; components.len()];
    // The bit patterns of non-negative floating-point numbers have the same order as the numbers.
    let claim = |index: usize, has: usize| {
        ((components[index].importance / (2 * has + 1) as f64).to_bits(), Reverse(index))
    };
    let mut heap: BinaryHeap<_> = (0..components.len()).map(|index| claim(index, 0)).collect();
    for _ in 0..count {
        let Some((_, Reverse(index))) = heap.pop() else { break };
        counts[index] += 1;
        if counts[index] < components[index].members.len() {
            heap.push(claim(index, counts[index]));
        }
    }
    counts
}

/// The components of pixels of one level, and their pixels one after another.
fn components(map: &PolarMap) -> (Vec<Component>, Vec<usize>) {
    let levels = levels(map);
    let mut is_open = vec![true; levels.len()];
    let (mut components, mut members) = (Vec::new(), Vec::with_capacity(levels.len()));
    let mut stack = Vec::new();
    for start in 0..levels.len() {
        if !std::mem::replace(&mut is_open[start], false) {
            continue;
        }
        let (level, first) = (levels[start], members.len());
        let close = |pixel: usize| levels[pixel] == level && std::mem::replace(&mut is_open[pixel], false);
        collect_component(map.shape, start, close, &mut stack, &mut members);
        let (mut flux, mut solid_angle) = (0.0, 0.0);
        for &index in &members[first..] {
            let of_pixel = map.shape.pixel_solid_angle(index / map.shape.columns());
            flux += luminance(map, index) * of_pixel;
            solid_angle += of_pixel;
        }
        components.push(Component {
            level,
            members: first..members.len(),
            importance: flux * solid_angle.min(SOLID_ANGLE_MOST_SR).powf(SOLID_ANGLE_EXPONENT),
        });
    }
    (components, members)
}

/// The level of every pixel: the number of thresholds sigma, 2 sigma ... 5 sigma that its luminance reaches,
/// where sigma is the map's standard deviation weighted by solid angle. All 0 for a constant map.
fn levels(map: &PolarMap) -> Vec<usize> {
    let solid_angle = |index: usize| map.shape.pixel_solid_angle(index / map.shape.columns());
    let (mut sum, mut weight) = (0.0, 0.0);
    for index in 0..map.pixels.len() {
        sum += luminance(map, index) * solid_angle(index);
        weight += solid_angle(index);
    }
    let mean = sum / weight;
    let squares = (0..map.pixels.len())
        .map(|index| (luminance(map, index) - mean).powi(2) * solid_angle(index))
        .sum::<f64>();
    let sigma = (squares / weight).sqrt();
    // The deviation of a constant map is only rounding error.
    let is_constant = sigma <= 1e-12 * mean;
    (0..map.pixels.len())
        .map(
            |index| {
                if is_constant { 0 } else { ((luminance(map, index) / sigma) as usize).min(LEVEL_COUNT - 1) }
            },
        )
        .collect()
}

fn luminance(map: &PolarMap, index: usize) -> f64 {
    luminance_f64(map.pixels[index].map(f64::from))
}

fn direction(map: &PolarMap, index: usize) -> DVec3 {
    map.shape.pixel_direction(index / map.shape.columns(), index % map.shape.columns())
}

fn pixel_share(map: &PolarMap, index: usize) -> Share {
    let solid_angle = map.shape.pixel_solid_angle(index / map.shape.columns());
    let flux = map.pixels[index].map(|value| f64::from(value) * solid_angle);
    Share { flux, moment: direction(map, index) * luminance_f64(flux) }
}

#[cfg(test)]
mod tests;
