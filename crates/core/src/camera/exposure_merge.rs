//! Merges frames of one scene, taken at several exposure times, into radiance.
//!
//! Each sample of each exposure is an estimate of the radiance, `L = R(code) / t` with the response R
//! (radiance at 1 s), and is weighted by the inverse of its variance: that of the code's noise, scaled by the
//! slope of the response, and of photon noise, which grows with the signal (Kirk and Andersen 2006, *Noise
//! Characterization of Weighting Schemes for Combination of Multiple Exposures*; Hasinoff, Durand and Freeman
//! 2010). Clipped samples have no weight, and over the last twentieth of the codes below saturation the
//! weight fades out, so that no seam shows where the longest exposure saturates.
//!
//! All of this depends on exposure and code only: one look-up gives weight and weighted radiance.

#[cfg(test)]
mod tests;

use super::Response;
use crate::error::{Error, Result};
use crate::image::{Frame, Pixels};

/// Noise of a sensor, from which the weights follow. They need not be exact: what is merged are estimates of
/// the same radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorNoise {
    /// Standard deviation of a code: read noise and rounding, > 0.
    pub read_codes: f64,
    /// Electrons that a pixel holds at saturation, > 0; photon noise follows from it.
    pub full_well_electrons: f64,
}

impl Default for SensorNoise {
    /// One code and 20,000 electrons, as in a pixel of 4 to 6 micrometres.
    fn default() -> Self {
        Self { read_codes: 1.0, full_well_electrons: 20_000.0 }
    }
}

/// Pixels that no exposure could measure. A pixel of three channels counts where any of them is affected, in
/// the first of these fields that applies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MergeCounts {
    /// Saturated in the shortest exposure; they get the radiance at which that saturates.
    pub saturated: u64,
    /// Black in the longest exposure; they get the radiance up to which that is black.
    pub black_clipped: u64,
    /// Saturated in some exposures and black in the next shorter one: the steps are too large. They get the
    /// geometric mean of the two limits, or the first limit where the second is 0.
    pub between: u64,
}

/// Merges exposures of raw codes, one cycle after the other, without allocating once the size is known.
///
/// ```
/// # use lightcast_core::camera::{ExposureMerge, Response, ResponseModel, SensorNoise};
/// # use lightcast_core::image::{Frame, Pixels};
/// let response = Response::new(ResponseModel::Linear { black_level: 0, white_level: 255, gain: 0.01 })?;
/// let mut merge = ExposureMerge::new(&response, &[0.1, 0.001], &SensorNoise::default())?;
/// let frame = |code| Frame { width: 1, height: 1, pixels: Pixels::Codes(vec![code]), ..Frame::default() };
/// let mut radiance = Frame::default();
/// merge.add(&frame(255), 0)?;
/// merge.add(&frame(100), 1)?;
/// let counts = merge.finish(&mut radiance)?;
/// assert_eq!((radiance.pixels, counts.saturated), (Pixels::Radiance(vec![1000.0]), 0));
/// # Ok::<(), lightcast_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ExposureMerge {
    exposures: Vec<Exposure>,
    /// Radiance of a sample that no exposure can measure, by the number of exposures in which it is
    /// saturated.
    fallbacks: Vec<f32>,
    black_clip_code: u16,
    shortest: usize,
    longest: usize,
    /// Width, height, channels of the frames of this cycle.
    shape: (usize, usize, usize),
    sums: Vec<Sum>,
    /// Exposures added in this cycle.
    is_added: Vec<bool>,
}

/// One exposure time.
#[derive(Clone, Debug)]
struct Exposure {
    /// Weight and weighted radiance by code, up to the saturation code.
    table: Vec<(f32, f32)>,
}

/// The sums of a sample so far. They have at most 64 terms in f32, so they are accurate to 4e-6, which is
/// less than any sensor's noise.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    weight: f32,
    radiance: f32,
    /// Number of exposures in which it is saturated, and the two bits below.
    flags: u16,
}

const SATURATED_IN_SHORTEST: u16 = 1 << 14;
const BLACK_IN_LONGEST: u16 = 1 << 15;
const COUNT: u16 = SATURATED_IN_SHORTEST - 1;

/// Share of the codes, below saturation, over which the weight fades.
const FADE: f64 = 0.05;
/// Smallest relative standard deviation: no property of a sensor is known more accurately.
const BEST_ERROR: f64 = 1e-4;
/// Smallest weight, the largest being 1, so that its product with a radiance is still a normal f32.
const SMALLEST_WEIGHT: f64 = 1e-24;

impl ExposureMerge {
    /// Most exposures of a cycle.
    pub const MOST_EXPOSURES: usize = 64;

