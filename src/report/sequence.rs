//! Steadiness of lights over time: the garden and the hall of METHODS section 7, 40 frames of 360 x 90
//! hemispheres each, 128 lights, before and after the FIR; and any other sequence of maps with any number of
//! lights.
//!
//! The compared values are irradiances at 200 points: the ground beside a sphere, in 10 x 10 cells of 6 x 6
//! points, and 100 normals. After the filter a list is judged against the irradiances of the maps passed
//! through the same taps; irradiance is linear in the map, so this is the irradiance of the filtered map. The
//! first filtered frames, as many as the filter's order (8 at 25 frames per second), are left out: they still
//! contain the repetitions of the first.

use super::filtered_truth::filtered;
use super::median::median;
use super::sequence_maps::{garden_frame, hall_frame};
use crate::compare::sequence_methods::SequenceMethod;
use crate::compare::still_methods::SHAPE;
use crate::design::{FilterOptions, RateFilter, low_pass};
use crate::error::{Error, Result};
use glam::DVec3;
use lightcast_core::image::{PolarMap, Stamp};
use lightcast_core::light::ReferencedList;
use lightcast_core::light::measure::{Emitters, soft_ground_cells};
use lightcast_core::light::{Light, LightList};
use lightcast_core::math::angle_between;
use lightcast_core::math::percentile;
use std::time::{Duration, Instant};

/// Frames of a sequence.
pub const FRAMES: usize = 40;
/// The rate that the published taps are for.
const FRAME_RATE_HZ: f64 = 25.0;

/// The error of lists against the truth over a sequence, and its unsteadiness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// RMS of (value - reference) over frames and points, relative to the mean reference; 0 where both are
    /// dark.
    pub error: f64,
    /// RMS of the second time difference of (value - reference), relative to the mean reference.
    pub flicker: f64,
    /// Angle that a light moves from one frame to the next, over all lights and frames: median, 99th
    /// percentile, maximum, in degrees.
    pub motion_deg: [f64; 3],
}

/// Figures of one method on one sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeforeAndAfter {
    /// Of the lists as they are extracted, every light a direction.
    pub before: Figures,
    /// Of the filtered lists, every light a direction.
    pub after: Figures,
    /// Of the lists as they are extracted, shadows softened by the lights' spread.
    pub soft_before: Figures,
    /// Of the filtered lists, shadows softened by the lights' spread.
    pub soft_after: Figures,
}

/// The result of one method with some number of lights on a sequence, and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timed {
    /// Error and steadiness.
    pub measured: BeforeAndAfter,
    /// Median time of a frame: extraction and filter with their error estimates.
    pub time: Duration,
}

/// A sequence of maps with its truth.
pub struct Sequence {
    maps: Vec<PolarMap>,
    /// Irradiances at all points, frame by frame.
    truth: Vec<Vec<f64>>,
    filtered_truth: Vec<Vec<f64>>,
    /// The filter's order: filtered frames that are left out.
    start_up: usize,
}

impl Sequence {
    /// The garden: `map` (`chinese_garden_1k`) turned so that its brightest column is at column 20 - t in
    /// frame t; its sun crosses phi = 0 in frame 20. `goes_on` as of [`Self::from_maps`].
    ///
    /// # Errors
    /// Kind `Usage` for a map of another shape than [`SHAPE`].
    pub fn garden(map: &PolarMap, goes_on: &dyn Fn() -> bool) -> Result<Option<Self>> {
        check_shape(map)?;
        Self::new(|t| garden_frame(map, t), goes_on)
    }

    /// The hall: `map` (`dancing_hall_1k`), whose pixels in columns 71-149 above its 97th percentile of
    /// luminance are multiplied by `1 + 0.5 sin(2 pi 0.38 t)` in frame t: lamps that flicker at 9.5 Hz.
    /// `goes_on` as of [`Self::from_maps`].
    ///
    /// # Errors
    /// Kind `Usage` for a map of another shape than [`SHAPE`].
    pub fn hall(map: &PolarMap, goes_on: &dyn Fn() -> bool) -> Result<Option<Self>> {
        check_shape(map)?;
        Self::new(|t| hall_frame(map, t), goes_on)
    }

