//! Median cut: Debevec, *A Median Cut Algorithm for Light Probe Sampling*, SIGGRAPH 2005 posters.
//!
//! The paper's, by its steps: (1) the map is one region; (2) every region is cut along its longer dimension "such that
//! its light energy is divided evenly"; (3) that is done n times, for 2^n regions; (4) a light stands at the centroid of
//! each region; (5) its colour is the sum of the region's pixels. Energy is luminance weighted by solid angle (the paper
//! scales pixels by the cosine of their latitude), and the width of a region is multiplied by the same cosine at its
//! middle.
//!
//! Chosen here: regions consist of whole pixels, so that the halves differ by at most the energy of a slice; of equally
//! good cuts the one nearest to the middle is taken; a dark region is cut as if it were evenly lit; the centroid is that
//! of the light, on the sphere; for a number that is no power of two the regions with the most energy are cut once more.

use super::Light;
use super::rectangles::{Content, Pixels, Rectangle, divide};
use crate::image::{PolarMap, luminance_f64};

/// Writes `count` lights (at least 1). Their sum is the RGB power of the map. A map without light gives lights without
/// power in the middle of even regions; where the map has fewer than `count` pixels the other lights have no power.
pub(super) fn median_cut(map: &PolarMap, count: usize, lights: &mut Vec<Light>) {
    let pixels = Pixels::new(map);
    pixels.lights(&regions(&pixels, count), count, lights);
}

pub(super) fn regions(pixels: &Pixels<'_>, count: usize) -> Vec<Rectangle> {
    let energy = |rectangle: &Rectangle| luminance_f64(pixels.share(rectangle, Content::Light).flux);
    divide(pixels.whole(), count, |rectangle| halves(pixels, rectangle), energy)
}

fn halves(pixels: &Pixels<'_>, rectangle: &Rectangle) -> Option<[Rectangle; 2]> {
    let axis = pixels.longer_axis(rectangle)?;
    let slices = pixels.lit_slices(rectangle, axis);
    let energies = slices.iter().map(|slice| luminance_f64(slice.flux));
    let total: f64 = energies.clone().sum();
    let (mut first, mut best) = (0.0, (f64::INFINITY, usize::MAX, 1));
    for (index, energy) in energies.take(slices.len() - 1).enumerate() {
        first += energy;
        let length = index + 1;
        let candidate = ((2.0 * first - total).abs(), (2 * length).abs_diff(slices.len()), length);
        if candidate < best {
            best = candidate;
        }
    }
    Some(rectangle.cut(axis, best.2))
}

#[cfg(test)]
mod tests;
