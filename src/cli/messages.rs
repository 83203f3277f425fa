//! Messages on standard error that do not tear the progress bar, and for which nobody ever waits.

mod queue;

use crate::error::{Error, Result};
use crate::rt::Metrics;
use clap::ValueEnum;
use indicatif::MultiProgress;
use queue::{MessageQueue, MessageSender};
use std::io::{self, IsTerminal, Stderr, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::{Arc, LazyLock, OnceLock};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;

/// Every progress bar is drawn by this, so that messages can push it aside.
pub(super) static PROGRESS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// How messages are written.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum LogFormat {
    /// Sentences.
    Text,
    /// A JSON object a line: timestamp, level, fields (message, peer, ...), target.
    Json,
}

/// What was written, and what was dropped because nobody read it.
pub(super) static METRICS: LazyLock<Arc<Metrics>> = LazyLock::new(|| Metrics::new("messages"));

/// Where messages go, once they have been started.
static SENDER: OnceLock<MessageSender> = OnceLock::new();

/// Messages are written while this lives; dropping it writes the last ones.
pub(super) struct Messages {
    _queue: MessageQueue,
}

/// Sends messages to standard error; `RUST_LOG` says which, by default all from INFO up.
///
/// # Errors
/// When the system cannot start another thread.
pub(super) fn start(format: LogFormat) -> Result<Messages> {
    let failed = |error| Error::failed("cannot start the thread of the messages").because(error);
    let queue = MessageQueue::start(BesideProgress(io::stderr()), &METRICS).map_err(failed)?;
    let sender = queue.sender();
    SENDER.get_or_init(|| sender.clone());
    let messages = tracing_subscriber::fmt().with_env_filter(filter()).with_writer(move || sender.clone());
    match format {
        LogFormat::Text => {
            messages.with_ansi(io::stderr().is_terminal()).with_target(false).without_time().init();
        }
        LogFormat::Json => messages.json().init(),
    }
    Ok(Messages { _queue: queue })
}

/// Writes a text that is no message, such as a summary, after the messages before it.
pub(super) fn print(text: &str) {
    let written = match SENDER.get() {
        Some(sender) => sender.clone().write_all(text.as_bytes()),
        None => io::stderr().write_all(text.as_bytes()),
    };
    // There is nobody else to tell.
    let _ = written;
}

/// A display without a window manager is not an error, but winit warns about it; to see the warning, name
/// winit in `RUST_LOG`.
fn filter() -> EnvFilter {
    let filter = EnvFilter::builder().with_default_directive(LevelFilter::INFO.into()).from_env_lossy();
    let names_winit = std::env::var("RUST_LOG").is_ok_and(|text| text.contains("winit"));
    match "winit=error".parse() {
        Ok(directive) if !names_winit => filter.add_directive(directive),
        _ => filter,
    }
}

/// Standard error, with the progress bar hidden while a message is written.
struct BesideProgress(Stderr);

impl AsFd for BesideProgress {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl Write for BesideProgress {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        PROGRESS.suspend(|| self.0.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
