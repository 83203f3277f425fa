use crate::error::Result;
use crate::rt::stage::{Flow, Stage, Tick};
use crate::rt::{CaptureEpoch, Clock};
use crate::source::{self, Next};
use lightcast_core::image::Frame;

/// Takes frames from a source and releases each at its capture time, counted from the first frame by the
/// clock: under a simulated clock that is at once.
pub struct Source<S> {
    source: S,
    clock: Clock,
    /// Time of the clock at capture time 0.
    start_ns: Option<i64>,
    epoch: CaptureEpoch,
}

impl<S: source::FrameSource> Source<S> {
    /// Frames of `source`, paced by `clock`; `epoch` is set when that is known, under a real clock.
    pub fn new(source: S, clock: &Clock, epoch: CaptureEpoch) -> Self {
        Self { source, clock: clock.clone(), start_ns: None, epoch }
    }
}

impl<S: source::FrameSource> Stage for Source<S> {
    type Input = Tick;
    type Output = Frame;

    fn step(&mut self, _: &Tick, frame: &mut Frame) -> Result<Flow> {
        // The source itself counts frames that it could not read in `lost_before`.
        if self.source.next(frame)? == Next::End {
            return Ok(Flow::End);
        }
        let capture_time_ns = frame.stamp.capture_time_ns;
        let start_ns = match self.start_ns {
            Some(start_ns) => start_ns,
            None => {
                let start_ns = self.clock.now_ns().saturating_sub(capture_time_ns);
                if let Some(monotonic_from_clock_ns) = self.clock.monotonic_from_clock_ns() {
                    self.epoch.set(start_ns.saturating_add(monotonic_from_clock_ns));
                }
                *self.start_ns.insert(start_ns)
            }
        };
        Ok(Flow::SendAt { time_ns: start_ns.saturating_add(capture_time_ns) })
    }
}
