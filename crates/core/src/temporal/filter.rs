//! The FIR over light lists: each slot's power, direction and spread, and the reference irradiances.

use super::energy::EnergyFilter;
use super::history::History;
use super::{Directions, Taps};
use crate::image::{Stamp, luminance_f64};
use crate::light::error::ListError;
use crate::light::{LightList, ReferencedList};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// How much of the variance of a light's direction over the window becomes spread. All of it would be the RMS
/// angle of the filtered light about its direction, but the taps put most of the light, 60 %, in one
/// direction and the rest far from it, with either sign: the disc whose shadow edge fits that best, in the
/// mean square, has a quarter to half of the variance, whatever the light's own spread is.
const MOTION_SHARE: f64 = 1.0 / 3.0;

/// Length of the weighted sum of unit vectors below which it says nothing about where the light is: a jitter
/// of the input is then more than ten times as large in the output.
const LEAST_VECTOR: f64 = 0.1;

/// Filters the lists of one sequence.
///
/// - *Power* (RGB irradiance of every slot) and the *reference irradiances*, so that a filtered list is
///   judged against the equally filtered truth, are filtered as energies: the output is >= 0, and in total it
///   equals the input, per colour channel of the list. The power that clipping a light at zero would add is
///   taken from the part of other lights above their steady level, then from the following frames.
/// - *Direction*: the weighted sum of the first moments (luminous flux times mean direction), normalised:
///   this filters the irradiance itself, except where a horizon cuts it, and where a light had no power its
///   direction does not count. Where moments nearly cancel or there are none, or where the options say so, it
///   is the weighted sum of the unit vectors as in the paper; where these nearly cancel too (sum shorter than
///   0.1), it is the direction at the centre tap.
/// - *Spread*: that of the flux about this direction, with a third of the variance that comes from the motion
///   within the window; with the paper's directions it is the weighted sum of the angles, limited to [0, pi].
///
/// The filter starts with a history full of the first list, as if that had always been there, so there is
/// output from the first frame on. A list carries the stamp and the ids of the newest input and
/// [`LightList::filter_delay_frames`]; with [`Taps::identity`] it is a copy of the input and that number
/// is 0.
///
/// **Gaps.** Where `lost_before` frames are missing, up to the number of taps, the last list is held for that
/// many frames. After a longer gap, when capture times run backwards, and when the frame rate, the number of
/// lights or the number of reference irradiances changes, the filter starts afresh: history filled with the
/// new list, no debts. Equal capture times are no reason to start afresh.
///
/// Allocates only with new taps and when one of these numbers changes.
#[derive(Clone, Debug)]
pub struct LightFilter {
    taps: Taps,
    directions: Directions,
    last: Option<Stamp>,
    light_count: usize,
    /// Rows: R of every light, G, B, reference irradiances; then [`Track`] of every light.
    history: History,
    energies: EnergyFilter,
    energy_count: usize,
    sums: Vec<Sums>,
    error: ListError,
}

impl LightFilter {
    /// A filter that has seen nothing.
    pub fn new(taps: Taps, directions: Directions) -> Self {
        Self {
            taps,
            directions,
            last: None,
            light_count: 0,
            history: History::default(),
            energies: EnergyFilter::default(),
            energy_count: 0,
            sums: Vec::new(),
            error: ListError::new(),
        }
    }

    /// Filters with other taps from the next list on, which is taken as the first.
    pub fn set_taps(&mut self, taps: Taps) {
        self.taps = taps;
        self.last = None;
    }

    /// Takes the next list of the sequence and writes the filtered one.
    pub fn step(&mut self, input: &ReferencedList, filtered: &mut ReferencedList) {
        filtered.copy_from(input);
        if self.continues(input) {
            for _ in 0..input.list.stamp.lost_before {
                self.history.repeat();
                self.energies.step(&self.history);
            }
            write_row(input, self.history.push());
        } else {
            self.start(input);
        }
        self.last = Some(input.list.stamp);
        filtered.list.filter_delay_frames = self.taps.delay_frames();
        if self.taps.order() > 0 {
            self.write_energies(filtered);
            self.write_directions_and_spreads(&mut filtered.list);
            filtered.list.power = filtered.list.sum_of_lights();
        }
        self.error.measure(filtered);
    }

    /// Whether `list` follows the lists seen so far; otherwise the filter starts afresh.
    fn continues(&self, input: &ReferencedList) -> bool {
        let Some(last) = self.last else { return false };
        last.frame_rate_hz.to_bits() == input.list.stamp.frame_rate_hz.to_bits()
            && input.list.stamp.capture_time_ns >= last.capture_time_ns
            && input.list.stamp.lost_before <= self.taps.as_slice().len() as u64
            && input.list.lights.len() == self.light_count
            && energy_count(input) == self.energy_count
    }

    fn start(&mut self, input: &ReferencedList) {
        let is_sized = self.last.take().is_some()
            && input.list.lights.len() == self.light_count
            && energy_count(input) == self.energy_count;
        if !is_sized {
            self.light_count = input.list.lights.len();
            self.energy_count = energy_count(input);
            let columns = self.energy_count + TRACK * self.light_count;
            self.history = History::new(self.taps.as_slice().len(), columns);
            // One debt per channel for all lights, and one for every reference irradiance.
            let references = std::iter::repeat_n(1, input.reference_irradiance.len());
            let groups = [self.light_count; 3].into_iter().chain(references);
            self.energies = EnergyFilter::new(self.taps.as_slice(), groups);
            self.sums = vec![Sums::default(); self.light_count];
        }
        self.energies.clear();
        write_row(input, self.history.newest_mut());
        for _ in 0..self.taps.order() {
            self.history.repeat();
        }
    }

