//! Dominant peaks apart: the Moon, the sun, a lamp as a light of its own (METHODS section 6).
//!
//! In the cell of a site a small source is averaged with the sky about it: the light's direction is pulled towards the
//! middle of the cell, by more as the source grows dim. Here connected pixels above a threshold give what they have
//! *above* it to a light in a slot that is kept for peaks; up to the threshold they stay in the map. Giving away whole
//! pixels instead would move the light by jumps as pixels cross the threshold: on the Moon behind passing cloud, over
//! 0.5-degree pixels, up to 0.13 degrees instead of 0.03.

use super::Light;
use super::refine::Share;
use crate::error::{Error, Result};
use crate::image::{PolarMap, PolarShape, luminance_f64};
use crate::math::angle_between;
use glam::DVec3;
use serde::Deserialize;
use std::f64::consts::PI;
use std::ops::Range;

/// What counts as a peak, and how many lights are kept for them.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct PeakOptions {
    /// Lights that are kept for peaks, the first ones of the list; fewer than there are lights. 0: no peak is taken
    /// apart.
    pub slots: usize,
    /// Luminance above which a pixel belongs to a peak, in mean luminances of the map; above 1.
    pub threshold: f64,
}

impl Default for PeakOptions {
    /// No slots; a threshold that clears a hazy sky's glow about the Moon (3 to 5 serve equally well there).
    fn default() -> Self {
        Self { slots: 0, threshold: 4.0 }
    }
}

impl PeakOptions {
    /// # Errors
    /// `Usage`, naming the key: no light is left for the rest of the map, or a threshold that is not finite and
    /// above 1.
    pub(super) fn check(&self, count: usize) -> Result<()> {
        if self.slots >= count {
            return Err(Error::usage(format!(
                "peaks.slots: {} of {count} lights leave none for the rest of the map; give fewer",
                self.slots
            )));
        }
        if !(self.threshold > 1.0 && self.threshold.is_finite()) {
            return Err(Error::usage(format!(
                "peaks.threshold: {} must be above 1, in mean luminances of the map",
                self.threshold
            )));
        }
        Ok(())
    }
}

/// RMS angle about its direction up to which a component is one source and not a bright part of the sky.
const SPREAD_MAX_RAD: f64 = 4.0 * PI / 180.0;

/// Largest step of a peak from one frame to the next.
const STEP_MAX_RAD: f64 = 6.0 * PI / 180.0;

/// How much brighter than a peak that has a slot another must be to take its place among the brightest.
const STAYING_FACTOR: f64 = 2.0;

/// A slot whose peak is gone rests so long before another may have it, three lengths of the default filter, so that
/// the filter never leads one light from the old peak to the new.
const REST_S: f64 = 1.0;

/// Takes the peaks of one map after another apart.
#[derive(Clone, Debug)]
pub(super) struct Peaks {
    shape: PolarShape,
    threshold: f64,
    slots: Vec<Slot>,
    /// The map without its peaks.
    rest: PolarMap,
    is_open: Vec<bool>,
    /// Pixels to visit, and those of all components one after another.
    stack: Vec<usize>,
    members: Vec<usize>,
    found: Vec<Peak>,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    /// Of its last peak.
    direction: DVec3,
    share: Share,
    /// Frames since it had a peak; `None` if it never had one.
    idle_frames: Option<u64>,
}

#[derive(Clone, Debug)]
struct Peak {
    share: Share,
    direction: DVec3,
    members: Range<usize>,
    rank: f64,
}

impl Peaks {
    /// For maps of one shape; options that were checked.
    pub(super) fn new(shape: PolarShape, options: &PeakOptions) -> Self {
        let empty = Slot { direction: DVec3::Y, share: Share::default(), idle_frames: None };
        Self {
            shape,
            threshold: options.threshold,
            slots: vec![empty; options.slots],
            rest: PolarMap::black(shape),
            is_open: vec![false; shape.len()],
            // As much as any map can need: nothing is allocated later.
            stack: Vec::with_capacity(shape.len()),
            members: Vec::with_capacity(shape.len()),
            found: Vec::with_capacity(options.slots + 1),
        }
    }

    /// Takes the light of the peaks into the slots and gives the rest of the map. Power and colour stay what they were:
    /// peaks and rest add up to the map.
    pub(super) fn step(&mut self, map: &PolarMap) -> &PolarMap {
        self.rest.stamp = map.stamp;
        self.rest.pixels.clone_from(&map.pixels);
        for slot in &mut self.slots {
            slot.share = Share::default();
            slot.idle_frames = slot.idle_frames.map(|frames| frames + 1);
        }
        let limit = self.threshold * mean_luminance(map);
        self.find(limit);
        // Known peaks first: a new one must not take a slot that a fainter peak is about to claim.
        self.found.retain(|peak| {
            let known = nearest(&mut self.slots, peak.direction);
            known.map(|slot| slot.take(peak, &mut self.rest, &self.members, limit)).is_none()
        });
        let rest_frames = (REST_S * map.stamp.frame_rate_hz).ceil() as u64;
        for peak in &self.found {
            let free = self.slots.iter_mut().find(|slot| slot.idle_frames.is_none_or(|n| n > rest_frames));
            if let Some(slot) = free {
                slot.take(peak, &mut self.rest, &self.members, limit);
            }
        }
        &self.rest
    }

