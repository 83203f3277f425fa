//! Ctrl-C and `kill`: the first asks for an orderly end, the second ends the process at once. A service also
//! handles SIGHUP.

use crate::error::{Error, Result};
use crate::rt::Shutdown;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::{Handle, Signals};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};

/// Hands SIGINT and SIGTERM to a [`Shutdown`] until it is dropped.
///
/// The second signal exits with 128 plus its number, as a shell reports a process that a signal ended. A line
/// that is being written may then be cut off.
pub(super) struct SignalWatch {
    handle: Handle,
    thread: Option<JoinHandle<()>>,
    hangup: Arc<AtomicBool>,
    interrupted: Shutdown,
}

impl SignalWatch {
    pub fn start(shutdown: &Shutdown) -> Result<Self> {
        Self::watch(shutdown, &[SIGINT, SIGTERM])
    }

    /// SIGHUP as well, which otherwise ends a program: see [`Self::take_hangup`].
    pub fn start_with_hangup(shutdown: &Shutdown) -> Result<Self> {
        Self::watch(shutdown, &[SIGINT, SIGTERM, SIGHUP])
    }

    /// Whether SIGHUP came since the last call.
    pub fn take_hangup(&self) -> bool {
        self.hangup.swap(false, Ordering::AcqRel)
    }

    /// Is requested by SIGINT and SIGTERM only, where the one given at the start also is when work is done.
    #[cfg_attr(not(feature = "render"), expect(dead_code, reason = "only rendering takes long enough"))]
    pub fn interrupted(&self) -> &Shutdown {
        &self.interrupted
    }

    fn watch(shutdown: &Shutdown, which: &[i32]) -> Result<Self> {
        let failed = |error: std::io::Error| Error::failed("cannot watch for signals").because(error);
        let mut signals = Signals::new(which).map_err(failed)?;
        let handle = signals.handle();
        let (shutdown, interrupted) = (shutdown.clone(), Shutdown::new());
        let interrupt = interrupted.clone();
        let hangup = Arc::new(AtomicBool::new(false));
        let heard = hangup.clone();
        let watch = move || {
            let mut is_first = true;
            for signal in signals.forever() {
                if signal == SIGHUP {
                    heard.store(true, Ordering::Release);
                    continue;
                }
                if !is_first {
                    signal_hook::low_level::exit(128 + signal);
                }
                is_first = false;
                interrupt.request();
                shutdown.request();
                tracing::info!("stopping in good order; a second signal stops at once");
            }
        };
        let thread = Builder::new().name("signals".to_owned()).spawn(watch).map_err(failed)?;
        Ok(Self { handle, thread: Some(thread), hangup, interrupted })
    }
}

impl Drop for SignalWatch {
    fn drop(&mut self) {
        self.handle.close();
        if let Some(thread) = self.thread.take() {
            // The thread cannot panic, and at the end of the program nothing could be done about it.
            let _ = thread.join();
        }
    }
}
