//! Lights for all kinds of sequences, without a setting for each kind: persistent lights, with dominant peaks
//! kept apart and idle lights moved to where they help.
//!
//! A slot of the list is a *site*, whose light is that of its cell of the map, or a *peak*, or it rests and
//! has no power. Sites are the last frame's light directions (METHODS section 6, persistent lights): frame by
//! frame they relax, as in Lloyd's algorithm. A new peak takes the slot of the site nearest to it, which has
//! held its light so far; when the peak is gone, the slot becomes a site again, in the same direction. So no
//! light is reserved for peaks that a scene may not have.
//!
//! Relaxation alone depends on where it began: after a cut, sites crowd where there was light before. In
//! every frame a few sites, those whose removal costs least, may be taken to split the cells that gain most,
//! if the gain is well above the loss (as in the enhanced LBG algorithm of Patane and Russo 2001). Both are
//! measured by *distortion*: that of a cell of flux F and first moment V is `F - |V|`, the integral of `1 -
//! cos a` with a the angle from its light. Several sites move together, after a cut or another change that
//! makes several moves worthwhile: a light that hands over its power is visible, if faintly, for the length
//! of the filter, and a scene that has not changed is better left as it is.
//!
//! Where fewer lights are wanted, those whose removal costs least rest; they come back to split the widest
//! cells.

use super::Light;
use super::peaks::{Peak, Peaks, Rest, is_a_step};
use super::refine::Share;
use crate::image::{PolarMap, PolarShape};
use glam::{DVec3, Vec3};

/// Number of slots for each one that may be moved in a frame, and the most that are moved.
const SLOTS_PER_MOVE: usize = 8;
const MOST_MOVES: usize = 256;
/// Number of slots for each of the moves that must be worthwhile together. A single move among lamps that
/// flicker at 9.5 Hz makes the filtered lists flicker five times as much for the length of the filter.
const SLOTS_PER_LEAST_MOVE: usize = 32;

/// Part of the distortion of an even disc that is gained by splitting it into halves: their centroids are 4 r
/// / 3 pi from its centre, and its mean square radius is r^2 / 2.
const SPLIT_GAIN: f64 = 0.36;

/// Factor by which the gain of a move must exceed its loss.
const WORTH: f64 = 8.0;

/// How long a slot rests before it may come back elsewhere: longer than the default filter at any frame rate
/// (which a test of the module `temporal` checks), so that no filtered light moves from one direction to
/// another. With a filter longer than the default, a light would move across for the rest of the filter's
/// length, with fading power.
pub(crate) const REST_S: f64 = 0.4;

/// Follows one sequence of maps.
#[derive(Clone, Debug)]
pub(super) struct Adaptive {
    slots: Vec<Slot>,
    peaks: Peaks,
    /// How many slots should be sites or peaks.
    wanted: usize,
    /// How many were in the last list.
    used: usize,
    /// Whether the slots are those of a frame that had light.
    is_seeded: bool,
    /// The directions of the slots that are sites, and those slots.
    sites: Vec<[f32; 3]>,
    site_slots: Vec<usize>,
    candidates: Vec<Candidate>,
    new_peaks: Vec<usize>,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    direction: [f32; 3],
    role: Role,
    share: Share,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Role {
    Site,
    Peak,
    /// Holds how many frames it has rested.
    Rest(u64),
}

/// A slot that may be moved, or whose cell may be split.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    slot: usize,
    distortion: f64,
}

impl Adaptive {
    /// For maps of one shape and `count` lights.
    pub(super) fn new(shape: PolarShape, count: usize) -> Self {
        Self {
            slots: Vec::with_capacity(count),
            peaks: Peaks::new(shape, count),
            wanted: count,
            used: count,
            is_seeded: false,
            sites: Vec::with_capacity(count),
            site_slots: Vec::with_capacity(count),
            candidates: Vec::with_capacity(count),
            new_peaks: Vec::with_capacity(count),
        }
    }

    /// Sets how many lights should be used from the next frame on, at most as many as there are slots.
    pub(super) fn want(&mut self, lights: usize) {
        self.wanted = lights;
    }

    /// How many lights of the last list were used.
    pub(super) fn used(&self) -> usize {
        self.used
    }

