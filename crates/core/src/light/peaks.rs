//! Dominant peaks: the sun, the Moon, a lamp as lights of their own (METHODS section 6).
//!
//! In the cell of a site a small source is averaged with the sky about it: the light's direction is pulled
//! towards the middle of the cell, the more so the dimmer the source is, and a strong source attracts many
//! sites. Here connected pixels above a limit give the part *above* it to a light of their own; the part up
//! to the limit stays in the map. Giving away whole pixels instead would make the light jump as pixels cross
//! the limit: for the Moon behind passing cloud, over 0.5-degree pixels, by up to 0.13 degrees instead of
//! 0.03.

use super::components::collect_component;
use super::refine::Share;
use crate::image::{PolarMap, PolarShape, luminance, luminance_f64};
use crate::math::angle_between;
use glam::DVec3;
use multiversion::multiversion;
use std::borrow::Cow;
use std::f64::consts::PI;
use std::ops::Range;

/// Luminance above which a pixel may belong to a peak, in mean luminances of the map. It clears a hazy sky's
/// glow about the Moon, where 3 to 5 serve equally well.
const LIMIT: f64 = 4.0;

/// Up to this RMS angle about its direction a component is one source, for any number of lights.
const LEAST_SPREAD_MAX_RAD: f64 = PI / 180.0;
/// So it is up to this part of the spread of an even cell of the hemisphere, which is 1 / sqrt(n) for n
/// lights: a wider source is better shared by several lights.
const SPREAD_MAX_OF_CELL: f64 = 0.25;

/// A peak holds at least this many equal shares of the map's power, or this part of the power if that is
/// less.
const SHARES: f64 = 16.0;
const PART_OF_POWER: f64 = 0.125;
/// Alternatively it holds this many equal shares, and this part of all that the map has above the limit: the
/// one Moon over a hazy sky, which may hold a thousandth of the light, but not the lamps of a hall, which
/// would come and go as they flicker.
const LEAST_SHARES: f64 = 1.0 / 64.0;
const PART_OF_EXCESS: f64 = 0.5;

/// Factor by which a known peak may fall short of all these limits, so that it does not come and go.
const EASE: f64 = 2.0;

/// Largest step of a peak from one frame to the next.
pub(super) const STEP_MAX_RAD: f64 = 6.0 * PI / 180.0;

/// Pixels of a row that are skipped together where none of them can be above the limit.
const STRETCH: usize = 64;

/// Finds the peaks of one map after another.
#[derive(Clone, Debug)]
pub(super) struct Peaks {
    shape: PolarShape,
    light_count: usize,
    most: usize,
    /// Largest value of any channel in every stretch of a row: no luminance in it is above that, up to
    /// rounding.
    largest: Vec<f32>,
    is_open: Vec<bool>,
    /// The pixels that were opened.
    opened: Vec<usize>,
    /// Pixels to visit, and those of all peaks one after another.
    stack: Vec<usize>,
    members: Vec<usize>,
    found: Vec<Peak>,
    /// Copies of the rows that have peaks, without the peaks, and the numbers of these rows.
    dimmed: Vec<[f32; 3]>,
    is_dimmed: Vec<bool>,
}

/// A map without its peaks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest<'a> {
    map: &'a PolarMap,
    /// Rows that replace those of the map.
    dimmed: &'a [[f32; 3]],
    is_dimmed: &'a [bool],
}

impl<'a> Rest<'a> {
    /// A row's pixels.
    pub(super) fn row(&self, row: usize) -> &'a [[f32; 3]] {
        let pixels = if self.is_dimmed[row] { self.dimmed } else { &self.map.pixels };
        let columns = self.map.shape.columns();
        &pixels[row * columns..(row + 1) * columns]
    }

    /// The whole of it as a map, copied where it is not the map itself.
    pub(super) fn to_map(self) -> Cow<'a, PolarMap> {
        if !self.is_dimmed.contains(&true) {
            return Cow::Borrowed(self.map);
        }
        let rows: Vec<_> = (0..self.map.shape.rows()).map(|row| self.row(row)).collect();
        Cow::Owned(PolarMap { pixels: rows.concat(), ..*self.map })
    }
}

/// A dominant peak.
#[derive(Clone, Debug)]
pub(super) struct Peak {
    /// Its part above the limit.
    pub(super) share: Share,
    /// Its direction, a unit vector.
    pub(super) direction: DVec3,
    flux: f64,
    members: Range<usize>,
}

