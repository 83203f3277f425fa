//! High dynamic range from an ordinary camera: its exposure goes round a list of values, and every round
//! becomes one frame of radiance, at the camera's rate divided by the number of values.

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

/// Which exposures a camera goes round.
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
    frame_ns: f64,
    /// Smallest age of a frame so far: what the driver and the bus take.
    least_age_ns: i64,
    /// The frame before, by its driver's count, and its number here.
    last: Option<(u32, u32)>,
    /// Time of the first frame of the round under way.
    first_ns: i64,
    counters: [Counter; 2],
}

impl<C: ExposureControl> Bracket<C> {
    /// Rounds of `camera`'s frames, `frame_rate_hz` of them a second (0: unknown), whose codes mean what
    /// `response` says at an exposure of one second.
    ///
    /// # Errors
    /// `Usage`: fewer than two values, equal ones, a unit that is not positive, a latency of 0 or more than
    /// 16 frames, a response that says nothing of codes.
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
        let exposures_s: Vec<f64> = values.iter().map(|&value| value as f64 * unit_s).collect();
        Ok(Self {
            camera,
            // At most 64 values: more are refused by the merge.
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
        // A frame that has waited in the queue was not the last one that was exposed.
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
        // Saturated pixels are those of the frame's own limit, and counted where it becomes a map.
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

/// Which exposure every frame has. Frame s of a stream is to have exposure s modulo their count; what it has,
/// the values that were set and their latency tell, also when frames are missing.
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
    /// The exposure of this frame, when it continues a round; 0 begins one.
    exposure: Option<usize>,
    round: u32,
    /// Nothing more comes of this round.
    is_last: bool,
}

impl Step {
    /// What came with a frame that continues no round: at a round's end, that it is not complete.
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

    /// A frame arrives, `late` frames after the one that was exposed when it could have.
    fn arrive(&mut self, frame: u32, late: u32) -> Step {
        let wanted = (frame % self.count) as usize;
        // All settings but the one that holds now and those to come are history.
        while self.settings.get(1).is_some_and(|&(from, _)| from <= frame) {
            self.settings.pop_front();
        }
        let has = self.settings.front().filter(|&&(from, _)| from <= frame).map(|&(_, exposure)| exposure);
        let is_neighbour = self.last == frame.checked_sub(1);
        self.last = Some(frame);
        let from = frame.saturating_add(late).saturating_add(self.latency_frames);
        let next = (from % self.count) as usize;
        // What was to hold from then on has been overruled.
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
