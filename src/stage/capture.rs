use crate::error::{Error, Kind, Result};
use crate::rt::stage::{Flow, Stage, Tick};
use crate::rt::{BackOff, Clock, Counter, Metrics, Shutdown};
use crate::source::{BadBuffer, Captured, LiveCamera, Numbering};
use lightcast_core::image::Frame;
use std::time::Duration;

/// How patient the stage is with a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patience {
    /// A camera that gives nothing for this long is restarted.
    pub silence: Duration,
    /// Wait before the second attempt to start a lost camera; doubled with every further one.
    pub first_wait: Duration,
    /// Longest wait between two attempts.
    pub longest_wait: Duration,
    /// A camera that still gives frames this long after a start has recovered: the waits begin at the first
    /// one again.
    pub recovery: Duration,
}

impl Patience {
    /// For a camera of this rate (0: unknown): five frame times without a frame, at least two seconds, which
    /// a USB camera may need to begin.
    pub fn for_rate(frame_rate_hz: f64) -> Self {
        // Rates are above 1e-9 Hz; the time then has 158 years at most.
        let frames_s = if frame_rate_hz > 1e-9 { 5.0 / frame_rate_hz } else { 0.0 };
        Self {
            silence: Duration::from_secs_f64(frames_s.max(2.0)),
            first_wait: Duration::from_millis(100),
            longest_wait: Duration::from_secs(5),
            recovery: Duration::from_secs(1),
        }
    }
}

/// Takes frames from a camera as they come. A camera that is lost (unplugged, silent, refusing) is restarted,
/// as often as necessary, with growing waits that a shutdown interrupts; the next frame's stamp gives the
/// gap.
///
/// ```text
///            start                  start succeeds
/// ──▶ away ────────▶ (attempt) ────────────────────▶ streaming ──▶ frames
///      ▲                 │ fails: wait, twice as long      │ lost or silent
///      └─────────────────┴─────────────────────────────────┘
/// ```
///
/// Its time per item includes the wait for the camera.
pub struct Capture<C> {
    camera: C,
    patience: Patience,
    clock: Clock,
    shutdown: Shutdown,
    state: State,
    /// Attempts to start since the camera last worked: the first comes immediately, since most losses are
    /// short.
    attempts: BackOff,
    /// Time of the clock at the last start.
    started_ns: i64,
    numbering: Numbering,
    counters: Counters,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Has to be started.
    Away,
    /// Started; the last buffer, or the start, was at this time of the clock.
    Streaming { last_activity_ns: i64 },
}

/// Frames that were lost, by cause. Losses of slow readers are counted where they read.
struct Counters {
    /// Counted by the kernel and never delivered.
    dropped_by_kernel: Counter,
    /// Delivered and not used: one for each of [`BAD`].
    bad: [Counter; 4],
    out_of_order: Counter,
    /// Not taken because the camera was away, by its rate.
    missed_while_away: Counter,
    /// Times that the camera had to be started again.
    restarts: Counter,
    /// Attempts to start it, which show that the stage still tries.
    attempts: Counter,
}

/// Name of the counter of attempts to start the camera.
pub const ATTEMPTS: &str = "attempts to start the camera";

/// Longest time in one wait for the camera: a shutdown request is noticed between two waits.
const GLANCE: Duration = Duration::from_millis(50);

impl<C: LiveCamera> Capture<C> {
    /// Frames of `camera`, which takes `frame_rate_hz` (0: unknown); its losses go to named counters of
    /// `metrics`.
    pub fn new(
        camera: C,
        frame_rate_hz: f64,
        patience: Patience,
        (clock, shutdown): (&Clock, &Shutdown),
        metrics: &Metrics,
    ) -> Self {
        Self {
            camera,
            patience,
            clock: clock.clone(),
            shutdown: shutdown.clone(),
            state: State::Away,
            attempts: BackOff::new(patience.first_wait, patience.longest_wait),
            started_ns: 0,
            numbering: Numbering::new(frame_rate_hz),
            counters: Counters::new(metrics),
        }
    }

