//! The state machine under a scripted camera and a simulated clock: every transition, every counter.

use super::*;
use crate::source::Mark;
use crossbeam_channel::{Sender, bounded};
use lightcast_core::image::Stamp;
use std::collections::VecDeque;

/// What the scripted camera does next; times in milliseconds of the simulated clock.
#[derive(Clone, Copy, Debug)]
enum Event {
    /// `start` succeeds, after this time.
    Starts,
    /// `start` fails with an error of this kind.
    Refuses(Kind),
    /// A frame with this count comes.
    Frame(u32),
    /// A frame with this count comes and cannot be used.
    Bad(u32, BadBuffer),
    /// A part of a frame comes.
    Part,
    /// Nothing comes for this time.
    Silence(i64),
    /// The stream fails with an error of this kind.
    Fails(Kind),
    /// A shutdown is requested.
    Shutdown,
}

use Event::{Bad, Fails, Frame as Picture, Refuses, Silence, Starts};

struct Scripted {
    script: VecDeque<Event>,
    clock: Clock,
    shutdown: Shutdown,
    /// Times of all calls of `start`.
    starts_ms: Vec<i64>,
    stops: usize,
}

/// Frames come every 40 ms.
const FRAME_MS: i64 = 40;

impl Scripted {
    fn pass(&self, time_ms: i64) {
        // Simulated time passes immediately, and waiting never fails.
        self.clock.wait_until(self.clock.now_ns() + time_ms * 1_000_000, &Shutdown::new());
    }

    fn mark(&self, sequence: u32) -> Mark {
        self.pass(FRAME_MS);
        Mark { sequence, time_ns: self.clock.now_ns(), age_ns: 0 }
    }
}

fn fault(kind: Kind) -> Error {
    Error::failed("scripted").with_kind(kind)
}

impl LiveCamera for Scripted {
    fn start(&mut self) -> Result<()> {
        self.starts_ms.push(self.clock.now_ns() / 1_000_000);
        match self.script.pop_front() {
            Some(Starts) => Ok(()),
            Some(Refuses(kind)) => Err(fault(kind)),
            other => panic!("started, but the script says {other:?}"),
        }
    }

    fn capture(&mut self, patience: Duration, _: &mut Frame) -> Result<Captured> {
        match self.script.pop_front() {
            Some(Picture(sequence)) => Ok(Captured::Frame(self.mark(sequence))),
            Some(Bad(sequence, reason)) => Ok(Captured::Bad(self.mark(sequence), reason)),
            Some(Silence(rest_ms)) => {
                let glance_ms = (patience.as_millis() as i64).min(rest_ms);
                self.pass(glance_ms);
                if rest_ms > glance_ms {
                    self.script.push_front(Silence(rest_ms - glance_ms));
                }
                Ok(Captured::Nothing)
            }
            Some(Event::Part) => Ok(Captured::Part),
            Some(Fails(kind)) => Err(fault(kind)),
            Some(Event::Shutdown) => {
                self.shutdown.request();
                Ok(Captured::Nothing)
            }
            other => panic!("asked for a frame, but the script says {other:?}"),
        }
    }

    fn stop(&mut self) {
        self.stops += 1;
    }
}

const PATIENCE: Patience = Patience {
    silence: Duration::from_millis(1000),
    first_wait: Duration::from_millis(100),
    longest_wait: Duration::from_millis(500),
    // One frame's time.
    recovery: Duration::from_millis(40),
};