    /// One light for each slot, ids from 0; without power towards its last peak (before there was one, +Y).
    pub(super) fn lights(&self) -> impl Iterator<Item = Light> {
        let light =
            |(id, slot): (usize, &Slot)| slot.share.light(id as u32, slot.direction.as_vec3().to_array());
        self.slots.iter().enumerate().map(light)
    }

    /// Fills `found` with the brightest compact components, at most one a slot, brightest first.
    fn find(&mut self, limit: f64) {
        self.found.clear();
        self.members.clear();
        for (is_open, &pixel) in self.is_open.iter_mut().zip(&self.rest.pixels) {
            // A map without light has none above its mean of 0.
            *is_open = luminance_f64(pixel.map(f64::from)) > limit;
        }
        for start in 0..self.is_open.len() {
            if !self.is_open[start] {
                continue;
            }
            let first = self.members.len();
            self.collect(start);
            let members = first..self.members.len();
            let mut share = Share::default();
            for &index in &self.members[members.clone()] {
                share.add(&excess(&self.rest, index, limit));
            }
            let flux = luminance_f64(share.flux);
            let direction = share.moment.normalize_or(DVec3::Y);
            if share.moment.length() < SPREAD_MAX_RAD.cos() * flux {
                continue;
            }
            let is_known = nearest(&mut self.slots, direction).is_some();
            let rank = if is_known { STAYING_FACTOR * flux } else { flux };
            let place = self.found.partition_point(|peak| peak.rank >= rank);
            self.found.insert(place, Peak { share, direction, members, rank });
            self.found.truncate(self.slots.len());
        }
    }

    /// Appends to `members` the open pixels that hang together with `start` (eight neighbours), and closes them. The
    /// map is closed in azimuth, and all pixels at a pole touch each other.
    fn collect(&mut self, start: usize) {
        let PolarShape { columns, rows, theta_max_rad } = self.shape;
        self.stack.clear();
        self.stack.push(start);
        self.is_open[start] = false;
        let mut is_pole_done = [false; 2];
        while let Some(index) = self.stack.pop() {
            self.members.push(index);
            let (row, column) = (index / columns, index % columns);
            let mut visit = |neighbour: usize| {
                if std::mem::replace(&mut self.is_open[neighbour], false) {
                    self.stack.push(neighbour);
                }
            };
            for r in row.saturating_sub(1)..(row + 2).min(rows) {
                for c in [column + columns - 1, column, column + 1] {
                    visit(r * columns + c % columns);
                }
            }
            let is_polar = [row == 0, row + 1 == rows && theta_max_rad >= PI];
            for (is_polar, is_done) in is_polar.into_iter().zip(&mut is_pole_done) {
                if is_polar && !std::mem::replace(is_done, true) {
                    (row * columns..(row + 1) * columns).for_each(&mut visit);
                }
            }
        }
    }
}

impl Slot {
    fn take(&mut self, peak: &Peak, rest: &mut PolarMap, members: &[usize], limit: f64) {
        (self.direction, self.share, self.idle_frames) = (peak.direction, peak.share, Some(0));
        for &index in &members[peak.members.clone()] {
            let pixel = &mut rest.pixels[index];
            let kept = limit / luminance_f64(pixel.map(f64::from));
            *pixel = pixel.map(|value| (f64::from(value) * kept) as f32);
        }
    }
}

/// The slot whose last peak, not yet found again, is nearest to a direction and within a step of it.
fn nearest(slots: &mut [Slot], direction: DVec3) -> Option<&mut Slot> {
    let angle = |slot: &Slot| angle_between(slot.direction, direction);
    slots
        .iter_mut()
        .filter(|slot| slot.idle_frames.is_some() && luminance_f64(slot.share.flux) == 0.0)
        .filter(|slot| angle(slot) <= STEP_MAX_RAD)
        .min_by(|a, b| angle(a).total_cmp(&angle(b)))
}

/// What a pixel has above the limit.
fn excess(map: &PolarMap, index: usize, limit: f64) -> Share {
    let (row, column) = (index / map.shape.columns, index % map.shape.columns);
    let rgb = map.pixels[index].map(f64::from);
    let luminance = luminance_f64(rgb);
    let solid_angle = map.shape.pixel_solid_angle(row);
    Share {
        flux: rgb.map(|value| value * (1.0 - limit / luminance) * solid_angle),
        moment: map.shape.pixel_direction(row, column) * ((luminance - limit) * solid_angle),
    }
}

fn mean_luminance(map: &PolarMap) -> f64 {
    let (mut flux, mut solid_angle) = (0.0, 0.0);
    for (row, pixels) in map.pixels.chunks_exact(map.shape.columns).enumerate() {
        let of_pixel = map.shape.pixel_solid_angle(row);
        flux += of_pixel * pixels.iter().map(|pixel| luminance_f64(pixel.map(f64::from))).sum::<f64>();
        solid_angle += of_pixel * pixels.len() as f64;
    }
    flux / solid_angle
}

#[cfg(test)]
mod tests;
