use crate::error::{Kind, Result};
use crate::rt::stage::{Flow, Stage, Tick};
use crate::rt::{CaptureEpoch, Clock, Shutdown};
use crate::source::{self, Next};
use lightcast_core::image::Frame;

/// Takes frames from a source and releases each at its capture time, counted from the first frame by the
/// clock: under a simulated clock that is at once. A bad frame takes the time of one frame too, so that a
/// folder that is away for half a second costs half a second of frames. Where the source has nothing for now,
/// the time that this takes is not made up for: the next frame is released as the first one was.
pub struct Source<S> {
    source: S,
    frame_interval_ns: i64,
    clock: Clock,
    shutdown: Shutdown,
    /// Time of the clock at capture time 0.
    start_ns: Option<i64>,
    /// Time of the clock at which the last frame was due.
    due_ns: Option<i64>,
    epoch: CaptureEpoch,
}

impl<S: source::FrameSource> Source<S> {
    /// Frames of `source`, `frame_rate_hz` of them a second (0: unknown), paced by `clock`; `epoch` is set
    /// when that is known, under a real clock.
    pub fn new(
        source: S,
        frame_rate_hz: f64,
        (clock, shutdown): (&Clock, &Shutdown),
        epoch: CaptureEpoch,
    ) -> Self {
        let frame_interval_ns = if frame_rate_hz > 0.0 { (1e9 / frame_rate_hz) as i64 } else { 0 };
        let (clock, shutdown) = (clock.clone(), shutdown.clone());
        Self { source, frame_interval_ns, clock, shutdown, start_ns: None, due_ns: None, epoch }
    }

    /// Waits for as long as a frame lasts.
    fn pass_over(&mut self) {
        let due_ns = match self.due_ns {
            Some(due_ns) => due_ns.saturating_add(self.frame_interval_ns),
            None => self.clock.now_ns(),
        };
        self.due_ns = Some(due_ns);
        // The loop sees for itself when an end is asked for.
        self.clock.wait_until(due_ns, &self.shutdown);
    }

    fn start_ns(&mut self, capture_time_ns: i64) -> i64 {
        if let Some(start_ns) = self.start_ns {
            return start_ns;
        }
        let start_ns = self.clock.now_ns().saturating_sub(capture_time_ns);
        if let Some(monotonic_from_clock_ns) = self.clock.monotonic_from_clock_ns() {
            self.epoch.set(start_ns.saturating_add(monotonic_from_clock_ns));
        }
        *self.start_ns.insert(start_ns)
    }
}

impl<S: source::FrameSource> Stage for Source<S> {
    type Input = Tick;
    type Output = Frame;

    fn step(&mut self, _: &Tick, frame: &mut Frame) -> Result<Flow> {
        // The source itself counts frames that it could not read in `lost_before`.
        match self.source.next(frame) {
            Ok(Next::End) => return Ok(Flow::End),
            Ok(Next::Frame) => {}
            Err(error) => {
                match error.kind() {
                    Kind::BadFrame => self.pass_over(),
                    Kind::NotNow => (self.start_ns, self.due_ns) = (None, None),
                    _ => {}
                }
                return Err(error);
            }
        }
        let capture_time_ns = frame.stamp.capture_time_ns;
        let time_ns = self.start_ns(capture_time_ns).saturating_add(capture_time_ns);
        self.due_ns = Some(time_ns);
        Ok(Flow::SendAt { time_ns })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::source::FrameSource;

    const FRAME_NS: i64 = 40_000_000;

    /// Frames of 25 a second; what it has for each, in order.
    struct Script(Vec<Kind>, i64);

    impl FrameSource for Script {
        fn next(&mut self, frame: &mut Frame) -> Result<Next> {
            let kind = self.0.remove(0);
            if kind == Kind::NotNow {
                return Err(Error::not_now("away"));
            }
            frame.stamp.capture_time_ns = FRAME_NS * self.1;
            self.1 += 1;
            if kind == Kind::BadFrame { Err(Error::bad_frame("gone")) } else { Ok(Next::Frame) }
        }
    }

    #[test]
    fn bad_frames_take_their_time_and_a_time_with_nothing_is_not_made_up_for() {
        let (clock, shutdown) = (Clock::simulated(), Shutdown::new());
        let (good, bad) = (Kind::Failed, Kind::BadFrame);
        let script = Script(vec![good, bad, bad, good, bad, Kind::NotNow, good, good], 0);
        let mut source = Source::new(script, 25.0, (&clock, &shutdown), CaptureEpoch::default());
        let mut step = || match source.step(&Tick::default(), &mut Frame::default()) {
            Ok(Flow::SendAt { time_ns }) => {
                clock.wait_until(time_ns, &shutdown);
                Ok(time_ns / FRAME_NS)
            }
            Ok(other) => panic!("{other:?}"),
            Err(_) => Err(clock.now_ns() / FRAME_NS),
        };
        assert_eq!([0; 4].map(|_| step()), [Ok(0), Err(1), Err(2), Ok(3)]);
        assert_eq!([0; 2].map(|_| step()), [Err(4), Err(4)]);
        // A while later.
        clock.wait_until(100 * FRAME_NS, &shutdown);
        assert_eq!([0; 2].map(|_| step()), [Ok(100), Ok(101)]);
    }
}
