use super::Summary;
use crate::error::{Error, Result};
use crate::rt::fan_out::FanOut;
use crate::rt::link::{Copied, PartOf, Receiver, Sender};
use crate::rt::stage::{self, Ended, Inlet, Nowhere, Stage};
use crate::rt::{Clock, Metrics, Shutdown, Threads};
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Stages and the links between them, put together in the order of the data. Nothing runs before
/// [`Self::start`].
pub(super) struct Graph {
    clock: Clock,
    shutdown: Shutdown,
    metrics: Vec<Arc<Metrics>>,
    starts: Vec<Start>,
    /// The first error of an end without which the others continue.
    aside: Arc<Mutex<Option<Error>>>,
}

/// Name of the counter that says that an end has gone while the others continue.
const ENDED: &str = "ended alone";

type Start = Box<dyn FnOnce(&mut Threads) -> Result<()>>;

/// The effect on the others when an end has gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Departure {
    /// All of them end; an error is that of the service.
    EndsAll,
    /// They continue. The end is logged immediately, and an error is reported again when all have ended.
    IsTold,
}

/// The output of a stage, to which readers are added until the graph starts.
pub(super) struct Output<T>(Rc<RefCell<Option<FanOut<T>>>>);

impl<T: Copied> Output<T> {
    /// The link to the next stage of the chain.
    pub fn next(&self, (sender, receiver): (Sender<T>, Receiver<T>)) -> Receiver<T> {
        self.change(|outlet| outlet.set_next(sender));
        receiver
    }

    /// The link to an end, for copies of the first item in every block of `every` sequence numbers, or of a
    /// part of it.
    pub fn copies<P: PartOf<T> + 'static, R>(&self, (sender, receiver): (Sender<P>, R), every: u64) -> R {
        self.change(|outlet| outlet.add(sender, every));
        receiver
    }

    fn change(&self, change: impl FnOnce(&mut FanOut<T>)) {
        change(self.0.borrow_mut().as_mut().expect("readers are added before the graph starts"));
    }
}

impl Graph {
    pub fn new(clock: Clock, shutdown: &Shutdown) -> Self {
        Self {
            clock,
            shutdown: shutdown.clone(),
            metrics: Vec::new(),
            starts: Vec::new(),
            aside: Arc::default(),
        }
    }

    /// Adds a stage, on a thread with the name of `metrics`. It fills `buffer` where no next stage brings
    /// buffers of its own.
    pub fn stage<I, S>(
        &mut self,
        metrics: Arc<Metrics>,
        stage: S,
        inlet: I,
        buffer: S::Output,
    ) -> Output<S::Output>
    where
        I: Inlet + 'static,
        S: Stage<Input = I::Item> + 'static,
        S::Output: Copied + 'static,
    {
        let output = Rc::new(RefCell::new(Some(FanOut::new(buffer))));
        let outlet = output.clone();
        let (clock, shutdown) = (self.clock.clone(), self.shutdown.clone());
        self.metrics.push(metrics.clone());
        self.starts.push(Box::new(move |threads| {
            let outlet = outlet.take().expect("a graph starts once");
            threads.spawn(metrics.name(), move || {
                let outcome = stage::run(stage, inlet, outlet, &clock, &shutdown, &metrics);
                // The first stage to end ends all. Without this a source that waits for a frame's time would
                // notice only then that no reader is left.
                shutdown.request();
                outcome.map(|_| ())
            })
        }));
        Output(output)
    }

    /// Adds a stage that has no output, on a thread with the name of `metrics`.
    pub fn end<I, S>(&mut self, metrics: Arc<Metrics>, stage: S, inlet: I, departure: Departure)
    where
        I: Inlet + 'static,
        S: Stage<Input = I::Item, Output = ()> + 'static,
    {
        let (clock, shutdown, aside) = (self.clock.clone(), self.shutdown.clone(), self.aside.clone());
        self.metrics.push(metrics.clone());
        self.starts.push(Box::new(move |threads| {
            threads.spawn(metrics.name(), move || {
                let outcome = stage::run(stage, inlet, Nowhere, &clock, &shutdown, &metrics);
                if departure == Departure::EndsAll {
                    shutdown.request();
                    return outcome.map(|_| ());
                }
                if !matches!(outcome, Ok(Ended::WithOthers)) {
                    metrics.counter(ENDED).add(1);
                }
                match outcome {
                    Ok(Ended::WithOthers) => {}
                    Ok(Ended::ByItself) => {
                        tracing::warn!(
                            "{} is done, or has no reader any more; all else goes on",
                            metrics.name()
                        );
                    }
                    Err(error) => {
                        tracing::error!("{} has ended, all else goes on: {error}", metrics.name());
                        aside.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
                    }
                }
                Ok(())
            })
        }));
    }

    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    pub fn shutdown(&self) -> &Shutdown {
        &self.shutdown
    }

