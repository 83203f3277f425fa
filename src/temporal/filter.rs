//! The FIR over light lists: each slot's power, direction and spread, and the reference irradiances.

use super::energy::EnergyFilter;
use super::history::History;
use super::{FilterOptions, Taps, design};
use crate::error::Result;
use crate::image::Stamp;
use crate::light::LightList;
use crate::light::error::ListError;
use glam::DVec3;
use std::f64::consts::PI;

/// Length of the weighted sum of unit vectors below which it says nothing about where the light is: a jitter of
/// the input is then more than ten times as large in the output.
const LEAST_VECTOR: f64 = 0.1;

/// Filters the lists of one sequence.
///
/// - *Power* (RGB irradiance of every slot) and the *reference irradiances*, so that a filtered list is judged
///   against the equally filtered truth, pass the taps as energies: what leaves is >= 0, and in total as much
///   leaves as came in, per colour channel of the list. What clipping a light at zero would add is taken from
///   what other lights have above their steady level, then from the following frames.
/// - *Direction*: the weighted sum of the unit vectors, normalised; where they nearly cancel (sum shorter than
///   0.1), the direction at the centre tap.
/// - *Spread*: the weighted sum of the angles, limited to [0, pi]; it is no energy, so nothing is carried over.
///
/// The filter starts with a history full of the first list, as if that had always been there, so lists leave from
/// the first frame on. A list carries the stamp and the ids of the newest input and
/// [`LightList::filter_delay_frames`]; where nothing is filtered (see [`design`]) it is a copy of the input and
/// that number is 0.
///
/// **Gaps.** Where `lost_before` frames are missing, up to the number of taps, the last list is held for as many.
/// After a longer gap, when capture times run backwards, and when the frame rate, the number of lights or the
/// number of reference irradiances changes, the filter starts afresh: history filled with the new list, no debts.
/// Equal capture times are no reason to start afresh.
///
/// Allocates only when the frame rate or one of these numbers changes.
#[derive(Clone, Debug)]
pub struct LightFilter {
    options: FilterOptions,
    taps: Taps,
    last: Option<Stamp>,
    light_count: usize,
    /// Rows: R of every light, G, B, reference irradiances; then x, y, z of every light; then the spreads.
    history: History,
    energies: EnergyFilter,
    energy_count: usize,
    /// Weighted sums of the columns behind the energies.
    sums: Vec<f64>,
    error: ListError,
}

impl LightFilter {
    /// A filter that has seen nothing.
    ///
    /// # Errors
    /// Kind `Usage`, naming the key, for values that [`FilterOptions::check`] refuses.
    pub fn new(options: &FilterOptions) -> Result<Self> {
        options.check()?;
        Ok(Self {
            options: *options,
            taps: Taps::identity(),
            last: None,
            light_count: 0,
            history: History::default(),
            energies: EnergyFilter::default(),
            energy_count: 0,
            sums: Vec::new(),
            error: ListError::new(),
        })
    }

    /// Takes the next list of the sequence and writes the filtered one.
    ///
    /// # Errors
    /// Those of [`design`], when the first list or a new frame rate asks for a filter that cannot be made; the
    /// next list is then taken as the first.
    pub fn step(&mut self, list: &LightList, filtered: &mut LightList) -> Result<()> {
        filtered.copy_from(list);
        if self.continues(list) {
            for _ in 0..list.stamp.lost_before {
                self.history.repeat();
                self.energies.step(&self.history);
            }
            write_row(list, self.history.push());
        } else {
            self.start(list)?;
        }
        self.last = Some(list.stamp);
        filtered.filter_delay_frames = self.taps.delay_frames();
        if self.taps.order() > 0 {
            self.write_energies(filtered);
            self.write_directions_and_spreads(filtered);
            filtered.power = filtered.sum_of_lights();
        }
        self.error.measure(filtered);
        Ok(())
    }

    /// Whether `list` follows the lists seen so far; otherwise the filter starts afresh.
    fn continues(&self, list: &LightList) -> bool {
        let Some(last) = self.last else { return false };
        last.frame_rate_hz.to_bits() == list.stamp.frame_rate_hz.to_bits()
            && list.stamp.capture_time_ns >= last.capture_time_ns
            && list.stamp.lost_before <= self.taps.as_slice().len() as u64
            && list.lights.len() == self.light_count
            && energy_count(list) == self.energy_count
    }

