//! The product's messages, kept for the checks, and whether any of its threads panicked.

use std::io::{self, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, Once, PoisonError};
use std::{panic, thread};

static SAID: Mutex<Vec<u8>> = Mutex::new(Vec::new());
static PANICS: AtomicUsize = AtomicUsize::new(0);

struct Keep;

impl Write for Keep {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        SAID.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Clears the recorded messages, and records from now on.
pub fn listen() {
    static START: Once = Once::new();
    START.call_once(|| {
        tracing_subscriber::fmt()
            .with_writer(|| Keep)
            .with_ansi(false)
            .with_target(false)
            .without_time()
            .init();
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            // The checks' own threads may panic: that is how a check fails. They are named after the check,
            // or main.
            let thread = thread::current();
            if !thread.name().is_some_and(|name| name == "main" || name.contains("::")) {
                PANICS.fetch_add(1, Ordering::SeqCst);
            }
            report(info);
        }));
    });
    SAID.lock().unwrap_or_else(PoisonError::into_inner).clear();
    PANICS.store(0, Ordering::SeqCst);
}

/// All lines since [`listen`].
pub fn said() -> String {
    String::from_utf8_lossy(&SAID.lock().unwrap_or_else(PoisonError::into_inner)).into_owned()
}

/// Lines with `words` in them.
pub fn count(words: &str) -> usize {
    said().lines().filter(|line| line.contains(words)).count()
}

/// Panics of other threads than the checks', since [`listen`].
pub fn panics() -> usize {
    PANICS.load(Ordering::SeqCst)
}
