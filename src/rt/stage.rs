//! The one loop that runs every stage.

use super::link::{Closed, Item, Received, Receiver, Sender};
use super::waits::Waits;
use super::{Clock, Metrics, Shutdown};
use crate::error::{Kind, Result};

/// One step between source and client: turns an input into an output. The loop, [`run`], handles the rest:
/// waiting, links, losses, bad frames, times.
pub trait Stage: Send {
    /// The input; [`Tick`] for a source.
    type Input: Item;
    /// The output; `()` for the last stage.
    type Output;

    /// Fills `output`, a recycled buffer with old contents, from `input`.
    ///
    /// # Errors
    /// Kind `BadFrame`: this input is lost; it is counted, also in the `lost_before` of the next one. Kind
    /// `NotNow`: the same step is taken again, with growing waits; once an end is asked for, the input is
    /// lost. Any other kind ends the service.
    fn step(&mut self, input: &Self::Input, output: &mut Self::Output) -> Result<Flow>;

    /// Called once, when no step will follow; `is_complete` says whether all inputs were processed.
    ///
    /// # Errors
    /// When something cannot be completed, such as a file.
    fn finish(&mut self, _is_complete: bool) -> Result<()> {
        Ok(())
    }
}

impl<I: Item, O> Stage for Box<dyn Stage<Input = I, Output = O>> {
    type Input = I;
    type Output = O;

    fn step(&mut self, input: &I, output: &mut O) -> Result<Flow> {
        (**self).step(input, output)
    }

    fn finish(&mut self, is_complete: bool) -> Result<()> {
        (**self).finish(is_complete)
    }
}

/// What happens to the output of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Send it.
    Send,
    /// Send it when the clock says this time; a shutdown request while waiting ends the stage.
    SendAt {
        /// Time of the clock in nanoseconds.
        time_ns: i64,
    },
    /// There is no output and there will be none.
    End,
}

/// Input of a source: permission to take the next frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tick {
    /// Frames that the source refused as bad since its last good one.
    pub lost_before: u64,
}

impl Item for Tick {
    fn lost_before(&self) -> u64 {
        self.lost_before
    }

    fn lose(&mut self, count: u64) {
        self.lost_before += count;
    }
}

/// Where the inputs of a stage come from.
pub trait Inlet: Send {
    /// The kind of item.
    type Item: Item;
    /// Waits for the next item; `None` ends the stage.
    fn receive(&mut self) -> Option<Received<'_, Self::Item>>;
}

/// Where the outputs of a stage go.
pub trait Outlet: Send {
    /// The kind of item.
    type Item;
    /// A buffer to fill.
    ///
    /// # Errors
    /// [`Closed`] ends the stage.
    fn take(&mut self) -> Result<Self::Item, Closed>;
    /// Passes a filled buffer on.
    ///
    /// # Errors
    /// [`Closed`] ends the stage.
    fn send(&mut self, item: Self::Item) -> Result<(), Closed>;
}

impl<T: Item> Inlet for Receiver<T> {
    type Item = T;

    fn receive(&mut self) -> Option<Received<'_, T>> {
        Receiver::receive(self)
    }
}

impl<T: Item> Outlet for Sender<T> {
    type Item = T;

    fn take(&mut self) -> Result<T, Closed> {
        Sender::take(self)
    }

    fn send(&mut self, item: T) -> Result<(), Closed> {
        Sender::send(self, item)
    }
}

/// Inlet of a source: a tick whenever it is ready, until shutdown is requested.
#[derive(Clone, Debug)]
pub struct Ticks(pub Shutdown);

impl Inlet for Ticks {
    type Item = Tick;

    fn receive(&mut self) -> Option<Received<'_, Tick>> {
        (!self.0.is_requested()).then(|| Received::own(Tick::default()))
    }
}

/// Outlet of the last stage.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nowhere;

impl Outlet for Nowhere {
    type Item = ();

    fn take(&mut self) -> Result<(), Closed> {
        Ok(())
    }

    fn send(&mut self, _: ()) -> Result<(), Closed> {
        Ok(())
    }
}

/// Why a stage has ended without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// There is nothing to come, nobody to send to, or everything is to end.
    WithOthers,
    /// By [`Flow::End`]: it has nothing left to do while others go on.
    ByItself,
}