    /// Makes the tables for exposure times in s, in the order in which the camera cycles through them.
    ///
    /// # Errors
    /// `Usage`, naming the argument or its element: the identity as response, fewer than 2 exposures or more
    /// than 64, times that are not positive or are repeated, radiances beyond the range of f32, noise that is
    /// not positive.
    pub fn new(response: &Response, exposures_s: &[f64], noise: &SensorNoise) -> Result<Self> {
        if response.is_identity() {
            return Err(Error::usage(
                "exposures of raw codes cannot be merged without one; find it with calibrate response",
            )
            .in_option("response", None));
        }
        if !(2..=Self::MOST_EXPOSURES).contains(&exposures_s.len()) {
            return Err(Error::usage(format!(
                "{} exposures cannot be merged, it must be 2 to {}",
                exposures_s.len(),
                Self::MOST_EXPOSURES
            ))
            .in_option("exposures_s", None));
        }
        let is_positive = |value: f64| value.is_finite() && value > 0.0;
        let wrong_time = |index: usize, fault: &str| {
            Error::usage(fault).in_option(&format!("exposures_s[{index}]"), Some(&exposures_s[index]))
        };
        if let Some(index) = exposures_s.iter().position(|time| !is_positive(*time)) {
            return Err(wrong_time(index, "must be a positive number"));
        }
        for (name, value) in
            [("noise.read_codes", noise.read_codes), ("noise.full_well_electrons", noise.full_well_electrons)]
        {
            if !is_positive(value) {
                return Err(Error::usage("must be a positive number").in_option(name, Some(&value)));
            }
        }
        let mut by_time: Vec<usize> = (0..exposures_s.len()).collect();
        by_time.sort_by(|&one, &two| exposures_s[two].total_cmp(&exposures_s[one]));
        if let Some(pair) = by_time.windows(2).find(|pair| exposures_s[pair[0]] == exposures_s[pair[1]]) {
            return Err(wrong_time(pair[1], "is there twice"));
        }
        let (longest, shortest) = (by_time[0], by_time[by_time.len() - 1]);
        let (black, saturation) = ends(response);
        if saturation / exposures_s[shortest] > f64::from(f32::MAX) {
            let fault = format!(
                "saturation in this time is a radiance of {:e}, more than a float holds; scale the response down",
                saturation / exposures_s[shortest]
            );
            return Err(wrong_time(shortest, &fault));
        }
        let mut fallbacks = vec![(black / exposures_s[longest]) as f32];
        for pair in by_time.windows(2) {
            let (least, most) = (saturation / exposures_s[pair[0]], black / exposures_s[pair[1]]);
            fallbacks.push(if most > 0.0 { (least * most).sqrt() } else { least } as f32);
        }
        fallbacks.push((saturation / exposures_s[shortest]) as f32);

        let weights: Vec<Vec<f64>> =
            exposures_s.iter().map(|&time_s| weights(response, time_s, noise)).collect();
        let largest = weights.iter().flatten().fold(0.0f64, |largest, &weight| largest.max(weight));
        let exposures = weights
            .iter()
            .zip(exposures_s)
            .map(|(weights, time_s)| Exposure {
                table: weights
                    .iter()
                    .zip(response.table())
                    .map(|(&weight, &radiance)| {
                        let weight = if weight > 0.0 { (weight / largest).max(SMALLEST_WEIGHT) } else { 0.0 };
                        (weight as f32, (weight * f64::from(radiance) / time_s) as f32)
                    })
                    .collect(),
            })
            .collect();
        Ok(Self {
            exposures,
            fallbacks,
            black_clip_code: response.black_clip_code(),
            shortest,
            longest,
            shape: (0, 0, 0),
            sums: Vec::new(),
            is_added: vec![false; exposures_s.len()],
        })
    }

    /// Adds the frame of the exposure with this index. The first frame of a cycle sets its size.
    ///
    /// # Errors
    /// `BadFrame`, after which the cycle goes on without the frame: radiance instead of codes, a mosaic, a
    /// size other than the cycle's, an exposure that is not one of this cycle or was added before.
    pub fn add(&mut self, frame: &Frame, exposure: usize) -> Result<()> {
        let Pixels::Codes(codes) = &frame.pixels else {
            return Err(Error::bad_frame("holds radiance; exposures are merged from raw codes"));
        };
        if let Some(bayer) = frame.bayer {
            return Err(Error::bad_frame(format!("is a mosaic of colours {bayer}, which cannot be merged")));
        }
        match self.is_added.get(exposure) {
            None => {
                return Err(Error::bad_frame(format!(
                    "exposure {exposure} is not one of the cycle's {}, counted from 0",
                    self.exposures.len()
                )));
            }
            Some(true) => {
                return Err(Error::bad_frame(format!("exposure {exposure} came twice in one cycle")));
            }
            Some(false) => {}
        }
        let shape = (frame.width, frame.height, frame.channels);
        if !self.is_added.contains(&true) {
            self.shape = shape;
            self.sums.clear();
            self.sums.resize(codes.len(), Sum::default());
        }
        if shape != self.shape || codes.len() != self.sums.len() {
            return Err(Error::bad_frame(format!(
                "is {} x {} x {}, but the cycle's first frame is {} x {} x {}",
                shape.0, shape.1, shape.2, self.shape.0, self.shape.1, self.shape.2
            )));
        }
        let table = self.exposures[exposure].table.as_slice();
        let saturation = table.len() - 1;
        let if_saturated = 1 | if exposure == self.shortest { SATURATED_IN_SHORTEST } else { 0 };
        let if_black = if exposure == self.longest { BLACK_IN_LONGEST } else { 0 };
        for (sum, &code) in self.sums.iter_mut().zip(codes) {
            let at = usize::from(code).min(saturation);
            let (weight, radiance) = table[at];
            sum.weight += weight;
            sum.radiance += radiance;
            sum.flags += if at == saturation { if_saturated } else { 0 };
            sum.flags |= if code <= self.black_clip_code { if_black } else { 0 };
        }
        self.is_added[exposure] = true;
        Ok(())
    }

