//! Dominant peaks: the sun, the Moon, a lamp as lights of their own (METHODS section 6).
//!
//! In the cell of a site a small source is averaged with the sky about it: the light's direction is pulled towards the
//! middle of the cell, by more as the source grows dim, and a strong one draws many sites to itself. Here connected
//! pixels above a limit give what they have *above* it to a light of their own; up to the limit they stay in the map.
//! Giving away whole pixels instead would move the light by jumps as pixels cross the limit: on the Moon behind passing
//! cloud, over 0.5-degree pixels, up to 0.13 degrees instead of 0.03.

use super::components::collect;
use super::refine::Share;
use crate::image::{PolarMap, PolarShape, luminance, luminance_f64};
use crate::math::angle_between;
use glam::DVec3;
use std::f64::consts::PI;
use std::ops::Range;

/// Luminance above which a pixel may belong to a peak, in mean luminances of the map. It clears a hazy sky's glow about
/// the Moon, where 3 to 5 serve equally well.
const LIMIT: f64 = 4.0;

/// Up to which RMS angle about its direction a component is one source for any number of lights ...
const LEAST_SPREAD_MAX_RAD: f64 = PI / 180.0;
/// ... and in spreads of an even cell of the hemisphere, which is 1 / sqrt(n) for n lights: a wider source is better
/// shared by several lights.
const SPREAD_MAX_OF_CELL: f64 = 0.25;

/// A peak holds this many equal shares of the map's power, or this part of it if that is less ...
const SHARES: f64 = 16.0;
const PART_OF_POWER: f64 = 0.125;
/// ... or it holds this many equal shares, and this part of all that the map has above the limit: the one Moon over a
/// hazy sky, which may hold a thousandth of the light, but not the lamps of a hall, which would come and go as they
/// flicker.
const LEAST_SHARES: f64 = 1.0 / 64.0;
const PART_OF_EXCESS: f64 = 0.5;

/// By how much a peak that is known may fall short of all this, so that it does not come and go.
const EASE: f64 = 2.0;

/// Largest step of a peak from one frame to the next.
pub(super) const STEP_MAX_RAD: f64 = 6.0 * PI / 180.0;

/// Finds the peaks of one map after another.
#[derive(Clone, Debug)]
pub(super) struct Peaks {
    shape: PolarShape,
    light_count: usize,
    most: usize,
    /// The map without its peaks, where it has any.
    rest: PolarMap,
    is_open: Vec<bool>,
    /// Pixels to visit, and those of all peaks one after another.
    stack: Vec<usize>,
    members: Vec<usize>,
    found: Vec<Peak>,
}

/// One of them.
#[derive(Clone, Debug)]
pub(super) struct Peak {
    /// What it has above the limit.
    pub(super) share: Share,
    /// Where to, a unit vector.
    pub(super) direction: DVec3,
    flux: f64,
    members: Range<usize>,
}

impl Peaks {
    /// For maps of one shape and lists of so many lights, of which at most an eighth are peaks.
    pub(super) fn new(shape: PolarShape, light_count: usize) -> Self {
        let most = light_count / 8;
        Self {
            shape,
            light_count,
            most,
            rest: PolarMap::black(shape),
            is_open: vec![false; shape.len()],
            // As much as any map can need: nothing is allocated later.
            stack: Vec::with_capacity(shape.len()),
            members: Vec::with_capacity(shape.len()),
            found: Vec::with_capacity(most + 1),
        }
    }

    /// The peaks of the map, brightest first, and the map without them: together they are the map, in power and colour.
    /// `is_known` says whether there was one in about a direction in the last frame.
    pub(super) fn find<'a>(
        &'a mut self,
        map: &'a PolarMap,
        is_known: impl Fn(DVec3) -> bool,
    ) -> (&'a [Peak], &'a PolarMap) {
        self.found.clear();
        self.members.clear();
        let (power, mean) = power_and_mean(map);
        let limit = LIMIT * mean;
        let excess = self.open(map, limit);
        let least = Least::new(self.light_count, power, excess);
        // Less than this is no peak at all, whatever pixels it is made of.
        if self.most == 0 || excess < least.known_flux() {
            return (&[], map);
        }
        for start in 0..self.is_open.len() {
            if self.is_open[start] {
                self.consider(map, start, limit, &least, &is_known);
            }
        }
        if self.found.is_empty() {
            return (&[], map);
        }
        self.rest.stamp = map.stamp;
        self.rest.pixels.clone_from(&map.pixels);
        for peak in &self.found {
            for &index in &self.members[peak.members.clone()] {
                let pixel = &mut self.rest.pixels[index];
                let kept = limit / luminance_f64(pixel.map(f64::from));
                *pixel = pixel.map(|value| (f64::from(value) * kept) as f32);
            }
        }
        (&self.found, &self.rest)
    }

    /// Opens the pixels above the limit and gives the luminous power that they have above it.
    fn open(&mut self, map: &PolarMap, limit: f64) -> f64 {
        let mut excess = 0.0;
        let columns = self.shape.columns;
        let rows = self.is_open.chunks_exact_mut(columns).zip(map.pixels.chunks_exact(columns));
        for (row, (is_open, pixels)) in rows.enumerate() {
            let mut above = 0.0;
            for (is_open, &pixel) in is_open.iter_mut().zip(pixels) {
                let luminance = f64::from(luminance(pixel));
                // A map without light has none above its mean of 0.
                *is_open = luminance > limit;
                above += (luminance - limit).max(0.0);
            }
            excess += above * self.shape.pixel_solid_angle(row);
        }
        excess
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
        collect(self.shape, start, close, &mut self.stack, &mut self.members);
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

    /// Whether a component of some flux and first moment is a peak. NaN, of radiances near the largest, is none.
    fn allows(&self, flux: f64, moment: f64, is_known: impl FnOnce() -> bool) -> bool {
        let is = |least_flux: f64, cos_spread: f64| {
            flux > 0.0 && flux >= least_flux && moment >= cos_spread * flux
        };
        // A starry sky has thousands of components that would not do in either case.
        is(self.flux, self.cos_spread) || (is(self.known_flux(), self.cos_known_spread) && is_known())
    }
}

/// Whether a peak in direction `a` may be the one that was in direction `b` a frame ago.
pub(super) fn is_a_step(a: DVec3, b: DVec3) -> bool {
    angle_between(a, b) <= STEP_MAX_RAD
}

/// What a pixel has above the limit.
fn excess_of(map: &PolarMap, index: usize, limit: f64) -> Share {
    let (row, column) = (index / map.shape.columns, index % map.shape.columns);
    let rgb = map.pixels[index].map(f64::from);
    let luminance = luminance_f64(rgb);
    let solid_angle = map.shape.pixel_solid_angle(row);
    Share {
        flux: rgb.map(|value| value * (1.0 - limit / luminance) * solid_angle),
        moment: map.shape.pixel_direction(row, column) * ((luminance - limit) * solid_angle),
    }
}

/// Luminous power and mean luminance.
fn power_and_mean(map: &PolarMap) -> (f64, f64) {
    let (mut power, mut solid_angle) = (0.0, 0.0);
    for (row, pixels) in map.pixels.chunks_exact(map.shape.columns).enumerate() {
        let of_pixel = map.shape.pixel_solid_angle(row);
        power += of_pixel * pixels.iter().map(|&pixel| f64::from(luminance(pixel))).sum::<f64>();
        solid_angle += of_pixel * pixels.len() as f64;
    }
    (power, power / solid_angle)
}