    /// Starts all stages, readers before their writers.
    ///
    /// # Errors
    /// Those of the system for threads; stages that had started are ended.
    pub fn start(self) -> Result<Running> {
        let mut threads = Threads::new(&self.shutdown);
        for start in self.starts.into_iter().rev() {
            start(&mut threads)?;
        }
        Ok(Running { threads, summary: Summary::of(self.metrics), aside: self.aside })
    }
}

/// Stages on their threads. The first error in time ends all of them; a panic is an error.
pub(super) struct Running {
    threads: Threads,
    pub summary: Summary,
    aside: Arc<Mutex<Option<Error>>>,
}

impl Running {
    /// Waits for the end and calls `watch` about every `interval` meanwhile.
    pub fn join(self, interval: Duration, watch: impl FnMut()) -> Result<()> {
        self.threads.join(interval, watch)?;
        // The lock is free: all threads have ended.
        match self.aside.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rt::link::{bounded, latest};
    use crate::rt::stage::{Flow, Tick, Ticks};
    use lightcast_core::image::Frame;

    struct Counts(u64);

    impl Stage for Counts {
        type Input = Tick;
        type Output = Frame;

        fn step(&mut self, _: &Tick, frame: &mut Frame) -> Result<Flow> {
            frame.stamp.sequence = self.0;
            frame.stamp.lost_before = 0;
            self.0 += 1;
            Ok(Flow::Send)
        }
    }

    /// Does `what` at frame 5.
    struct Does(fn() -> Result<Flow>);

    impl Stage for Does {
        type Input = Frame;
        type Output = Frame;

        fn step(&mut self, frame: &Frame, _: &mut Frame) -> Result<Flow> {
            if frame.stamp.sequence >= 5 { (self.0)() } else { Ok(Flow::Send) }
        }
    }

    struct Ignores;

    impl Stage for Ignores {
        type Input = Frame;
        type Output = ();

        fn step(&mut self, _: &Frame, (): &mut ()) -> Result<Flow> {
            Ok(Flow::Send)
        }
    }

    /// An endless source, a middle that does `what` at frame 5, and an end; returns how it ended.
    fn outcome(what: fn() -> Result<Flow>, is_live: bool) -> Result<()> {
        let shutdown = Shutdown::new();
        let link = || {
            if is_live { latest(&shutdown, Frame::default) } else { bounded(2, &shutdown, Frame::default) }
        };
        let mut graph = Graph::new(Clock::simulated(), &shutdown);
        let ticks = Ticks(shutdown.clone());
        let counted = graph.stage(Metrics::new("source"), Counts(0), ticks, Frame::default());
        let done = graph.stage(Metrics::new("middle"), Does(what), counted.next(link()), Frame::default());
        graph.end(Metrics::new("end"), Ignores, done.next(link()), Departure::EndsAll);
        let running = graph.start().unwrap();
        let names: Vec<_> = running.summary.stages().iter().map(|stage| stage.name()).collect();
        assert_eq!(names, ["source", "middle", "end"]);
        running.join(Duration::from_millis(1), || ())
    }

    #[test]
    fn a_panicking_stage_stops_the_service_with_an_error() {
        for is_live in [false, true] {
            let error = outcome(|| panic!("out of luck"), is_live).unwrap_err();
            assert!(error.to_string().contains("`middle` panicked"), "{error}");
            assert!(error.to_string().ends_with("out of luck"), "{error}");
        }
    }

    #[test]
    fn a_failing_stage_stops_the_service_with_its_error() {
        for is_live in [false, true] {
            let error = outcome(|| Err(Error::failed("disk full")), is_live).unwrap_err();
            assert_eq!(error.to_string(), "disk full");
        }
    }

    #[test]
    fn a_stage_that_ends_also_ends_a_source_that_waits_for_the_time_of_its_next_frame() {
        struct Rare;
        impl Stage for Rare {
            type Input = Tick;
            type Output = Frame;
            fn step(&mut self, _: &Tick, frame: &mut Frame) -> Result<Flow> {
                frame.stamp.sequence += 1;
                Ok(if frame.stamp.sequence == 1 { Flow::Send } else { Flow::SendAt { time_ns: i64::MAX } })
            }
        }
        struct Ends;
        impl Stage for Ends {
            type Input = Frame;
            type Output = ();
            fn step(&mut self, _: &Frame, (): &mut ()) -> Result<Flow> {
                Ok(Flow::End)
            }
        }
        let shutdown = Shutdown::new();
        let link = bounded(1, &shutdown, Frame::default);
        let mut graph = Graph::new(Clock::real(), &shutdown);
        let rare = graph.stage(Metrics::new("source"), Rare, Ticks(shutdown.clone()), Frame::default());
        graph.end(Metrics::new("ends"), Ends, rare.next(link), Departure::EndsAll);
        graph.start().unwrap().join(Duration::from_millis(1), || ()).unwrap();
    }

    #[test]
    fn a_stage_that_ends_lets_an_endless_source_end() {
        for is_live in [false, true] {
            outcome(|| Ok(Flow::End), is_live).unwrap();
        }
    }
}
