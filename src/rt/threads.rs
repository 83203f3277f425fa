use super::{Shutdown, contained};
use crate::error::{Error, Result};
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

/// Named threads that live and end together: the first error in time is the outcome and asks the others to
/// end; a panic is an error that aborts them. All are joined, also when this is dropped.
pub struct Threads {
    shutdown: Shutdown,
    first_error: Arc<Mutex<Option<Error>>>,
    handles: Vec<JoinHandle<()>>,
    /// Every thread holds a clone, so `ended` disconnects when the last has ended.
    alive: Option<Sender<Infallible>>,
    ended: Receiver<Infallible>,
}

impl Threads {
    /// No threads yet; they will be asked to end through `shutdown`.
    pub fn new(shutdown: &Shutdown) -> Self {
        let (alive, ended) = bounded(0);
        Self {
            shutdown: shutdown.clone(),
            first_error: Arc::default(),
            handles: Vec::new(),
            alive: Some(alive),
            ended,
        }
    }

    /// Starts a thread. Debuggers, `top -H` and panic messages show the name (its first 15 bytes).
    ///
    /// # Errors
    /// When the system cannot start another thread.
    pub fn spawn(&mut self, name: &str, body: impl FnOnce() -> Result<()> + Send + 'static) -> Result<()> {
        let (shutdown, first_error, alive) =
            (self.shutdown.clone(), self.first_error.clone(), self.alive.clone());
        let thread_name = name.to_owned();
        let guarded = move || {
            // Nothing can access what the body owned; the rest is designed for sharing.
            let (outcome, panicked) = match contained(body) {
                Ok(outcome) => (outcome, false),
                Err(message) => (Err(panic_error(&thread_name, &message)), true),
            };
            if let Err(error) = outcome {
                first_error.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
                if panicked { shutdown.abort() } else { shutdown.request() }
            }
            drop(alive);
        };
        let handle = Builder::new()
            .name(name.to_owned())
            .spawn(guarded)
            .map_err(|error| Error::failed(format!("cannot start the thread `{name}`")).because(error))?;
        self.handles.push(handle);
        Ok(())
    }

    /// Waits until all threads have ended and calls `watch` about every `interval` meanwhile.
    ///
    /// # Errors
    /// The first error in time of any thread.
    pub fn join(mut self, interval: Duration, mut watch: impl FnMut()) -> Result<()> {
        self.alive = None;
        while self.ended.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
            watch();
        }
        self.join_handles();
        match self.first_error.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    fn join_handles(&mut self) {
        for handle in self.handles.drain(..) {
            // A panic was caught inside and is in `first_error`.
            let _ = handle.join();
        }
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        if !self.handles.is_empty() {
            self.shutdown.abort();
            self.join_handles();
        }
    }
}

fn panic_error(name: &str, message: &str) -> Error {
    Error::failed(format!("the stage `{name}` panicked, which is a fault in lightcast: {message}"))
}

#[cfg(test)]
mod tests {
    use super::super::link::{Item, bounded};
    use super::super::stage::Tick;
    use super::*;

    const SHORT: Duration = Duration::from_millis(1);

    /// A thread that runs until it is asked to end.
    fn one_that_waits() -> (Shutdown, Threads) {
        let shutdown = Shutdown::new();
        let mut threads = Threads::new(&shutdown);
        let token = shutdown.clone();
        threads
            .spawn("runs", move || {
                token.wait(Duration::MAX);
                Ok(())
            })
            .unwrap();
        (shutdown, threads)
    }

    #[test]
    fn the_first_error_wins_and_asks_the_others_to_end() {
        let shutdown = Shutdown::new();
        let mut threads = Threads::new(&shutdown);
        let token = shutdown.clone();
        threads
            .spawn("second", move || {
                assert!(token.wait(Duration::MAX));
                Err(Error::failed("too late"))
            })
            .unwrap();
        threads.spawn("first", || Err(Error::usage("first"))).unwrap();
        let error = threads.join(SHORT, || ()).unwrap_err();
        assert_eq!(error.to_string(), "first");
        assert!(shutdown.is_requested());
    }

    #[test]
    fn a_panic_is_an_error_that_names_the_thread_and_ends_every_wait() {
        let shutdown = Shutdown::new();
        let (sender, mut receiver) = bounded(1, &shutdown, Tick::default);
        let mut threads = Threads::new(&shutdown);
        threads
            .spawn("waits", move || {
                assert!(receiver.receive().is_none_or(|tick| tick.lost_before() > 0));
                Ok(())
            })
            .unwrap();
        threads.spawn("light", || panic!("index {} out of range", 7)).unwrap();
        let error = threads.join(SHORT, || ()).unwrap_err();
        assert!(error.to_string().contains("`light` panicked"), "{error}");
        assert!(error.to_string().contains("index 7 out of range"), "{error}");
        drop(sender);
    }

    #[test]
    fn the_watcher_is_called_while_threads_run() {
        let (shutdown, threads) = one_that_waits();
        let mut calls = 0;
        threads
            .join(SHORT, || {
                calls += 1;
                if calls == 3 {
                    shutdown.request();
                }
            })
            .unwrap();
        assert!(calls >= 3);
    }

    #[test]
    fn dropping_unjoined_threads_ends_them() {
        let (shutdown, threads) = one_that_waits();
        drop(threads);
        assert!(shutdown.is_requested());
    }
}
