use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TryRecvError, bounded};
use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// A request to end that all threads share; clones share it too. It has two levels, so that an orderly end
/// loses no list that is already in progress:
///
/// - [`request`](Self::request): sources take no further frame; items in the links are still processed.
/// - [`abort`](Self::abort): every wait, in links too, ends at once. A panic leads to this.
#[derive(Clone, Debug)]
pub struct Shutdown {
    request: Signal,
    abort: Signal,
}

impl Shutdown {
    /// Nothing has been requested yet.
    pub fn new() -> Self {
        Self { request: Signal::new(), abort: Signal::new() }
    }

    /// Requests an orderly end. May be called repeatedly and from any thread.
    pub fn request(&self) {
        self.request.raise();
    }

    /// Ends every wait at once.
    pub fn abort(&self) {
        self.request.raise();
        self.abort.raise();
    }

    /// Whether an end of either level was requested.
    pub fn is_requested(&self) -> bool {
        self.request.is_raised()
    }

    /// Whether every wait was ended at once.
    pub fn is_aborted(&self) -> bool {
        self.abort.is_raised()
    }

    /// Waits for `time` or until an end is requested; returns whether it was.
    pub fn wait(&self, time: Duration) -> bool {
        if time.is_zero() {
            return self.is_requested();
        }
        // Nothing is ever sent, so there are only these two answers.
        self.request.raised.recv_timeout(time) == Err(RecvTimeoutError::Disconnected)
    }

    /// Becomes ready (disconnected) on [`abort`](Self::abort), for the waits of links.
    pub(super) fn aborted(&self) -> &Receiver<Infallible> {
        &self.abort.raised
    }
}

impl Default for Shutdown {
    fn default() -> Self {
        Self::new()
    }
}

/// A flag that channel operations can wait for: raising it closes a channel on which nothing is ever sent.
#[derive(Clone, Debug)]
struct Signal {
    open: Arc<Mutex<Option<Sender<Infallible>>>>,
    raised: Receiver<Infallible>,
}

impl Signal {
    fn new() -> Self {
        // Not 0: a wait on a channel of capacity 0 allocates every time, and links wait for this in every
        // frame.
        let (open, raised) = bounded(1);
        Self { open: Arc::new(Mutex::new(Some(open))), raised }
    }

    fn raise(&self) {
        // Taking an Option cannot leave it half done, so a poisoned lock does no harm.
        self.open.lock().unwrap_or_else(PoisonError::into_inner).take();
    }

    fn is_raised(&self) -> bool {
        self.raised.try_recv() == Err(TryRecvError::Disconnected)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_reaches_every_clone_and_leaves_links_open() {
        let shutdown = Shutdown::new();
        let other = shutdown.clone();
        assert!(!other.is_requested() && !other.wait(Duration::ZERO));
        shutdown.request();
        shutdown.request();
        assert!(other.is_requested() && other.wait(Duration::MAX));
        assert!(!other.abort.is_raised());
        other.abort();
        assert!(shutdown.abort.is_raised());
    }

    #[test]
    fn waiting_ends_in_time_when_nobody_asks() {
        assert!(!Shutdown::new().wait(Duration::from_micros(10)));
    }
}
