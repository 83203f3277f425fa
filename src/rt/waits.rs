use super::{BackOff, Counter, Metrics, Shutdown};
use crate::error::{Error, Kind, Result};
use std::time::{Duration, Instant};

/// Name of the counter of waits for what could not be had.
pub const WAITS: &str = "waits for what could not be had";

/// The wait before a step is tried again the first time, which is doubled with every further try, and the
/// longest.
const FIRST_WAIT: Duration = Duration::from_millis(100);
const LONGEST_WAIT: Duration = Duration::from_secs(5);

/// The waits of one stage for what it cannot have for now, such as a file handle.
pub(super) struct Waits<'a> {
    shutdown: &'a Shutdown,
    metrics: &'a Metrics,
    /// Since the last step that succeeded.
    back_off: BackOff,
    /// Made with the first wait: most stages never wait.
    counter: Option<Counter>,
}

impl<'a> Waits<'a> {
    pub fn new(shutdown: &'a Shutdown, metrics: &'a Metrics) -> Self {
        Self { shutdown, metrics, back_off: BackOff::new(FIRST_WAIT, LONGEST_WAIT), counter: None }
    }

    /// Takes a step until it gets what it needs; returns its outcome, and the time of the last try in
    /// nanoseconds. Once an end is asked for, nothing more is waited for: a lack is then a bad frame.
    pub fn step<T>(&mut self, mut step: impl FnMut() -> Result<T>) -> (Result<T>, u64) {
        loop {
            let started = Instant::now();
            let outcome = step();
            let elapsed_ns = u64::try_from(started.elapsed().as_nanos()).unwrap_or(u64::MAX);
            match outcome {
                Err(error) if error.kind() == Kind::NotNow => {
                    if self.wait(&error) {
                        return (Err(error.with_kind(Kind::BadFrame)), elapsed_ns);
                    }
                }
                Ok(done) => {
                    if self.back_off.attempts() > 0 {
                        tracing::info!("{}: goes on", self.metrics.name());
                        self.back_off.succeeded();
                    }
                    return (Ok(done), elapsed_ns);
                }
                failed => return (failed, elapsed_ns),
            }
        }
    }

    /// Waits before the next try; returns whether an end was asked for.
    fn wait(&mut self, error: &Error) -> bool {
        self.back_off.attempt();
        self.counter.get_or_insert_with(|| self.metrics.counter(WAITS)).add(1);
        if self.back_off.is_worth_telling() {
            tracing::warn!("{}: {error}; trying again", self.metrics.name());
        }
        self.shutdown.wait(self.back_off.wait())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_taken_again_until_it_gets_what_it_needs() {
        let (shutdown, metrics) = (Shutdown::new(), Metrics::new("record"));
        let mut waits = Waits::new(&shutdown, &metrics);
        let mut tries = 0;
        let (outcome, _) = waits.step(|| {
            tries += 1;
            if tries < 3 { Err(Error::not_now("no file handle is left")) } else { Ok(tries) }
        });
        assert_eq!((outcome.unwrap(), metrics.counters()), (3, vec![(WAITS, 2)]));
        assert_eq!(waits.back_off.wait(), Duration::ZERO, "the next lack is a first one");
    }

    #[test]
    fn nothing_is_waited_for_once_an_end_is_asked_for() {
        let (shutdown, metrics) = (Shutdown::new(), Metrics::new("record"));
        shutdown.request();
        let (outcome, _) =
            Waits::new(&shutdown, &metrics).step(|| -> Result<()> { Err(Error::not_now("none is left")) });
        assert_eq!(outcome.unwrap_err().kind(), Kind::BadFrame);
        let (outcome, _) =
            Waits::new(&shutdown, &metrics).step(|| -> Result<()> { Err(Error::failed("disk")) });
        assert_eq!(outcome.unwrap_err().kind(), Kind::Failed, "other faults are not waited out");
    }
}
