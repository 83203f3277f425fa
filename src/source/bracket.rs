//! High dynamic range from an ordinary camera: its exposure cycles through a list of values, and every cycle
//! (a round) becomes one frame of radiance, at the camera's rate divided by the number of values.

use super::live::{BadBuffer, Captured, LiveCamera, Mark};
use crate::error::{Error, Place, Result};
use crate::rt::{Counter, Metrics};
use lightcast_core::camera::{ExposureMerge, Response, SensorNoise};
use lightcast_core::image::Frame;
use serde::Deserialize;
use std::collections::VecDeque;
use std::time::Duration;

/// A camera whose exposure can be set while it streams.
pub trait ExposureControl: LiveCamera {
    /// Sets the exposure to a value in the driver's unit.
    ///
    /// # Errors
    /// As [`LiveCamera::start`].
    fn set_exposure(&mut self, value: i64) -> Result<()>;
}

/// Which exposures a camera cycles through.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BracketOptions {
    /// The control to set.
    #[serde(default = "exposure_time_absolute")]
    pub control: String,
    /// Its values, at least two, all different.
    pub values: Vec<i64>,
    /// Exposure in seconds of one unit of the control. V4L2's `exposure_time_absolute` counts in 100
    /// microseconds.
    #[serde(default = "hundred_microseconds")]
    pub unit_s: f64,
    /// Number of frames from the one at whose arrival a value is set to the first one that is exposed with
    /// it: 1 is the next frame.
    #[serde(default = "two_frames")]
    pub latency_frames: u32,
}

fn exposure_time_absolute() -> String {
    "exposure_time_absolute".to_owned()
}

fn hundred_microseconds() -> f64 {
    1e-4
}

/// Many cameras expose the next frame while one is being sent, and apply a new setting to the frame after
/// that.
fn two_frames() -> u32 {
    2
}

/// Longest latency that a driver's queue causes.
const LATENCY_MAX: u32 = 16;

/// Merges rounds of exposures into frames of radiance.
pub struct Bracket<C> {
    camera: C,
    values: Vec<i64>,
    plan: Plan,
    merge: ExposureMerge,
    raw: Frame,
    frame_ns: f64,
    /// Smallest age of a frame so far: the time that the driver and the bus take.
    least_age_ns: i64,
    /// The previous frame: its driver's count, and its number here.
    last: Option<(u32, u32)>,
    /// Capture time of the first frame of the current round.
    first_ns: i64,
    counters: [Counter; 2],
}

impl<C: ExposureControl> Bracket<C> {
    /// Merges rounds of `camera`'s frames, which come at `frame_rate_hz` (0: unknown). `response` maps their
    /// codes to radiance at an exposure of one second.
    ///
    /// # Errors
    /// `Usage`, naming the key: fewer than two values or more than 64, equal ones, values or a unit that are
    /// not positive, a latency of 0 or more than 16 frames, a response that does not map codes.
    pub fn new(
        camera: C,
        frame_rate_hz: f64,
        options: &BracketOptions,
        response: &Response,
        metrics: &Metrics,
    ) -> Result<Self> {
        let BracketOptions { values, unit_s, latency_frames, .. } = options;
        if !(1..=LATENCY_MAX).contains(latency_frames) {
            return Err(Error::usage(format!("must be 1 to {LATENCY_MAX}"))
                .at(Place::value("latency_frames", latency_frames)));
        }
        if !(2..=ExposureMerge::MOST_EXPOSURES).contains(&values.len()) {
            return Err(Error::usage(format!(
                "{} exposures cannot be merged, give 2 to {}",
                values.len(),
                ExposureMerge::MOST_EXPOSURES
            ))
            .at(Place::key("values")));
        }
        if !(unit_s.is_finite() && *unit_s > 0.0) {
            return Err(Error::usage("must be a positive number").at(Place::value("unit_s", unit_s)));
        }
        for (index, value) in values.iter().enumerate() {
            let fault = if *value <= 0 {
                "must be a positive number"
            } else if values[..index].contains(value) {
                "is there twice"
            } else {
                continue;
            };
            return Err(Error::usage(fault).at(Place::value(format!("values[{index}]"), value)));
        }
        let exposures_s: Vec<f64> = values.iter().map(|&value| value as f64 * unit_s).collect();
        Ok(Self {
            camera,
            plan: Plan::new(values.len() as u32, *latency_frames),
            merge: ExposureMerge::new(response, &exposures_s, &SensorNoise::default())?,
            values: values.clone(),
            raw: Frame::default(),
            frame_ns: if frame_rate_hz > 0.0 { 1e9 / frame_rate_hz } else { f64::INFINITY },
            least_age_ns: i64::MAX,
            last: None,
            first_ns: 0,
            counters: ["pixels black in the longest exposure", "pixels between two exposures"]
                .map(|name| metrics.counter(name)),
        })
    }