    /// One attempt to start, after the wait that is due.
    fn start(&mut self) -> Result<()> {
        let until_ns = self.clock.now_ns().saturating_add(nanoseconds(self.attempts.wait()));
        if self.attempts.attempts() > 0 && !self.clock.wait_until(until_ns, &self.shutdown) {
            return Ok(());
        }
        self.attempts.attempt();
        self.counters.attempts.add(1);
        match self.camera.start() {
            Ok(()) => {
                self.started_ns = self.clock.now_ns();
                self.state = State::Streaming { last_activity_ns: self.started_ns };
                Ok(())
            }
            Err(error) if error.kind() == Kind::LostDevice => {
                if self.attempts.is_worth_telling() {
                    tracing::warn!("{error}; trying again (attempt {})", self.attempts.attempts());
                }
                Ok(())
            }
            Err(error) => Err(error),
        }
    }

    fn lose(&mut self, error: &Error) {
        self.counters.restarts.add(1);
        // As with attempts, a camera that fails again and again does not fill the log.
        if self.attempts.attempts() == 0 || self.attempts.is_worth_telling() {
            tracing::warn!("{error}; starting it again");
        }
        self.camera.stop();
        self.numbering.restart();
        self.state = State::Away;
    }

    /// Waits once for the camera; returns whether `frame` has the next frame.
    fn glance(&mut self, last_activity_ns: i64, frame: &mut Frame) -> Result<bool> {
        let captured = match self.camera.capture(GLANCE, frame) {
            Ok(captured) => captured,
            Err(error) if error.kind() == Kind::LostDevice => {
                self.lose(&error);
                return Ok(false);
            }
            Err(error) => return Err(error),
        };
        let now_ns = self.clock.now_ns();
        let numbered = match captured {
            Captured::Nothing => {
                if now_ns.saturating_sub(last_activity_ns) >= nanoseconds(self.patience.silence) {
                    let seconds = self.patience.silence.as_secs_f64();
                    self.lose(&Error::lost_device(format!("the camera gave nothing for {seconds} s")));
                }
                return Ok(false);
            }
            Captured::Part => None,
            Captured::Bad(mark, reason) => {
                self.numbering.skip(mark);
                let (counter, what) = self.counters.of(reason);
                counter.add(1);
                if counter.get().is_power_of_two() {
                    tracing::warn!("{} {what} so far; the capture goes on", counter.get());
                }
                None
            }
            Captured::Frame(mark) => {
                let numbered = self.numbering.number(mark);
                if numbered.is_none() {
                    self.counters.out_of_order.add(1);
                }
                numbered
            }
        };
        self.state = State::Streaming { last_activity_ns: now_ns };
        let Some(numbered) = numbered else { return Ok(false) };
        self.counters.dropped_by_kernel.add(numbered.dropped_by_kernel);
        self.counters.missed_while_away.add(numbered.missed_while_away);
        if now_ns.saturating_sub(self.started_ns) >= nanoseconds(self.patience.recovery) {
            self.attempts.succeeded();
        }
        frame.stamp = numbered.stamp;
        Ok(true)
    }
}

impl<C: LiveCamera> Stage for Capture<C> {
    type Input = Tick;
    type Output = Frame;

    fn step(&mut self, _: &Tick, frame: &mut Frame) -> Result<Flow> {
        while !self.shutdown.is_requested() {
            match self.state {
                State::Away => self.start()?,
                State::Streaming { last_activity_ns } => {
                    if self.glance(last_activity_ns, frame)? {
                        return Ok(Flow::Send);
                    }
                }
            }
        }
        Ok(Flow::End)
    }
}

impl Counters {
    fn new(metrics: &Metrics) -> Self {
        Self {
            dropped_by_kernel: metrics.counter("frames dropped by the kernel"),
            bad: BAD.map(|(_, name)| metrics.counter(name)),
            out_of_order: metrics.counter("frames out of order"),
            missed_while_away: metrics.counter("frames missed while the camera was away"),
            restarts: metrics.counter("restarts of the camera"),
            attempts: metrics.counter(ATTEMPTS),
        }
    }

    /// The counter of a reason, and what it counts.
    fn of(&self, reason: BadBuffer) -> (&Counter, &'static str) {
        let index = BAD.iter().position(|(known, _)| *known == reason).unwrap_or(0);
        (&self.bad[index], BAD[index].1)
    }
}

/// Names of the counters of frames that were delivered and not used.
const BAD: [(BadBuffer, &str); 4] = [
    (BadBuffer::Faulty, "faulty frames"),
    (BadBuffer::Short, "short frames"),
    (BadBuffer::Undecodable, "undecodable frames"),
    (BadBuffer::Incomplete, "incomplete rounds of exposures"),
];

fn nanoseconds(time: Duration) -> i64 {
    i64::try_from(time.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests;