/// Runs `stage` until its inlet or outlet closes, it ends or fails, and then finishes it. Bad frames are
/// counted, and each is named once in the log (the first ten of a stage; more would bury everything else).
///
/// # Errors
/// Those of [`Stage::step`] except bad frames, and those of [`Stage::finish`].
pub fn run<I, O, S>(
    mut stage: S,
    inlet: I,
    outlet: O,
    clock: &Clock,
    shutdown: &Shutdown,
    metrics: &Metrics,
) -> Result<Ended>
where
    I: Inlet,
    O: Outlet,
    S: Stage<Input = I::Item, Output = O::Item>,
{
    let outcome = steps(&mut stage, inlet, outlet, clock, shutdown, metrics);
    let finished = stage.finish(outcome.is_ok() && !shutdown.is_aborted());
    let ended = outcome?;
    finished.map(|()| ended)
}

fn steps<I, O, S>(
    stage: &mut S,
    mut inlet: I,
    mut outlet: O,
    clock: &Clock,
    shutdown: &Shutdown,
    metrics: &Metrics,
) -> Result<Ended>
where
    I: Inlet,
    O: Outlet,
    S: Stage<Input = I::Item, Output = O::Item>,
{
    let mut waits = Waits::new(shutdown, metrics);
    let mut named = Vec::new();
    let mut lost = 0;
    let Ok(mut output) = outlet.take() else { return Ok(Ended::WithOthers) };
    while let Some(mut input) = inlet.receive() {
        metrics.drops.add(input.overwritten());
        input.lose(lost);
        let (flow, elapsed_ns) = waits.step(|| stage.step(&input, &mut output));
        match flow {
            Ok(Flow::Send) => {}
            Ok(Flow::SendAt { time_ns }) if clock.wait_until(time_ns, shutdown) => {}
            Ok(Flow::SendAt { .. }) => return Ok(Ended::WithOthers),
            Ok(Flow::End) => return Ok(Ended::ByItself),
            Err(error) if error.kind() == Kind::BadFrame => {
                lost = input.lost_before() + 1;
                metrics.bad_frames.add(1);
                name_once(metrics.name(), error.to_string(), &mut named);
                continue;
            }
            Err(error) => return Err(error),
        }
        // The input is returned before waiting for the outlet, so that the previous stage can work meanwhile.
        drop(input);
        lost = 0;
        metrics.frames.add(1);
        metrics.time_ns.record(elapsed_ns);
        if outlet.send(output).is_err() {
            return Ok(Ended::WithOthers);
        }
        let Ok(next) = outlet.take() else { return Ok(Ended::WithOthers) };
        output = next;
    }
    Ok(Ended::WithOthers)
}

/// Bad frames that one stage names in the log.
const BAD_FRAMES_NAMED: usize = 10;

/// A sequence that repeats reads the same file again: `named` remembers what was logged.
fn name_once(stage: &'static str, message: String, named: &mut Vec<String>) {
    if named.len() == BAD_FRAMES_NAMED || named.contains(&message) {
        return;
    }
    tracing::warn!(stage, "bad frame, the run goes on: {message}");
    named.push(message);
    if named.len() == BAD_FRAMES_NAMED {
        tracing::warn!(stage, "further bad frames are counted, but not named");
    }
}

#[cfg(test)]
mod tests {
    use super::super::link::bounded;
    use super::*;
    use crate::error::Error;

    /// Counts up to `end`; the numbers in `bad` are bad frames.
    struct Count {
        next: u64,
        end: u64,
        bad: &'static [u64],
    }

    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    struct Number {
        value: u64,
        lost_before: u64,
    }

    impl Item for Number {
        fn lost_before(&self) -> u64 {
            self.lost_before
        }

        fn lose(&mut self, count: u64) {
            self.lost_before += count;
        }
    }

    impl Stage for Count {
        type Input = Tick;
        type Output = Number;

        fn step(&mut self, tick: &Tick, output: &mut Number) -> Result<Flow> {
            if self.next == self.end {
                return Ok(Flow::End);
            }
            *output = Number { value: self.next, lost_before: tick.lost_before };
            self.next += 1;
            if self.bad.contains(&output.value) {
                return Err(Error::bad_frame(format!("number {}", output.value)));
            }
            Ok(Flow::SendAt { time_ns: output.value as i64 * 40_000_000 })
        }
    }