    fn start(&mut self, list: &LightList) -> Result<()> {
        let last = self.last.take();
        let same_rate =
            last.is_some_and(|last| last.frame_rate_hz.to_bits() == list.stamp.frame_rate_hz.to_bits());
        let same_size = list.lights.len() == self.light_count && energy_count(list) == self.energy_count;
        if !(same_rate && same_size) {
            self.taps = design(list.stamp.frame_rate_hz, &self.options)?;
            self.light_count = list.lights.len();
            self.energy_count = energy_count(list);
            let behind = 4 * self.light_count;
            self.history = History::new(self.taps.as_slice().len(), self.energy_count + behind);
            // One debt a channel for all lights, one for every reference irradiance.
            let references = std::iter::repeat_n(1, list.reference_irradiance.len());
            let groups = [self.light_count; 3].into_iter().chain(references);
            self.energies = EnergyFilter::new(self.taps.as_slice(), groups);
            self.sums = vec![0.0; behind];
        }
        self.energies.clear();
        write_row(list, self.history.newest_mut());
        for _ in 0..self.taps.order() {
            self.history.repeat();
        }
        Ok(())
    }

    fn write_energies(&mut self, filtered: &mut LightList) {
        let out = self.energies.step(&self.history);
        // The overshoot of the largest f32 would become infinity.
        let stored = |value: f64| value.min(f64::from(f32::MAX)) as f32;
        let (powers, references) = out.split_at(3 * self.light_count);
        for (slot, light) in filtered.lights.iter_mut().enumerate() {
            light.irradiance = [0, 1, 2].map(|channel| stored(powers[channel * self.light_count + slot]));
        }
        for (reference, &value) in filtered.reference_irradiance.iter_mut().zip(references) {
            *reference = stored(value);
        }
    }

    fn write_directions_and_spreads(&mut self, filtered: &mut LightList) {
        self.sums.fill(0.0);
        for (age, &tap) in self.taps.as_slice().iter().enumerate() {
            for (sum, &value) in self.sums.iter_mut().zip(&self.history.row(age)[self.energy_count..]) {
                *sum += tap * f64::from(value);
            }
        }
        let (vectors, spreads) = self.sums.split_at(3 * self.light_count);
        let centre = &self.history.row(self.taps.order() / 2)[self.energy_count..];
        let lights = filtered.lights.iter_mut().zip(centre.chunks_exact(3));
        for ((light, centre), (sum, &spread)) in lights.zip(vectors.chunks_exact(3).zip(spreads)) {
            let sum = DVec3::from_slice(sum);
            let length = sum.length();
            light.direction = if length >= LEAST_VECTOR {
                (sum / length).as_vec3().to_array()
            } else {
                [centre[0], centre[1], centre[2]]
            };
            light.spread_rad = spread.clamp(0.0, PI) as f32;
        }
    }
}

fn energy_count(list: &LightList) -> usize {
    3 * list.lights.len() + list.reference_irradiance.len()
}

/// Lays a list out as one row of the history.
///
/// Lists are finite, >= 0 and of unit directions by contract. One number that is not would stay in the history for
/// the length of the filter and in a debt for ever, so it is taken as no light, or as the direction +Y.
fn write_row(list: &LightList, row: &mut [f32]) {
    let lawful = |value: f32| if (0.0..f32::INFINITY).contains(&value) { value } else { 0.0 };
    let count = list.lights.len();
    let (powers, rest) = row.split_at_mut(3 * count);
    let (references, rest) = rest.split_at_mut(list.reference_irradiance.len());
    let (vectors, spreads) = rest.split_at_mut(3 * count);
    for (slot, light) in list.lights.iter().enumerate() {
        for channel in 0..3 {
            powers[channel * count + slot] = lawful(light.irradiance[channel]);
        }
        let points_somewhere =
            light.direction.iter().all(|value| value.is_finite()) && light.direction != [0.0; 3];
        let direction = if points_somewhere { light.direction } else { [0.0, 1.0, 0.0] };
        vectors[3 * slot..3 * slot + 3].copy_from_slice(&direction);
        spreads[slot] = lawful(light.spread_rad);
    }
    for (reference, &value) in references.iter_mut().zip(&list.reference_irradiance) {
        *reference = lawful(value);
    }
}

#[cfg(test)]
mod tests;
