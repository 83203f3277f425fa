//! High dynamic range from an ordinary camera: its exposure goes round a list of values, and every round becomes one
//! frame of radiance, at the camera's rate divided by the number of values.

use super::live::{Camera, Captured, Mark};
use crate::camera::{ExposureMerge, Response, SensorNoise};
use crate::error::{Error, Result};
use crate::image::Frame;
use crate::rt::{Counter, Metrics};
use serde::Deserialize;
use std::collections::VecDeque;
use std::time::Duration;

/// A camera whose exposure can be set while it streams.
pub trait ExposureControl: Camera {
    /// Sets the exposure to a value in the driver's unit.
    ///
    /// # Errors
    /// As [`Camera::start`].
    fn set_exposure(&mut self, value: i64) -> Result<()>;
}

/// Which exposures a camera goes round.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BracketOptions {
    /// The control to set.
    #[serde(default = "exposure_time_absolute")]
    pub control: String,
    /// Its values, at least two, all different.
    pub values: Vec<i64>,
    /// Exposure in seconds of one unit of the control. V4L2's `exposure_time_absolute` counts in 100 microseconds.
    #[serde(default = "hundred_microseconds")]
    pub unit_s: f64,
    /// From which frame after the one at whose arrival it is set a value holds: 1 is the next frame.
    #[serde(default = "two_frames")]
    pub latency_frames: u32,
}

fn exposure_time_absolute() -> String {
    "exposure_time_absolute".to_owned()
}

fn hundred_microseconds() -> f64 {
    1e-4
}

/// Many cameras expose the next frame while one is sent, and set what they were told for the one after it.
fn two_frames() -> u32 {
    2
}

/// Longest latency that a driver's queue makes.
const LATENCY_MAX: u32 = 16;

/// Merges rounds of exposures into frames of radiance.
pub struct Bracket<C> {
    camera: C,
    values: Vec<i64>,
    plan: Plan,
    merge: ExposureMerge,
    raw: Frame,
    /// Time of the first frame of the round under way.
    first_ns: i64,
    counters: [Counter; 4],
}

impl<C: ExposureControl> Bracket<C> {
    /// Rounds of `camera`'s frames, whose codes mean what `response` says at an exposure of one second.
    ///
    /// # Errors
    /// `Usage`: fewer than two values, equal ones, a unit that is not positive, a latency of 0 or more than 16 frames,
    /// a response that says nothing of codes.
    pub fn new(camera: C, options: &BracketOptions, response: &Response, metrics: &Metrics) -> Result<Self> {
        let BracketOptions { values, unit_s, latency_frames, .. } = options;
        if !(1..=LATENCY_MAX).contains(latency_frames) {
            return Err(Error::usage(format!(
                "latency_frames = {latency_frames}: must be 1 to {LATENCY_MAX}"
            )));
        }
        let exposures_s: Vec<f64> = values.iter().map(|&value| value as f64 * unit_s).collect();
        Ok(Self {
            camera,
            // At most 64 values: more are refused by the merge.
            plan: Plan::new(values.len() as u32, *latency_frames),
            merge: ExposureMerge::new(response, &exposures_s, &SensorNoise::default())?,
            values: values.clone(),
            raw: Frame::default(),
            first_ns: 0,
            counters: [
                "pixels saturated in the shortest exposure",
                "pixels black in the longest exposure",
                "pixels between two exposures",
                "incomplete rounds of exposures",
            ]
            .map(|name| metrics.counter(name)),
        })
    }

    /// One frame of the camera; the mark of the round that it completes.
    fn add(&mut self, mark: Mark, frame: &mut Frame) -> Result<Option<Mark>> {
        let step = self.plan.arrive(mark.sequence);
        self.camera.set_exposure(self.values[step.next])?;
        if step.has_broken {
            self.counters[3].add(1);
        }
        let Some(exposure) = step.exposure else { return Ok(None) };
        if exposure == 0 {
            self.merge.restart();
            self.first_ns = mark.time_ns;
        }
        self.merge.add(&self.raw, exposure)?;
        if exposure + 1 < self.values.len() {
            return Ok(None);
        }
        let counts = self.merge.finish(frame)?;
        for (counter, count) in
            self.counters.iter().zip([counts.saturated, counts.black_clipped, counts.between])
        {
            counter.add(count);
        }
        let middle_ns = self.first_ns + (mark.time_ns - self.first_ns) / 2;
        Ok(Some(Mark { sequence: step.round, time_ns: middle_ns }))
    }
}

impl<C: ExposureControl> Camera for Bracket<C> {
    fn start(&mut self) -> Result<()> {
        self.plan.restart();
        self.camera.start()
    }

    fn capture(&mut self, patience: Duration, frame: &mut Frame) -> Result<Captured> {
        match self.camera.capture(patience, &mut self.raw)? {
            Captured::Frame(mark) => Ok(self.add(mark, frame)?.map_or(Captured::Nothing, Captured::Frame)),
            // A frame that cannot be used is a gap in its round; the first one stands for the round.
            Captured::Bad(mark, reason) => {
                let round = mark.sequence / self.plan.count;
                let has_broken = self.plan.break_round();
                Ok(if has_broken {
                    Captured::Bad(Mark { sequence: round, ..mark }, reason)
                } else {
                    Captured::Nothing
                })
            }
            Captured::Nothing => Ok(Captured::Nothing),
        }
    }

    fn stop(&mut self) {
        self.camera.stop();
    }
}

/// Which exposure every frame has. Frame s of a stream is to have exposure s modulo their count; what it has, the values
/// that were set and their latency tell, also when frames are missing.
#[derive(Debug)]
struct Plan {
    count: u32,
    latency_frames: u32,
    /// From which frame on which exposure holds, ascending.
    settings: VecDeque<(u32, usize)>,
    /// Frames of the round under way, which are the first of it.
    complete: usize,
    last: Option<u32>,
}

/// What a frame is for.
#[derive(Debug, PartialEq, Eq)]
struct Step {
    /// The exposure to set now.
    next: usize,
    /// The exposure of this frame, when it continues a round; 0 begins one, the last one ends it.
    exposure: Option<usize>,
    round: u32,
    /// A round that had begun will not be complete.
    has_broken: bool,
}

impl Plan {
    fn new(count: u32, latency_frames: u32) -> Self {
        Self { count, latency_frames, settings: VecDeque::new(), complete: 0, last: None }
    }

    fn restart(&mut self) {
        *self = Self::new(self.count, self.latency_frames);
    }

    /// Whether there was a round to break.
    fn break_round(&mut self) -> bool {
        std::mem::take(&mut self.complete) > 0
    }

    fn arrive(&mut self, frame: u32) -> Step {
        let wanted = (frame % self.count) as usize;
        // All settings but the one that holds now and those to come are history.
        while self.settings.get(1).is_some_and(|&(from, _)| from <= frame) {
            self.settings.pop_front();
        }
        let has = self.settings.front().filter(|&&(from, _)| from <= frame).map(|&(_, exposure)| exposure);
        let is_neighbour = self.last == frame.checked_sub(1);
        self.last = Some(frame);
        let from = frame.saturating_add(self.latency_frames);
        let next = (from % self.count) as usize;
        self.settings.push_back((from, next));

        let continues = has == Some(wanted) && (wanted == 0 || is_neighbour && wanted == self.complete);
        let has_broken = (!continues || wanted == 0) && self.break_round();
        if continues {
            self.complete = (wanted + 1) % self.count as usize;
        }
        Step { next, exposure: continues.then_some(wanted), round: frame / self.count, has_broken }
    }
}

#[cfg(test)]
mod tests;
