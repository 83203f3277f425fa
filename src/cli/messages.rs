//! Messages on standard error that do not tear the progress bar.

use clap::ValueEnum;
use indicatif::MultiProgress;
use std::io::{self, IsTerminal, Write};
use std::sync::LazyLock;
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

/// Sends messages to standard error; `RUST_LOG` says which, by default all from INFO up.
pub(super) fn start(format: LogFormat) {
    let messages = tracing_subscriber::fmt().with_env_filter(filter()).with_writer(|| BesideProgress);
    match format {
        LogFormat::Text => {
            messages.with_ansi(io::stderr().is_terminal()).with_target(false).without_time().init();
        }
        LogFormat::Json => messages.json().init(),
    }
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

/// Standard error, with the progress bar hidden while a message is written. A message that nobody can receive
/// (closed pipe, full disk) is dropped: the subscriber would answer an error with a panic.
struct BesideProgress;

impl Write for BesideProgress {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        PROGRESS.suspend(|| {
            let _ = io::stderr().write_all(bytes);
        });
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