    /// Numbers a frame by the driver's count, or one by one where the driver does not count, and sets the
    /// next exposure.
    fn arrive(&mut self, mark: Mark) -> Result<Step> {
        let number = match self.last {
            None => mark.sequence,
            Some((count, number)) => number.wrapping_add(mark.sequence.wrapping_sub(count).max(1)),
        };
        self.last = Some((mark.sequence, number));
        // If a frame has waited in the queue, later ones have been exposed since.
        self.least_age_ns = self.least_age_ns.min(mark.age_ns);
        let late = (mark.age_ns.saturating_sub(self.least_age_ns) as f64 / self.frame_ns).round() as u32;
        let step = self.plan.arrive(number, late);
        self.camera.set_exposure(self.values[step.next])?;
        Ok(step)
    }

    /// Adds a frame that can be used.
    fn add(&mut self, mark: Mark, frame: &mut Frame) -> Result<Captured> {
        let step = self.arrive(mark)?;
        let of_round = Mark { sequence: step.round, ..mark };
        let Some(exposure) = step.exposure else { return Ok(step.otherwise(of_round)) };
        if exposure == 0 {
            self.merge.restart();
            self.first_ns = mark.time_ns;
        }
        self.merge.add(&self.raw, exposure)?;
        if !step.is_last {
            return Ok(Captured::Part);
        }
        let counts = self.merge.finish(frame)?;
        // Saturated pixels are not counted here but where the frame becomes a map, by the frame's own limit.
        for (counter, count) in self.counters.iter().zip([counts.black_clipped, counts.between]) {
            counter.add(count);
        }
        let middle_ns = self.first_ns.midpoint(mark.time_ns);
        Ok(Captured::Frame(Mark { time_ns: middle_ns, ..of_round }))
    }
}

impl<C: ExposureControl> LiveCamera for Bracket<C> {
    fn start(&mut self) -> Result<()> {
        self.plan.restart();
        self.last = None;
        self.camera.start()
    }

    fn capture(&mut self, patience: Duration, frame: &mut Frame) -> Result<Captured> {
        match self.camera.capture(patience, &mut self.raw)? {
            Captured::Frame(mark) => self.add(mark, frame),
            Captured::Bad(mark, reason) => {
                let step = self.arrive(mark)?;
                self.plan.break_round();
                Ok(Captured::Bad(Mark { sequence: step.round, ..mark }, reason))
            }
            other => Ok(other),
        }
    }

    fn stop(&mut self) {
        self.camera.stop();
    }
}

/// Which exposure every frame has. Frame s of a stream should have exposure s modulo the number of exposures;
/// the exposure that it actually has follows from the values that were set and their latency, also when
/// frames are missing.
#[derive(Debug)]
struct Plan {
    count: u32,
    latency_frames: u32,
    /// The first frame of every setting and its exposure, ascending.
    settings: VecDeque<(u32, usize)>,
    /// Number of frames of the current round so far, which are its first ones.
    complete: usize,
    last: Option<u32>,
}

/// How a frame is used.
#[derive(Debug, PartialEq, Eq)]
struct Step {
    /// The exposure to set now.
    next: usize,
    /// The exposure of this frame if it continues a round; 0 begins a round.
    exposure: Option<usize>,
    round: u32,
    /// The round ends with this frame.
    is_last: bool,
}

impl Step {
    /// The outcome of a frame that does not continue a round: at a round's end, that the round is incomplete.
    fn otherwise(&self, of_round: Mark) -> Captured {
        if self.is_last { Captured::Bad(of_round, BadBuffer::Incomplete) } else { Captured::Part }
    }
}

impl Plan {
    fn new(count: u32, latency_frames: u32) -> Self {
        Self { count, latency_frames, settings: VecDeque::new(), complete: 0, last: None }
    }

    fn restart(&mut self) {
        *self = Self::new(self.count, self.latency_frames);
    }

    fn break_round(&mut self) {
        self.complete = 0;
    }

    /// Handles the arrival of a frame, which is `late` frames later than it could have arrived.
    fn arrive(&mut self, frame: u32, late: u32) -> Step {
        let wanted = (frame % self.count) as usize;
        // Only the setting that applies now and later ones are still needed.
        while self.settings.get(1).is_some_and(|&(from, _)| from <= frame) {
            self.settings.pop_front();
        }
        let has = self.settings.front().filter(|&&(from, _)| from <= frame).map(|&(_, exposure)| exposure);
        let is_neighbour = self.last == frame.checked_sub(1);
        self.last = Some(frame);
        let from = frame.saturating_add(late).saturating_add(self.latency_frames);
        let next = (from % self.count) as usize;
        // Settings that were to apply from then on are superseded.
        while self.settings.back().is_some_and(|&(other, _)| other >= from) {
            self.settings.pop_back();
        }
        self.settings.push_back((from, next));

        let continues = has == Some(wanted) && (wanted == 0 || is_neighbour && wanted == self.complete);
        self.complete = if continues { (wanted + 1) % self.count as usize } else { 0 };
        Step {
            next,
            exposure: continues.then_some(wanted),
            round: frame / self.count,
            is_last: wanted + 1 == self.count as usize,
        }
    }
}

#[cfg(test)]
mod tests;