    /// Writes the lights of the next map, one per slot. Their sum is the RGB power of the map.
    ///
    /// `seed` fills its vector with a site for each slot; it is called until a map has light. `shares` sums
    /// the map without its peaks over the cells of the sites.
    pub(super) fn step<'a>(
        &mut self,
        map: &PolarMap,
        seed: impl FnOnce(&PolarMap, &mut Vec<[f32; 3]>),
        shares: impl FnOnce(Rest, &[[f32; 3]]) -> &'a [Share],
        lights: &mut Vec<Light>,
    ) {
        let slots = &self.slots;
        let is_known = |at: DVec3| {
            slots.iter().any(|slot| slot.role == Role::Peak && is_a_step(slot.direction_f64(), at))
        };
        let (peaks, rest) = self.peaks.find(map, is_known);
        if !self.is_seeded {
            seed(&rest.to_map(), &mut self.sites);
            self.slots.clear();
            let site = |&direction| Slot { direction, role: Role::Site, share: Share::default() };
            self.slots.extend(self.sites.iter().map(site));
            // Peaks take the first slots, so that short prefixes have them: no site has held their light so
            // far.
            for (slot, peak) in self.slots.iter_mut().zip(peaks) {
                slot.take(peak);
            }
        } else {
            follow(&mut self.slots, peaks, &mut self.new_peaks);
        }
        self.sites.clear();
        self.site_slots.clear();
        self.used = self.slots.len();
        for (number, slot) in self.slots.iter_mut().enumerate() {
            match &mut slot.role {
                Role::Site => {
                    self.sites.push(slot.direction);
                    self.site_slots.push(number);
                }
                Role::Peak => {}
                Role::Rest(frames) => {
                    *frames += 1;
                    self.used -= 1;
                    slot.share = Share::default();
                }
            }
        }
        for (&slot, &share) in self.site_slots.iter().zip(shares(rest, &self.sites)) {
            self.slots[slot].share = share;
        }
        lights.clear();
        let of_slot = |(id, slot): (usize, &Slot)| slot.share.light(id as u32, slot.direction);
        lights.extend(self.slots.iter().enumerate().map(of_slot));
        for (slot, light) in self.slots.iter_mut().zip(lights) {
            slot.direction = light.direction;
            self.is_seeded |= light.irradiance != [0.0; 3];
        }
        if self.is_seeded {
            // With an unknown frame rate, slots rest for one frame.
            self.arrange(((REST_S * map.stamp.frame_rate_hz).ceil() as u64).max(1));
        }
    }

    /// Takes the sites whose removal costs least, and splits the widest cells with slots that have rested,
    /// for the next frame.
    fn arrange(&mut self, rest_frames: u64) {
        self.candidates.clear();
        self.candidates.extend(self.site_slots.iter().map(|&slot| {
            let share = &self.slots[slot].share;
            let (flux, distortion) = (share.luminous_flux(), share.luminous_flux() - share.moment.length());
            // Below this part of the flux the distortion is rounding: the light comes from a single pixel.
            Candidate { slot, distortion: if distortion > 1e-9 * flux { distortion } else { 0.0 } }
        }));
        self.candidates.sort_unstable_by(Candidate::order);
        let most = (self.slots.len() / SLOTS_PER_MOVE).clamp(1, MOST_MOVES);
        // At most half may be taken, from one end of the order; the widest are at the other.
        let spare_count = (2 * most).min(self.candidates.len() / 2);
        let (spare, rest) = self.candidates.split_at_mut(spare_count);

        let used = self.used;
        let wanted = self.wanted.min(self.slots.len());
        let mut wide = rest.iter().rev().filter(|wide| wide.distortion > 0.0);
        // Slots that have rested come back where more are wanted; the others continue to rest.
        let rested = |slot: &Slot| matches!(slot.role, Role::Rest(frames) if frames >= rest_frames);
        let mut more = wanted.saturating_sub(used).min(most);
        for number in 0..self.slots.len() {
            if more > 0 && rested(&self.slots[number]) {
                let Some(wide) = wide.next() else { break };
                split(&mut self.slots, wide, number);
                more -= 1;
            }
        }
        let fewer = used.saturating_sub(wanted).min(most).min(spare.len());
        let least = (self.slots.len() / SLOTS_PER_LEAST_MOVE).max(2);
        // NaN, which comes from radiances near the largest f32, is never worthwhile.
        let is_worth = |(spare, wide): &(&Candidate, &Candidate)| {
            SPLIT_GAIN * wide.distortion > WORTH * spare.distortion
        };
        // A cell's distortion is a first estimate of its loss: where nothing has changed, too few moves are
        // worthwhile by it, and the losses, each of which takes a pass over all sites, need not be computed.
        if fewer == 0 && spare.iter().zip(wide.clone()).take_while(is_worth).count() < least {
            return;
        }
        for candidate in &mut *spare {
            candidate.distortion = loss(&self.slots, &self.site_slots, candidate.slot);
        }
        spare.sort_unstable_by(Candidate::order);
        let (resting, spare) = spare.split_at(fewer);
        for candidate in resting {
            self.slots[candidate.slot].role = Role::Rest(0);
        }
        let moves = spare.iter().zip(wide).take(most).take_while(is_worth);
        if moves.clone().count() >= least {
            moves.for_each(|(spare, wide)| split(&mut self.slots, wide, spare.slot));
        }
    }
}