/// The outcome of a script.
struct Outcome {
    /// Sequence number and loss of every frame.
    frames: Vec<(u64, u64)>,
    end: Result<Flow>,
    starts_ms: Vec<i64>,
    stops: usize,
    counters: Vec<(&'static str, u64)>,
}

impl Outcome {
    /// Counters in the order of their creation: kernel, faulty, short, undecodable, incomplete, out of order,
    /// away, restarts; the number of attempts, which comes last, is that of the starts.
    fn counts(&self) -> Vec<u64> {
        let (attempts, others) = self.counters.split_last().unwrap();
        assert_eq!(*attempts, (ATTEMPTS, self.starts_ms.len() as u64));
        others.iter().map(|counter| counter.1).collect()
    }
}

/// Runs the stage until it ends or fails; a script that does not end by itself is ended.
fn play(script: &[Event]) -> Outcome {
    play_with(PATIENCE, script)
}

fn play_with(patience: Patience, script: &[Event]) -> Outcome {
    let (clock, shutdown, metrics) = (Clock::simulated(), Shutdown::new(), Metrics::new("source"));
    let camera = Scripted {
        script: script.iter().copied().chain([Event::Shutdown]).collect(),
        clock: clock.clone(),
        shutdown: shutdown.clone(),
        starts_ms: Vec::new(),
        stops: 0,
    };
    let mut stage = Capture::new(camera, 25.0, patience, (&clock, &shutdown), &metrics);
    let mut frames = Vec::new();
    let mut frame = Frame::default();
    let end = loop {
        match stage.step(&Tick::default(), &mut frame) {
            Ok(Flow::Send) => {
                let Stamp { sequence, lost_before, frame_rate_hz, .. } = frame.stamp;
                assert_eq!(frame_rate_hz, 25.0);
                frames.push((sequence, lost_before));
            }
            end => break end,
        }
    };
    let Scripted { starts_ms, stops, .. } = stage.camera;
    Outcome { frames, end, starts_ms, stops, counters: metrics.counters() }
}

#[test]
fn frames_pass_with_their_numbers() {
    let outcome = play(&[Starts, Picture(0), Picture(1), Picture(2)]);
    assert_eq!(outcome.frames, [(0, 0), (1, 0), (2, 0)]);
    assert_eq!(outcome.end.unwrap(), Flow::End, "on request");
    assert_eq!((outcome.starts_ms, outcome.stops), (vec![0], 0));
}

#[test]
fn what_the_kernel_drops_and_what_cannot_be_used_are_told_apart() {
    let outcome = play(&[
        Starts,
        Picture(0),
        Picture(3),
        Bad(4, BadBuffer::Faulty),
        Bad(5, BadBuffer::Short),
        Bad(6, BadBuffer::Undecodable),
        Picture(7),
        Picture(2),
        Picture(8),
    ]);
    assert_eq!(outcome.frames, [(0, 0), (3, 2), (7, 3), (8, 0)]);
    assert_eq!(outcome.counts(), [2, 1, 1, 1, 0, 1, 0, 0]);
    assert_eq!(outcome.counters[0].0, "frames dropped by the kernel");
}

#[test]
fn a_lost_camera_is_started_at_once_and_the_gap_is_told() {
    let outcome = play(&[Starts, Picture(9), Fails(Kind::LostDevice), Starts, Picture(0), Picture(1)]);
    assert_eq!(outcome.starts_ms, [0, FRAME_MS]);
    assert_eq!(outcome.stops, 1);
    assert_eq!(outcome.frames, [(0, 0), (1, 0), (2, 0)], "it came back within a frame's time");
    assert_eq!(outcome.counts(), [0, 0, 0, 0, 0, 0, 0, 1]);
}

#[test]
fn attempts_that_fail_wait_longer_each_time_up_to_a_limit() {
    let refused = Refuses(Kind::LostDevice);
    let script = [Starts, Picture(0), Fails(Kind::LostDevice), refused, refused, refused, refused, refused];
    let outcome = play(&[&script[..], &[Starts, Picture(0)]].concat());
    // 40 ms: the first frame; then waits of 0, 100, 200, 400, 500 and 500 ms.
    assert_eq!(outcome.starts_ms, [0, 40, 140, 340, 740, 1240, 1740]);
    // The frame at 1780 ms is 43.5 frame times after the one at 40 ms.
    assert_eq!(outcome.frames, [(0, 0), (44, 43)]);
    assert_eq!(outcome.counts(), [0, 0, 0, 0, 0, 0, 43, 1]);
}

#[test]
fn a_good_frame_ends_the_growth_of_the_waits() {
    let refused = Refuses(Kind::LostDevice);
    let lost = Fails(Kind::LostDevice);
    let outcome = play(&[
        Starts,
        Picture(0),
        lost,
        refused,
        refused,
        Starts,
        Picture(0),
        lost,
        refused,
        Starts,
        Picture(0),
    ]);
    let waits: Vec<i64> = outcome.starts_ms.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert_eq!(waits, [40, 100, 200, 40, 100]);
}

#[test]
fn a_stream_that_starts_and_gives_nothing_is_not_started_in_a_fury() {
    let silence = Silence(1000);
    let outcome = play(&[Starts, silence, Starts, silence, Starts, silence, Starts, Picture(0)]);
    assert_eq!(outcome.starts_ms, [0, 1100, 2300, 3700], "silence of 1 s, then 100, 200, 400 ms");
    assert_eq!(outcome.counts(), [0, 0, 0, 0, 0, 0, 0, 3]);
    assert_eq!(outcome.frames, [(0, 0)]);
}

#[test]
fn bad_frames_and_short_silences_are_signs_of_life() {
    let outcome =
        play(&[Starts, Silence(900), Bad(0, BadBuffer::Faulty), Silence(900), Picture(1), Silence(900)]);
    assert_eq!((outcome.starts_ms.len(), outcome.stops), (1, 0));
    assert_eq!(outcome.frames, [(0, 0)], "nothing is lost before the first frame");
}

#[test]
fn errors_that_no_waiting_mends_end_the_stage() {
    for kind in [Kind::Usage, Kind::Failed] {
        let outcome = play(&[Starts, Picture(0), Fails(Kind::LostDevice), Refuses(kind)]);
        assert_eq!(outcome.end.unwrap_err().kind(), kind);
        let outcome = play(&[Starts, Fails(kind)]);
        assert_eq!(outcome.end.unwrap_err().kind(), kind);
    }
}

#[test]
fn a_request_to_end_interrupts_the_wait_for_a_lost_camera() {
    /// Reports that it is asked to start, and never starts.
    struct Gone(Sender<()>);
    impl LiveCamera for Gone {
        fn start(&mut self) -> Result<()> {
            self.0.send(()).unwrap();
            Err(fault(Kind::LostDevice))
        }
        fn capture(&mut self, _: Duration, _: &mut Frame) -> Result<Captured> {
            Err(fault(Kind::LostDevice))
        }
        fn stop(&mut self) {}
    }
    let (clock, shutdown) = (Clock::real(), Shutdown::new());
    let century = Patience { first_wait: Duration::MAX, longest_wait: Duration::MAX, ..PATIENCE };
    let metrics = Metrics::new("source");
    let (started, starts) = bounded(1);
    let mut stage = Capture::new(Gone(started), 25.0, century, (&clock, &shutdown), &metrics);
    std::thread::scope(|scope| {
        let waiting = scope.spawn(|| stage.step(&Tick::default(), &mut Frame::default()));
        starts.recv().unwrap();
        shutdown.request();
        assert_eq!(waiting.join().unwrap().unwrap(), Flow::End);
    });
    assert_eq!(stage.attempts.attempts(), 1, "it waited for the second");
}

#[test]
fn a_camera_that_dies_after_every_frame_is_given_time() {
    let lost = Fails(Kind::LostDevice);
    // Frames come 40 ms after a start, which counts as recovered; 39 ms would be too early.
    let script = [Starts, Picture(0), lost, Starts, Picture(0), lost, Starts, Picture(0)];
    let patient = Patience { recovery: Duration::from_millis(41), ..PATIENCE };
    assert_eq!(play_with(patient, &script).starts_ms, [0, 140, 380]);
    assert_eq!(play(&script).starts_ms, [0, 40, 80]);
}

#[test]
fn parts_of_a_frame_are_signs_of_life() {
    let outcome =
        play(&[Starts, Silence(900), Event::Part, Silence(900), Event::Part, Silence(900), Picture(0)]);
    assert_eq!((outcome.starts_ms.len(), outcome.frames), (1, vec![(0, 0)]));
}