    /// Forgets the frames of this cycle, for a camera that lost one.
    pub fn restart(&mut self) {
        self.is_added.fill(false);
    }

    /// Writes the merged frame: radiance at an exposure of 1 s, finite and not negative, in the unit of the
    /// response. Samples that were saturated in the shortest exposure have the value of the frame's
    /// `saturation`. The buffer is reused when it fits; the stamp is left as it is. The next `add` begins a
    /// new cycle.
    ///
    /// # Errors
    /// `BadFrame`, naming the exposures that are missing; the cycle's frames are forgotten and `frame` is
    /// unchanged.
    pub fn finish(&mut self, frame: &mut Frame) -> Result<MergeCounts> {
        if self.is_added.contains(&false) {
            let missing: Vec<usize> = (0..self.is_added.len()).filter(|&at| !self.is_added[at]).collect();
            self.restart();
            return Err(Error::bad_frame(format!(
                "the cycle lacks the exposures {missing:?}, counted from 0"
            )));
        }
        self.restart();
        (frame.width, frame.height, frame.channels) = self.shape;
        frame.bayer = None;
        frame.saturation = self.fallbacks[self.exposures.len()];
        let mut values = match std::mem::replace(&mut frame.pixels, Pixels::Radiance(Vec::new())) {
            Pixels::Radiance(values) => values,
            Pixels::Codes(_) => Vec::new(),
        };
        values.resize(self.sums.len(), 0.0);
        let mut counts = MergeCounts::default();
        let channels = self.shape.2.max(1);
        for (pixel, sums) in values.chunks_exact_mut(channels).zip(self.sums.chunks_exact(channels)) {
            let (mut is_saturated, mut is_black, mut is_between) = (false, false, false);
            for (value, sum) in pixel.iter_mut().zip(sums) {
                if sum.flags & SATURATED_IN_SHORTEST != 0 {
                    is_saturated = true;
                    *value = self.fallbacks[self.exposures.len()];
                } else if sum.flags & BLACK_IN_LONGEST != 0 {
                    is_black = true;
                    *value = self.fallbacks[0];
                } else if sum.weight > 0.0 {
                    *value = sum.radiance / sum.weight;
                } else {
                    is_between = true;
                    *value = self.fallbacks[usize::from(sum.flags & COUNT)];
                }
            }
            counts.saturated += u64::from(is_saturated);
            counts.black_clipped += u64::from(!is_saturated && is_black);
            counts.between += u64::from(!is_saturated && !is_black && is_between);
        }
        frame.pixels = Pixels::Radiance(values);
        Ok(counts)
    }
}

/// Radiance at the black-clip and at the saturation code.
fn ends(response: &Response) -> (f64, f64) {
    let at = |code: u16| f64::from(response.table()[usize::from(code)]);
    (at(response.black_clip_code()), at(response.saturation_code()))
}

/// One over the variance of the radiance by code; 0 where clipped.
fn weights(response: &Response, time_s: f64, noise: &SensorNoise) -> Vec<f64> {
    let table = response.table();
    let (black, saturation) =
        (usize::from(response.black_clip_code()), usize::from(response.saturation_code()));
    let per_electron = ends(response).1 / noise.full_well_electrons;
    let fade = (FADE * (saturation - black) as f64).max(1.0);
    (0..table.len())
        .map(|code| {
            if code <= black || code >= saturation {
                return 0.0;
            }
            let signal = f64::from(table[code]);
            let slope = (f64::from(table[code + 1]) - f64::from(table[code - 1])) / 2.0;
            let read = slope * noise.read_codes;
            let variance = read * read + signal * per_electron + (BEST_ERROR * signal).powi(2);
            let weight = time_s * time_s / variance * ((saturation - code) as f64 / fade).min(1.0);
            if weight.is_finite() { weight } else { 0.0 }
        })
        .collect()
}
