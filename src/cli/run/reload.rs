//! Work that is done aside, while a service runs and signals are heard.

use crate::error::{Error, Result};
use crossbeam_channel::{Receiver, TryRecvError, bounded};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// Longest time for a configuration to be prepared: the largest maps take some seconds.
const WITHIN: Duration = Duration::from_secs(60);

/// Work on a thread of its own, for a limited time.
pub(super) struct Aside<T> {
    outcome: Receiver<Result<T>>,
    thread: Option<JoinHandle<()>>,
    until: Instant,
    is_told: bool,
}

impl<T: Send + 'static> Aside<T> {
    /// Starts `work`.
    ///
    /// # Errors
    /// When the system cannot start another thread.
    pub fn start(work: impl FnOnce() -> Result<T> + Send + 'static) -> Result<Self> {
        Self::start_within(WITHIN, work)
    }

    fn start_within(limit: Duration, work: impl FnOnce() -> Result<T> + Send + 'static) -> Result<Self> {
        let (sender, outcome) = bounded(1);
        let thread = Builder::new()
            .name("prepare".to_owned())
            .spawn(move || {
                // Nobody waits any more where the time was up.
                let _ = sender.send(work());
            })
            .map_err(|error| Error::failed("cannot start the thread `prepare`").because(error))?;
        Ok(Self { outcome, thread: Some(thread), until: Instant::now() + limit, is_told: false })
    }

    /// What has come of it, once; `None`: it is not done. Where the time is up, that is an error, and the
    /// thread is left to end by itself: what hangs in the system cannot be ended.
    pub fn poll(&mut self) -> Option<Result<T>> {
        if self.is_told {
            return None;
        }
        let outcome = match self.outcome.try_recv() {
            Ok(outcome) => {
                self.join();
                outcome
            }
            Err(TryRecvError::Empty) if Instant::now() < self.until => return None,
            Err(TryRecvError::Empty) => {
                Err(Error::failed(format!("it could not be prepared within {} s", WITHIN.as_secs())))
            }
            Err(TryRecvError::Disconnected) => {
                self.join();
                Err(Error::failed("its preparation panicked, which is a fault in lightcast"))
            }
        };
        self.is_told = true;
        Some(outcome)
    }

    /// Whether it still is to be told what has come of it.
    pub fn is_waited_for(&self) -> bool {
        !self.is_told
    }

    /// Whether its thread has not ended, even where its time is up.
    pub fn hangs(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    fn join(&mut self) {
        if let Some(thread) = self.thread.take() {
            // A panic is told by what did not come.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rt::Shutdown;

    fn outcome<T: Send + 'static>(aside: &mut Aside<T>) -> Result<T> {
        loop {
            if let Some(outcome) = aside.poll() {
                return outcome;
            }
            Shutdown::new().wait(Duration::from_millis(1));
        }
    }

    #[test]
    fn what_is_done_is_told_and_what_panics_and_what_hangs_too() {
        assert_eq!(outcome(&mut Aside::start(|| Ok(7)).unwrap()).unwrap(), 7);
        let mut panics = Aside::<()>::start(|| panic!("of a test")).unwrap();
        assert!(outcome(&mut panics).unwrap_err().to_string().contains("panicked"));
        let end = Shutdown::new();
        let ends = end.clone();
        let hang = move || {
            ends.wait(Duration::MAX);
            Ok(())
        };
        let mut hangs = Aside::start_within(Duration::from_millis(20), hang).unwrap();
        assert!(outcome(&mut hangs).unwrap_err().to_string().contains("not be prepared within"));
        assert!(hangs.hangs());
        end.request();
    }
}