impl Candidate {
    fn order(a: &Self, b: &Self) -> std::cmp::Ordering {
        a.distortion.total_cmp(&b.distortion).then(a.slot.cmp(&b.slot))
    }
}

impl Slot {
    fn take(&mut self, peak: &Peak) {
        *self = Self { direction: unit(peak.direction), role: Role::Peak, share: peak.share };
    }

    fn direction_f64(&self) -> DVec3 {
        DVec3::from(self.direction.map(f64::from))
    }
}

fn unit(direction: DVec3) -> [f32; 3] {
    direction.as_vec3().to_array()
}

/// Gives every peak its slot: the one it had as a peak in the last frame, or that of the nearest site, or a
/// resting one where only one site is left, which the rest of the map needs. There are at most an eighth as
/// many peaks as slots. Slots whose peak is gone become sites. `new` is scratch memory.
fn follow(slots: &mut [Slot], peaks: &[Peak], new: &mut Vec<usize>) {
    new.clear();
    // A peak has flux: one whose share is empty has not been found again yet.
    for slot in slots.iter_mut().filter(|slot| slot.role == Role::Peak) {
        slot.share = Share::default();
    }
    for (number, peak) in peaks.iter().enumerate() {
        let is_it = |slot: &Slot| {
            let is_lost = slot.role == Role::Peak && slot.share == Share::default();
            is_lost && is_a_step(slot.direction_f64(), peak.direction)
        };
        match nearest(slots, peak.direction, is_it) {
            Some(slot) => slot.take(peak),
            None => new.push(number),
        }
    }
    for slot in slots.iter_mut() {
        if slot.role == Role::Peak && slot.share == Share::default() {
            slot.role = Role::Site;
        }
    }
    for peak in new.iter().map(|&number| &peaks[number]) {
        let site_count = slots.iter().filter(|slot| slot.role == Role::Site).count();
        let is_eligible = |slot: &Slot| match slot.role {
            Role::Site => site_count > 1,
            Role::Peak => false,
            Role::Rest(_) => site_count <= 1,
        };
        if let Some(slot) = nearest(slots, peak.direction, is_eligible) {
            slot.take(peak);
        }
    }
}

/// The eligible slot that is nearest to a direction.
fn nearest(slots: &mut [Slot], at: DVec3, is_eligible: impl Fn(&Slot) -> bool) -> Option<&mut Slot> {
    let cosine = |slot: &Slot| slot.direction_f64().dot(at);
    let eligible = slots.iter_mut().filter(|slot| is_eligible(slot));
    eligible.max_by(|a, b| cosine(a).total_cmp(&cosine(b)))
}

/// Distortion that is added where the nearest other site takes over a site's flux.
fn loss(slots: &[Slot], site_slots: &[usize], slot: usize) -> f64 {
    let at = Vec3::from(slots[slot].direction);
    let others = site_slots.iter().filter(|&&other| other != slot);
    let nearest = others.map(|&other| Vec3::from(slots[other].direction).dot(at)).fold(-1.0, f32::max);
    slots[slot].share.luminous_flux() * f64::from(1.0 - nearest).max(0.0)
}

/// Splits the cell `wide` into two sites, half its spread to either side of its light: one in its own slot,
/// and one in the slot `other`, on the side where that slot was.
fn split(slots: &mut [Slot], wide: &Candidate, other: usize) {
    let (at, from) = (slots[wide.slot].direction_f64(), slots[other].direction_f64());
    let across = at.cross(from).cross(at).try_normalize().unwrap_or_else(|| at.any_orthonormal_vector());
    let half_spread = (0.5 * wide.distortion / slots[wide.slot].share.luminous_flux()).sqrt();
    let site = |offset: f64| unit((at + across * offset).normalize_or(at));
    slots[wide.slot].direction = site(-half_spread);
    slots[other] = Slot { direction: site(half_spread), role: Role::Site, share: Share::default() };
}

#[cfg(test)]
mod tests;