impl Peaks {
    /// For maps of one shape and lists of `light_count` lights, of which at most an eighth are peaks.
    pub(super) fn new(shape: PolarShape, light_count: usize) -> Self {
        let most = light_count / 8;
        Self {
            shape,
            light_count,
            most,
            largest: vec![0.0; shape.rows() * shape.columns().div_ceil(STRETCH)],
            is_open: vec![false; shape.len()],
            // As much as any map can need: nothing is allocated later.
            opened: Vec::with_capacity(shape.len()),
            stack: Vec::with_capacity(shape.len()),
            members: Vec::with_capacity(shape.len()),
            found: Vec::with_capacity(most + 1),
            dimmed: vec![[0.0; 3]; shape.len()],
            is_dimmed: vec![false; shape.rows()],
        }
    }

    /// The peaks of the map, brightest first, and the map without them: together they are the map, in power
    /// and colour. `is_known` says whether there was a peak near a direction in the last frame.
    pub(super) fn find<'a>(
        &'a mut self,
        map: &'a PolarMap,
        is_known: impl Fn(DVec3) -> bool,
    ) -> (&'a [Peak], Rest<'a>) {
        self.found.clear();
        self.members.clear();
        self.is_dimmed.fill(false);
        if self.most > 0 {
            let (power, mean) = self.power_and_mean(map);
            let limit = LIMIT * mean;
            let excess = self.open(map, limit);
            let least = Least::new(self.light_count, power, excess);
            // Less than this cannot be a peak, whatever pixels it consists of.
            if excess >= least.known_flux() {
                for place in 0..self.opened.len() {
                    if self.is_open[self.opened[place]] {
                        self.consider(map, self.opened[place], limit, &least, &is_known);
                    }
                }
                self.dim(map, limit);
            }
        }
        (&self.found, Rest { map, dimmed: &self.dimmed, is_dimmed: &self.is_dimmed })
    }

    /// Luminous power and mean luminance; notes the largest values of all stretches.
    fn power_and_mean(&mut self, map: &PolarMap) -> (f64, f64) {
        let (mut power, mut solid_angle) = (0.0, 0.0);
        let columns = self.shape.columns();
        let rows = map.pixels.chunks_exact(columns);
        for (row, (pixels, largest)) in
            rows.zip(self.largest.chunks_exact_mut(columns.div_ceil(STRETCH))).enumerate()
        {
            let of_pixel = self.shape.pixel_solid_angle(row);
            power += of_pixel * luminance_f64(sum_and_largest(pixels, largest));
            solid_angle += of_pixel * columns as f64;
        }
        (power, power / solid_angle)
    }

    /// Opens the pixels above the limit and gives the luminous power that they have above it.
    fn open(&mut self, map: &PolarMap, limit: f64) -> f64 {
        // Pixels that no component took last time.
        for index in self.opened.drain(..) {
            self.is_open[index] = false;
        }
        let mut excess = 0.0;
        let columns = self.shape.columns();
        let stretches = columns.div_ceil(STRETCH);
        for (row, largest) in self.largest.chunks_exact(stretches).enumerate() {
            let mut above = 0.0;
            for (stretch, &largest) in largest.iter().enumerate() {
                // A map without light has none above its mean of 0.
                if f64::from(largest) <= limit {
                    continue;
                }
                let start = row * columns + stretch * STRETCH;
                for index in start..(start + STRETCH).min((row + 1) * columns) {
                    let luminance = f64::from(luminance(map.pixels[index]));
                    if luminance > limit {
                        self.is_open[index] = true;
                        self.opened.push(index);
                        above += luminance - limit;
                    }
                }
            }
            excess += above * self.shape.pixel_solid_angle(row);
        }
        excess
    }

    /// Takes what the peaks have above the limit out of copies of their rows.
    fn dim(&mut self, map: &PolarMap, limit: f64) {
        let columns = self.shape.columns();
        for peak in &self.found {
            for &index in &self.members[peak.members.clone()] {
                let row = index / columns;
                if !std::mem::replace(&mut self.is_dimmed[row], true) {
                    let own = row * columns..(row + 1) * columns;
                    self.dimmed[own.clone()].copy_from_slice(&map.pixels[own]);
                }
                let pixel = &mut self.dimmed[index];
                let kept = limit / luminance_f64(pixel.map(f64::from));
                *pixel = pixel.map(|value| (f64::from(value) * kept) as f32);
            }
        }
    }

    /// Closes the component of a pixel, and keeps it among the brightest if it is a peak.
    fn consider(
        &mut self,
        map: &PolarMap,
        start: usize,
        limit: f64,
        least: &Least,
        is_known: &impl Fn(DVec3) -> bool,
    ) {
        let first = self.members.len();
        self.is_open[start] = false;
        let close = |pixel: usize| std::mem::replace(&mut self.is_open[pixel], false);
        collect_component(self.shape, start, close, &mut self.stack, &mut self.members);
        let mut share = Share::default();
        for &index in &self.members[first..] {
            share.add(&excess_of(map, index, limit));
        }
        let flux = share.luminous_flux();
        let direction = share.moment.normalize_or(DVec3::Y);
        if !least.allows(flux, share.moment.length(), || is_known(direction)) {
            self.members.truncate(first);
            return;
        }
        let place = self.found.partition_point(|peak| peak.flux >= flux);
        self.found.insert(place, Peak { share, direction, flux, members: first..self.members.len() });
        self.found.truncate(self.most);
    }
}