    fn new(frame: impl Fn(usize) -> PolarMap, goes_on: &dyn Fn() -> bool) -> Result<Option<Self>> {
        let maps = (0..FRAMES).map(|t| PolarMap { stamp: stamp(t, FRAME_RATE_HZ), ..frame(t) }).collect();
        Self::from_maps(maps, goes_on)
    }

    /// The fewest frames that a sequence at this rate needs for all its figures: the filter's order and three
    /// more.
    ///
    /// # Errors
    /// Kind `Usage` for a frame rate without a filter (see [`low_pass`]).
    pub fn least_frames(frame_rate_hz: f64) -> Result<usize> {
        Ok(low_pass(frame_rate_hz, &FilterOptions::default())?.order() + 3)
    }

    /// Any maps of one shape, in the order of their stamps, whose frame rate decides on the filter; for
    /// frames that a stamp reports as lost, the last one is held, as in the filter. Computes the truth, about
    /// a tenth of a second per map; `None` when `goes_on`, which is called after every map, returns false.
    ///
    /// # Errors
    /// Kind `Usage` for maps of different shapes, for fewer than [`Self::least_frames`], and for a frame rate
    /// without a filter (see [`low_pass`]).
    pub fn from_maps(maps: Vec<PolarMap>, goes_on: &dyn Fn() -> bool) -> Result<Option<Self>> {
        let frame_rate_hz = maps.first().map_or(0.0, |map| map.stamp.frame_rate_hz);
        if maps.iter().any(|map| map.shape != maps[0].shape || map.pixels.len() != map.shape.len()) {
            return Err(Error::usage("the maps of a sequence are of different shapes; give them one"));
        }
        let taps = low_pass(frame_rate_hz, &FilterOptions::default())?;
        let (count, least) = (maps.len(), Self::least_frames(frame_rate_hz)?);
        if count < least {
            return Err(Error::usage(format!("has {count} frames that can be used; give at least {least}")));
        }
        let mut truth = Vec::with_capacity(count);
        for map in &maps {
            truth.push(values(&Emitters::from_map(map)));
            if !goes_on() {
                return Ok(None);
            }
        }
        let filtered_truth = filtered(&truth, maps.iter().map(|map| map.stamp.lost_before), taps.as_slice());
        Ok(Some(Self { maps, truth, filtered_truth, start_up: taps.order() }))
    }

    /// Number of frames.
    pub fn frame_count(&self) -> usize {
        self.maps.len()
    }

    /// Frames per second; 0 where they are not known.
    pub fn frame_rate_hz(&self) -> f64 {
        self.maps[0].stamp.frame_rate_hz
    }

    /// Whether anything is filtered at this frame rate.
    pub fn is_filtered(&self) -> bool {
        self.start_up > 0
    }

