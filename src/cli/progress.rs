//! Progress of a command on standard error: a bar where that is a terminal, elsewhere a plain line now and
//! then.

use super::messages::PROGRESS;
use indicatif::{FormattedDuration, ProgressBar, ProgressStyle};
use std::io::{self, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Time until the first plain line, and least time between two.
const FIRST_LINE_MS: u64 = 2000;

/// The progress of some work. Clones show the same.
#[derive(Clone)]
pub(super) struct Progress {
    bar: ProgressBar,
    /// What is counted, such as "lists"; empty where only the percentage is meaningful.
    things: &'static str,
    /// When the next plain line is due, after the start; `None` on a terminal, where the bar is seen.
    line_due_ms: Option<Arc<AtomicU64>>,
}

impl Progress {
    /// Counts `things`, of which there will be `length` if that is known.
    pub fn of(length: Option<u64>, things: &'static str) -> Self {
        let (bar, template) = match length {
            Some(length) => (ProgressBar::new(length), "{bar:40} {pos}/{len} {msg}, {per_sec}, {eta} left"),
            None => (ProgressBar::new_spinner(), "{spinner} {pos} {msg}, {per_sec}, {elapsed}"),
        };
        let progress = Self::new(bar, template, things);
        progress.set_message(things);
        progress
    }

    /// Shows how much is done, in per cent, of the work that [`set_message`](Self::set_message) names.
    pub fn in_percent(length: u64) -> Self {
        Self::new(ProgressBar::new(length), "{bar:40} {percent}% {msg}, {elapsed}", "")
    }

    fn new(bar: ProgressBar, template: &str, things: &'static str) -> Self {
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let is_seen = io::stderr().is_terminal();
        let line_due_ms = (!is_seen).then(|| Arc::new(AtomicU64::new(FIRST_LINE_MS)));
        Self { bar: PROGRESS.add(bar).with_style(style), things, line_due_ms }
    }

    pub fn inc(&self, count: u64) {
        self.bar.inc(count);
        self.write_line();
    }

    pub fn set_position(&self, position: u64) {
        self.bar.set_position(position);
        self.write_line();
    }

    pub fn set_length(&self, length: u64) {
        self.bar.set_length(length);
    }

    pub fn set_message(&self, message: impl Into<String>) {
        self.bar.set_message(message.into());
        self.write_line();
    }

    pub fn message(&self) -> String {
        self.bar.message()
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn write_line(&self) {
        let Some(due_ms) = &self.line_due_ms else { return };
        let elapsed = self.bar.elapsed();
        let elapsed_ms = u64::try_from(elapsed.as_millis()).unwrap_or(u64::MAX);
        let due = due_ms.load(Ordering::Relaxed);
        // If two threads find that a line is due, only one of them writes it.
        let is_ours = || {
            let next = next_line_ms(elapsed_ms);
            due_ms.compare_exchange(due, next, Ordering::Relaxed, Ordering::Relaxed).is_ok()
        };
        if elapsed_ms >= due && is_ours() {
            let (position, length) = (self.bar.position(), self.bar.length());
            tracing::info!("{}", line(self.things, &self.bar.message(), position, length, elapsed));
        }
    }
}

/// Lines become rarer, so that a service of weeks does not fill a log: each comes when the time since the
/// start has grown by a half.
fn next_line_ms(elapsed_ms: u64) -> u64 {
    elapsed_ms.saturating_add((elapsed_ms / 2).max(FIRST_LINE_MS))
}

fn line(things: &str, message: &str, position: u64, length: Option<u64>, elapsed: Duration) -> String {
    let elapsed = FormattedDuration(Duration::from_secs(elapsed.as_secs()));
    match length {
        Some(length) if things.is_empty() => {
            format!("{} %, {message}, after {elapsed}", 100 * position.min(length) / length.max(1))
        }
        Some(length) => format!("{position} of {length} {things} after {elapsed}"),
        None => format!("{position} {things} after {elapsed}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_how_far_it_is() {
        let elapsed = Duration::from_millis(62_900);
        assert_eq!(line("lists", "lists", 40, Some(100), elapsed), "40 of 100 lists after 00:01:02");
        assert_eq!(line("lists", "lists", 40, None, elapsed), "40 lists after 00:01:02");
        assert_eq!(line("", "map garden", 30, Some(120), elapsed), "25 %, map garden, after 00:01:02");
        assert_eq!(line("", "reading", 0, Some(0), elapsed), "0 %, reading, after 00:01:02");
    }

    #[test]
    fn lines_become_rarer() {
        let lines_within = |time_ms: u64| {
            let due = std::iter::successors(Some(FIRST_LINE_MS), |due| Some(next_line_ms(*due)));
            due.take_while(|due| *due <= time_ms).count()
        };
        assert_eq!(lines_within(1_999), 0);
        assert_eq!(lines_within(20_000), 5, "2, 4, 6, 9, 13.5 s");
        assert_eq!(lines_within(7 * 24 * 3_600_000), 31);
    }
}