/// What a component must hold, and how narrow it must be.
struct Least {
    flux: f64,
    cos_spread: f64,
    cos_known_spread: f64,
}

impl Least {
    fn new(light_count: usize, power: f64, excess: f64) -> Self {
        let count = light_count as f64;
        let strong = (SHARES / count).min(PART_OF_POWER) * power;
        let lonely = (LEAST_SHARES / count * power).max(PART_OF_EXCESS * excess);
        let spread_rad = (SPREAD_MAX_OF_CELL / count.sqrt()).max(LEAST_SPREAD_MAX_RAD);
        Self {
            flux: strong.min(lonely),
            cos_spread: spread_rad.cos(),
            cos_known_spread: (EASE.sqrt() * spread_rad).cos(),
        }
    }

    fn known_flux(&self) -> f64 {
        self.flux / EASE
    }

    /// Whether a component of some flux and first moment is a peak. NaN, which comes from radiances near the
    /// largest f32, is not.
    fn allows(&self, flux: f64, moment: f64, is_known: impl FnOnce() -> bool) -> bool {
        let is = |least_flux: f64, cos_spread: f64| {
            flux > 0.0 && flux >= least_flux && moment >= cos_spread * flux
        };
        // A starry sky has thousands of components that fail in either case.
        is(self.flux, self.cos_spread) || (is(self.known_flux(), self.cos_known_spread) && is_known())
    }
}

/// Whether a peak in direction `a` may be the one that was in direction `b` a frame ago.
pub(super) fn is_a_step(a: DVec3, b: DVec3) -> bool {
    angle_between(a, b) <= STEP_MAX_RAD
}

/// The part of a pixel above the limit.
fn excess_of(map: &PolarMap, index: usize, limit: f64) -> Share {
    let (row, column) = (index / map.shape.columns(), index % map.shape.columns());
    let rgb = map.pixels[index].map(f64::from);
    let luminance = luminance_f64(rgb);
    let solid_angle = map.shape.pixel_solid_angle(row);
    Share {
        flux: rgb.map(|value| value * (1.0 - limit / luminance) * solid_angle),
        moment: map.shape.pixel_direction(row, column) * ((luminance - limit) * solid_angle),
    }
}

/// RGB sum of a row, and the largest value of each of its stretches.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
fn sum_and_largest(pixels: &[[f32; 3]], largest: &mut [f32]) -> [f64; 3] {
    // Values are read as they lie in memory, in whole pixels, so that each lane keeps its channel.
    const PIXELS: usize = 8;
    let mut lanes = [0.0f64; 3 * PIXELS];
    for (largest, stretch) in largest.iter_mut().zip(pixels.chunks(STRETCH)) {
        let mut top = [0.0f32; 3 * PIXELS];
        let (groups, others) = stretch.as_flattened().as_chunks::<{ 3 * PIXELS }>();
        for group in groups {
            for lane in 0..3 * PIXELS {
                lanes[lane] += f64::from(group[lane]);
                top[lane] = if group[lane] > top[lane] { group[lane] } else { top[lane] };
            }
        }
        for (lane, &value) in others.iter().enumerate() {
            lanes[lane] += f64::from(value);
            top[lane] = top[lane].max(value);
        }
        *largest = top.into_iter().fold(0.0, f32::max);
    }
    let mut sum = [0.0; 3];
    for pixel in lanes.as_chunks::<3>().0 {
        for channel in 0..3 {
            sum[channel] += pixel[channel];
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_summed_and_stretches_have_their_largest_value() {
        for columns in [1, 7, 8, 63, 64, 65, 360] {
            let value = |index: usize| (index * 7919 % 1000) as f32;
            let pixels: Vec<[f32; 3]> =
                (0..columns).map(|column| [0, 1, 2].map(|channel| value(3 * column + channel))).collect();
            let mut largest = vec![-1.0; columns.div_ceil(STRETCH)];
            let sum = sum_and_largest(&pixels, &mut largest);
            let of_channel =
                |channel: usize| pixels.iter().map(|pixel| f64::from(pixel[channel])).sum::<f64>();
            assert_eq!(sum, [0, 1, 2].map(of_channel), "{columns}");
            for (largest, stretch) in largest.iter().zip(pixels.chunks(STRETCH)) {
                let expected = stretch.as_flattened().iter().copied().fold(0.0, f32::max);
                assert_eq!(*largest, expected, "{columns}");
            }
        }
    }
}