    /// Extracts, filters and measures `count` lights, and measures the time. `None` when `goes_on`, which is
    /// called after every list, returns false.
    ///
    /// # Errors
    /// Those of the extractor and the filter.
    pub fn measure(
        &self,
        method: SequenceMethod,
        count: usize,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Option<Timed>> {
        let mut extractor = method.extractor(self.maps[0].shape, count)?;
        let mut filter = RateFilter::new(&method.filter())?;
        let (mut before, mut after, mut times) = (Vec::new(), Vec::new(), Vec::new());
        let (mut list, mut filtered) = (ReferencedList::default(), ReferencedList::default());
        for map in &self.maps {
            let start = Instant::now();
            extractor.step(map, &mut list);
            filter.step(&list, &mut filtered)?;
            times.push(start.elapsed());
            before.push(list.list.clone());
            after.push(filtered.list.clone());
            if !goes_on() {
                return Ok(None);
            }
        }
        let figures = || {
            let (after, filtered_truth) = (&after[self.start_up..], &self.filtered_truth[self.start_up..]);
            Some(BeforeAndAfter {
                before: figures(&before, &self.truth, hard, goes_on)?,
                after: figures(after, filtered_truth, hard, goes_on)?,
                soft_before: figures(&before, &self.truth, soft, goes_on)?,
                soft_after: figures(after, filtered_truth, soft, goes_on)?,
            })
        };
        Ok(figures().map(|measured| Timed { measured, time: median(&mut times).unwrap_or_default() }))
    }
}

/// Stamp of frame t of a calculated sequence.
fn stamp(t: usize, frame_rate_hz: f64) -> Stamp {
    Stamp {
        sequence: t as u64,
        capture_time_ns: (t as f64 * 1e9 / frame_rate_hz) as i64,
        lost_before: 0,
        frame_rate_hz,
    }
}

fn check_shape(map: &PolarMap) -> Result<()> {
    if map.shape == SHAPE && map.pixels.len() == SHAPE.len() {
        return Ok(());
    }
    Err(Error::usage(format!(
        "a map of {} x {} pixels down to {:.4} rad: the sequences are measured on hemispheres of {} x {}",
        map.shape.columns(),
        map.shape.rows(),
        map.shape.theta_max_rad(),
        SHAPE.columns(),
        SHAPE.rows()
    )))
}

/// Irradiances at the points where sequences are compared.
fn values(emitters: &Emitters) -> Vec<f64> {
    let mut values = emitters.ground_cells(10, 6);
    values.extend(emitters.irradiances(100));
    values
}

/// Every light a direction.
fn hard(lights: &[Light]) -> Vec<f64> {
    values(&Emitters::from_lights(lights))
}

/// Shadows softened by the lights' spread.
fn soft(lights: &[Light]) -> Vec<f64> {
    let mut values = soft_ground_cells(lights, 10, 6);
    values.extend(Emitters::from_lights(lights).irradiances(100));
    values
}

/// The figures of lists; `None` when `goes_on`, which is asked after every list, says no.
fn figures(
    lists: &[LightList],
    truth: &[Vec<f64>],
    values: fn(&[Light]) -> Vec<f64>,
    goes_on: &dyn Fn() -> bool,
) -> Option<Figures> {
    let of_list = |(list, truth): (&LightList, &Vec<f64>)| -> Option<Vec<f64>> {
        let values = values(&list.lights);
        goes_on().then(|| values.iter().zip(truth).map(|(value, truth)| value - truth).collect())
    };
    let differences: Vec<Vec<f64>> = lists.iter().zip(truth).map(of_list).collect::<Option<_>>()?;
    let mean = truth.iter().flatten().sum::<f64>() / truth.iter().flatten().count() as f64;
    let second_differences = differences
        .windows(3)
        .flat_map(|d| (0..d[0].len()).map(move |place| d[2][place] - 2.0 * d[1][place] + d[0][place]));
    let mut motion: Vec<f64> = lists
        .windows(2)
        .flat_map(|pair| pair[0].lights.iter().zip(&pair[1].lights))
        .map(|(a, b)| {
            let [a, b] = [a, b].map(|light| DVec3::from_array(light.direction.map(f64::from)));
            angle_between(a, b).to_degrees()
        })
        .collect();
    motion.sort_by(f64::total_cmp);
    let relative = |rms: f64| if rms == 0.0 { 0.0 } else { rms / mean };
    Some(Figures {
        error: relative(rms(differences.iter().flatten().copied())),
        flicker: relative(rms(second_differences)),
        motion_deg: [0.5, 0.99, 1.0].map(|fraction| percentile(&motion, fraction)),
    })
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(sum, count), value| (sum + value * value, count + 1));
    (sum / count.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests;