    fn write_energies(&mut self, filtered: &mut ReferencedList) {
        let out = self.energies.step(&self.history);
        // The overshoot of the largest f32 would become infinity.
        let stored = |value: f64| value.min(f64::from(f32::MAX)) as f32;
        let (powers, references) = out.split_at(3 * self.light_count);
        for (slot, light) in filtered.list.lights.iter_mut().enumerate() {
            light.irradiance = [0, 1, 2].map(|channel| stored(powers[channel * self.light_count + slot]));
        }
        for (reference, &value) in filtered.reference_irradiance.iter_mut().zip(references) {
            *reference = stored(value);
        }
    }

    fn write_directions_and_spreads(&mut self, filtered: &mut LightList) {
        let tracks = |age: usize| self.history.row(age)[self.energy_count..].as_chunks::<TRACK>().0;
        self.sums.fill(Sums::default());
        for (age, &tap) in self.taps.as_slice().iter().enumerate() {
            for (sums, track) in self.sums.iter_mut().zip(tracks(age)) {
                sums.add(tap, track);
            }
        }
        let by_power = self.directions == Directions::ByPower;
        let centre = tracks(self.taps.order() / 2);
        for (slot, (light, sums)) in filtered.lights.iter_mut().zip(&self.sums).enumerate() {
            let Some(direction) = sums.direction().filter(|_| by_power) else {
                let length = sums.unit.length();
                light.direction = if length >= LEAST_VECTOR {
                    (sums.unit / length).as_vec3().to_array()
                } else {
                    let [x, y, z, ..] = centre[slot];
                    [x, y, z]
                };
                light.spread_rad = sums.spread_rad.clamp(0.0, PI) as f32;
                continue;
            };
            light.direction = direction.as_vec3().to_array();
            let about = DVec3::from(light.direction.map(f64::from));
            let taps = self.taps.as_slice().iter().enumerate();
            let motion: f64 = taps
                .map(|(age, tap)| {
                    let [x, y, z, _, moment, _] = tracks(age)[slot].map(f64::from);
                    // 1 - cos a, which keeps its digits where a is small.
                    tap * moment * 0.5 * (DVec3::new(x, y, z) - about).length_squared()
                })
                .sum();
            let defect = (sums.defect + MOTION_SHARE * motion) / (sums.moment + sums.defect);
            light.spread_rad = (2.0 * (0.5 * defect.clamp(0.0, 1.0)).sqrt().asin()) as f32;
        }
    }
}

/// What is known of a light in a frame besides its power: unit vector, spread in radians, length of the first
/// moment (luminous flux times the cosine of the spread), and by how much the luminous flux exceeds that.
const TRACK: usize = 6;
type Track = [f32; TRACK];

/// Sums over the window, each weighted by the taps.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    unit: DVec3,
    spread_rad: f64,
    vector: DVec3,
    moment: f64,
    defect: f64,
    /// Of the moments' lengths, weighted by the taps' magnitudes.
    magnitude: f64,
}

impl Sums {
    fn add(&mut self, tap: f64, track: &Track) {
        let [x, y, z, spread_rad, moment, defect] = track.map(f64::from);
        let (unit, moment) = (DVec3::new(x, y, z), tap * moment);
        self.unit += tap * unit;
        self.spread_rad += tap * spread_rad;
        self.vector += moment * unit;
        self.moment += moment;
        self.defect += tap * defect;
        self.magnitude += moment.abs();
    }

    /// Direction of the sum of the moments, if it says where the light is.
    fn direction(&self) -> Option<DVec3> {
        let length = self.vector.length();
        let flux = self.moment + self.defect;
        let is_certain = length > LEAST_VECTOR * self.magnitude && flux > LEAST_VECTOR * self.magnitude;
        is_certain.then(|| self.vector / length)
    }
}

fn energy_count(input: &ReferencedList) -> usize {
    3 * input.list.lights.len() + input.reference_irradiance.len()
}

/// Lays a list out as one row of the history.
///
/// By contract lists hold finite numbers >= 0 and unit directions. A number that breaks this would stay in
/// the history for the length of the filter and in a debt for ever, so it is taken as no light, or as the
/// direction +Y.
fn write_row(input: &ReferencedList, row: &mut [f32]) {
    let lawful = |value: f32| if (0.0..f32::INFINITY).contains(&value) { value } else { 0.0 };
    let count = input.list.lights.len();
    let (powers, rest) = row.split_at_mut(3 * count);
    let (references, tracks) = rest.split_at_mut(input.reference_irradiance.len());
    let tracks = tracks.as_chunks_mut::<TRACK>().0;
    for (slot, light) in input.list.lights.iter().enumerate() {
        for channel in 0..3 {
            powers[channel * count + slot] = lawful(light.irradiance[channel]);
        }
        let points_somewhere =
            light.direction.iter().all(|value| value.is_finite()) && light.direction != [0.0; 3];
        let direction = if points_somewhere { light.direction } else { [0.0, 1.0, 0.0] };
        let [x, y, z] = direction;
        let spread_rad = lawful(light.spread_rad);
        let powers = [0, 1, 2].map(|channel| f64::from(powers[channel * count + slot]));
        let flux = luminance_f64(powers);
        // Wider than a right angle the moment would point away from the light.
        let defect = 2.0 * (0.5 * f64::from(spread_rad).min(FRAC_PI_2)).sin().powi(2);
        let stored = |value: f64| value.min(f64::from(f32::MAX)) as f32;
        tracks[slot] = [x, y, z, spread_rad, stored(flux * (1.0 - defect)), stored(flux * defect)];
    }
    for (reference, &value) in references.iter_mut().zip(&input.reference_irradiance) {
        *reference = lawful(value);
    }
}

#[cfg(test)]
mod direction_tests;
#[cfg(test)]
mod tests;
