//! Variance minimisation: Viriyothai and Debevec, *Variance Minimization Light Probe Sampling*, SIGGRAPH 2009
//! posters.
//!
//! From the paper, by its steps: (1) the map is one region; (2) every region is cut "such that the maximum of
//! the two sub-regions' variances is minimized"; (3) this is repeated n times, for 2^n regions; (4) a light
//! is placed at the centroid of each region, with the sum of its pixels. The variance of a region is the sum
//! of L d^2 over its pixels, where L is the light energy of a pixel and d its distance from the region's
//! centroid. The paper computes it from summed-area tables.
//!
//! Chosen here: cuts along both dimensions are considered. The distance is the chord on the unit sphere to
//! the direction of the region's light, so that the variance is `2 (F - |V|)` with the flux F and the first
//! moment V, which are additive; sums are accumulated from both ends of a region, because differences of
//! table entries lose dim regions next to bright ones. Of equally good cuts the one along the longer
//! dimension and nearest to the middle is taken; a dark region is cut as if it were uniformly lit; for a
//! number that is not a power of two the regions with the largest variance are cut once more.

use super::rectangles::{Axis, Content, Pixels, Rectangle, divide};
use lightcast_core::image::{PolarMap, luminance_f64};
use lightcast_core::light::{Light, Share};

/// Writes `count` lights (at least 1). Their sum is the RGB power of the map. A map without light produces
/// lights without power at the centres of equal regions; where the map has fewer than `count` pixels the
/// remaining lights have no power.
pub(super) fn variance_minimisation(map: &PolarMap, count: usize, lights: &mut Vec<Light>) {
    let pixels = Pixels::new(map);
    pixels.lights(&regions(&pixels, count), count, lights);
}

pub(super) fn regions(pixels: &Pixels<'_>, count: usize) -> Vec<Rectangle> {
    let is_dark = pixels.share(&pixels.whole(), Content::Light).flux == [0.0; 3];
    let content = if is_dark { Content::Even } else { Content::Light };
    let rank = |rectangle: &Rectangle| variance(&pixels.share(rectangle, content));
    divide(pixels.whole(), count, |rectangle| halves(pixels, rectangle), rank)
}

/// Sum over a share of flux times squared distance from its mean direction.
fn variance(share: &Share) -> f64 {
    (2.0 * (luminance_f64(share.flux) - share.moment.length())).max(0.0)
}

fn halves(pixels: &Pixels<'_>, rectangle: &Rectangle) -> Option<[Rectangle; 2]> {
    let longer = pixels.longer_axis(rectangle)?;
    let other = if longer == Axis::Rows { Axis::Columns } else { Axis::Rows };
    let mut best = ((f64::INFINITY, usize::MAX), longer, 1);
    for axis in [longer, other] {
        let slices = pixels.lit_slices(rectangle, axis);
        // Entry i is the variance of the slices from i on.
        let mut sum = Share::default();
        let mut rest: Vec<f64> = slices
            .iter()
            .rev()
            .map(|slice| {
                sum.add(slice);
                variance(&sum)
            })
            .collect();
        rest.reverse();
        let mut first = Share::default();
        for length in 1..slices.len() {
            first.add(&slices[length - 1]);
            let rank = (variance(&first).max(rest[length]), (2 * length).abs_diff(slices.len()));
            if rank.0 < best.0.0 || axis == best.1 && rank < best.0 {
                best = (rank, axis, length);
            }
        }
    }
    let (_, axis, length) = best;
    Some(rectangle.cut(axis, length))
}

#[cfg(test)]
mod tests;
