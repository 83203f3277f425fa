//! Messages on standard error that do not tear the progress bar.

use indicatif::MultiProgress;
use std::io::{self, IsTerminal, Write};
use std::sync::LazyLock;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;

/// Every progress bar is drawn by this, so that messages can push it aside.
pub(super) static PROGRESS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Sends messages to standard error; `RUST_LOG` overrules `verbose`.
pub(super) fn start(verbose: u8) {
    let level = match verbose {
        0 => LevelFilter::INFO,
        1 => LevelFilter::DEBUG,
        _ => LevelFilter::TRACE,
    };
    tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::builder().with_default_directive(level.into()).from_env_lossy())
        .with_writer(|| BesideProgress)
        .with_ansi(io::stderr().is_terminal())
        .with_target(false)
        .without_time()
        .init();
}

/// Standard error, with the progress bar taken away while a message is written.
struct BesideProgress;

impl Write for BesideProgress {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        PROGRESS.suspend(|| io::stderr().write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}