    /// Refuses every number of `bad`; keeps the others.
    struct Keep<'a> {
        kept: &'a mut Vec<Number>,
        bad: &'static [u64],
    }

    impl Stage for Keep<'_> {
        type Input = Number;
        type Output = ();

        fn step(&mut self, input: &Number, (): &mut ()) -> Result<Flow> {
            if self.bad.contains(&input.value) {
                return Err(Error::bad_frame("refused"));
            }
            self.kept.push(*input);
            Ok(Flow::Send)
        }
    }

    fn count_and_keep(source: Count, refused: &'static [u64]) -> (Vec<Number>, u64, u64, i64) {
        let (clock, shutdown) = (Clock::simulated(), Shutdown::new());
        let (first, last) = (Metrics::new("count"), Metrics::new("keep"));
        let (sender, receiver) = bounded(2, &shutdown, Number::default);
        let mut kept = Vec::new();
        std::thread::scope(|scope| {
            let source =
                scope.spawn(|| run(source, Ticks(shutdown.clone()), sender, &clock, &shutdown, &first));
            let keep = Keep { kept: &mut kept, bad: refused };
            run(keep, receiver, Nowhere, &clock, &shutdown, &last).unwrap();
            source.join().unwrap().unwrap();
        });
        assert_eq!(last.frames.get() as usize, kept.len());
        (kept, first.bad_frames.get(), last.bad_frames.get(), clock.now_ns())
    }

    #[test]
    fn everything_passes_in_order_and_simulated_time_is_that_of_the_last_item() {
        let (kept, _, _, now_ns) = count_and_keep(Count { next: 0, end: 100, bad: &[] }, &[]);
        let expected: Vec<Number> = (0..100).map(|value| Number { value, lost_before: 0 }).collect();
        assert_eq!(kept, expected);
        assert_eq!(now_ns, 99 * 40_000_000);
    }

    #[test]
    fn bad_frames_are_counted_and_told_to_the_next_item_wherever_they_were_lost() {
        // 2 and 3 are lost in the source, 4 (which carries their loss) in the stage after it.
        let (kept, in_source, in_keep, _) = count_and_keep(Count { next: 0, end: 8, bad: &[2, 3, 7] }, &[4]);
        let numbers: Vec<(u64, u64)> = kept.iter().map(|n| (n.value, n.lost_before)).collect();
        assert_eq!(numbers, [(0, 0), (1, 0), (5, 3), (6, 0)]);
        assert_eq!((in_source, in_keep), (3, 1));
    }

    #[test]
    fn other_errors_end_the_stage() {
        struct Fails;
        impl Stage for Fails {
            type Input = Tick;
            type Output = ();
            fn step(&mut self, _: &Tick, (): &mut ()) -> Result<Flow> {
                Err(Error::failed("disk full"))
            }
        }
        let shutdown = Shutdown::new();
        let metrics = Metrics::new("fails");
        let outcome = run(Fails, Ticks(shutdown.clone()), Nowhere, &Clock::simulated(), &shutdown, &metrics);
        assert_eq!(outcome.unwrap_err().to_string(), "disk full");
    }

    #[test]
    fn a_source_that_waits_for_its_time_ends_on_request() {
        struct Late;
        impl Stage for Late {
            type Input = Tick;
            type Output = ();
            fn step(&mut self, _: &Tick, (): &mut ()) -> Result<Flow> {
                Ok(Flow::SendAt { time_ns: i64::MAX })
            }
        }
        let shutdown = Shutdown::new();
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| {
                run(Late, Ticks(shutdown.clone()), Nowhere, &Clock::real(), &shutdown, &Metrics::new("late"))
            });
            shutdown.request();
            waiting.join().unwrap().unwrap();
        });
    }

    #[test]
    fn a_bad_frame_is_named_once_and_only_so_many_are_named() {
        let mut named = Vec::new();
        for number in [1, 1, 2, 1] {
            name_once("source", format!("frame {number}"), &mut named);
        }
        assert_eq!(named, ["frame 1", "frame 2"]);
        (0..100).for_each(|number| name_once("source", format!("frame {number}"), &mut named));
        assert_eq!(named.len(), BAD_FRAMES_NAMED);
    }
}
