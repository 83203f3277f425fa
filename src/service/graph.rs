use super::Summary;
use crate::error::{Error, Result};
use crate::rt::stage::{self, Inlet, Nowhere, Outlet, Stage};
use crate::rt::{Clock, Metrics, Shutdown, Threads};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Stages on their threads. The first error in time ends all of them; a panic is an error.
pub(super) struct Graph {
    threads: Threads,
    clock: Clock,
    shutdown: Shutdown,
    metrics: Vec<Arc<Metrics>>,
    /// The first error of a stage beside the others.
    aside: Arc<Mutex<Option<Error>>>,
}

impl Graph {
    pub fn new(clock: Clock, shutdown: &Shutdown) -> Self {
        Self {
            threads: Threads::new(shutdown),
            clock,
            shutdown: shutdown.clone(),
            metrics: Vec::new(),
            aside: Arc::default(),
        }
    }

    /// Runs `stage` on a thread that is called what `metrics` are called.
    pub fn spawn<I, O, S>(&mut self, metrics: Arc<Metrics>, stage: S, inlet: I, outlet: O) -> Result<()>
    where
        I: Inlet + 'static,
        O: Outlet + 'static,
        S: Stage<Input = I::Item, Output = O::Item> + 'static,
    {
        let (clock, shutdown) = (self.clock.clone(), self.shutdown.clone());
        // Readers are started before their writers; the summary follows the data.
        self.metrics.insert(0, metrics.clone());
        self.threads.spawn(metrics.name(), move || {
            let outcome = stage::run(stage, inlet, outlet, &clock, &shutdown, &metrics);
            // Whoever ends first ends all. Without this a source that waits for a frame's time would find out only
            // when it has come that nobody reads any more.
            shutdown.request();
            outcome
        })
    }

    /// Runs `stage` beside the others: its end is not theirs unless `is_alone`, and its failure is told when all have
    /// ended. `finish` runs when the stage has ended and learns whether it has worked off everything.
    pub fn spawn_aside<I, S>(
        &mut self,
        metrics: Arc<Metrics>,
        mut stage: S,
        inlet: I,
        is_alone: bool,
        finish: impl FnOnce(&mut S, bool) -> Result<()> + Send + 'static,
    ) -> Result<()>
    where
        I: Inlet + 'static,
        S: Stage<Input = I::Item, Output = ()> + 'static,
    {
        let (clock, shutdown, aside) = (self.clock.clone(), self.shutdown.clone(), self.aside.clone());
        self.metrics.push(metrics.clone());
        self.threads.spawn(metrics.name(), move || {
            let outcome = stage::run(&mut stage, inlet, Nowhere, &clock, &shutdown, &metrics);
            let finished = finish(&mut stage, outcome.is_ok() && !shutdown.is_aborted());
            if is_alone {
                shutdown.request();
            }
            if let Err(error) = outcome.and(finished) {
                if !is_alone {
                    tracing::error!("{} has ended, all else goes on: {error}", metrics.name());
                }
                aside.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
            }
            Ok(())
        })
    }

    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    pub fn shutdown(&self) -> &Shutdown {
        &self.shutdown
    }

    pub fn summary(&self) -> Summary {
        Summary::of(self.metrics.clone())
    }

    /// Waits for the end and calls `watch` about every `interval` meanwhile.
    pub fn join(self, interval: Duration, watch: impl FnMut()) -> Result<()> {
        self.threads.join(interval, watch)?;
        // Nobody else holds it: all threads have ended.
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
        let (first, second) = (link(), link());
        let mut graph = Graph::new(Clock::simulated(), &shutdown);
        graph.spawn(Metrics::new("source"), Counts(0), Ticks(shutdown.clone()), first.0).unwrap();
        graph.spawn(Metrics::new("middle"), Does(what), first.1, second.0).unwrap();
        graph.spawn(Metrics::new("end"), Ignores, second.1, Nowhere).unwrap();
        assert_eq!(graph.summary().stages().len(), 3);
        graph.join(Duration::from_millis(1), || ())
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
        graph.spawn(Metrics::new("ends"), Ends, link.1, Nowhere).unwrap();
        graph.spawn(Metrics::new("source"), Rare, Ticks(shutdown.clone()), link.0).unwrap();
        graph.join(Duration::from_millis(1), || ()).unwrap();
    }

    #[test]
    fn a_stage_that_ends_lets_an_endless_source_end() {
        for is_live in [false, true] {
            outcome(|| Ok(Flow::End), is_live).unwrap();
        }
    }
}
