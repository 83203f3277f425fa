//! What a report was measured on.

use serde::Serialize;
use std::time::{SystemTime, UNIX_EPOCH};

/// The machine and the program.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Machine {
    /// `lightcast` and its version.
    pub program: String,
    /// The processor's name where the system tells it.
    pub processor: String,
    /// Threads that the process may use.
    pub threads: usize,
    /// Operating system with the kernel's version where the system tells it.
    pub system: String,
    /// The instruction set that the program was built for, and whether assertions of debug builds are on.
    pub build: String,
    /// Vulkan adapter and driver, where pictures are drawn.
    pub adapter: Option<String>,
}

impl Machine {
    /// This one, without an adapter.
    pub fn this() -> Self {
        let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
        let kernel = read("/proc/sys/kernel/osrelease");
        let debug = if cfg!(debug_assertions) { ", a debug build: its times are too long" } else { "" };
        Self {
            program: format!("lightcast {}", env!("CARGO_PKG_VERSION")),
            processor: processor(&read("/proc/cpuinfo")).unwrap_or_else(|| "unknown".to_owned()),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            system: format!("{} {}", distribution(&read("/etc/os-release")), kernel.trim()).trim().to_owned(),
            build: format!("{}{debug}", std::env::consts::ARCH),
            adapter: None,
        }
    }
}

/// The first processor's name in Linux' list of processors.
fn processor(list: &str) -> Option<String> {
    let line = list.lines().find(|line| line.starts_with("model name"))?;
    let name = line.split_once(':')?.1.split_whitespace().collect::<Vec<_>>().join(" ");
    (!name.is_empty()).then_some(name)
}

/// The distribution's name in `os-release`; the kind of system without it.
fn distribution(release: &str) -> String {
    let name = release.lines().find_map(|line| line.strip_prefix("PRETTY_NAME="));
    let name = name.map(|name| name.trim_matches('"')).filter(|name| !name.is_empty());
    match name {
        Some(name) => format!("{name}, {}", std::env::consts::OS),
        None => std::env::consts::OS.to_owned(),
    }
}

/// The time now, as `2026-03-01 14:05 UTC`.
pub fn now_utc() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
    utc(seconds)
}

/// Seconds since 1970 as a date and a time of day.
fn utc(seconds: u64) -> String {
    let (day, minute) = (seconds / 86_400, seconds % 86_400 / 60);
    let (mut year, mut left) = (1970, day);
    let is_leap =
        |year: u64| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    while left >= 365 + u64::from(is_leap(year)) {
        left -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let lengths = [31, 28 + u64::from(is_leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let mut month = 0;
    while left >= lengths[month] {
        left -= lengths[month];
        month += 1;
    }
    format!("{year}-{:02}-{:02} {:02}:{:02} UTC", month + 1, left + 1, minute / 60, minute % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_in_what_linux_tells() {
        let list = "processor\t: 0\nmodel name\t: Some  CPU @ 2 GHz\nmodel name\t: other\n";
        assert_eq!(processor(list).as_deref(), Some("Some CPU @ 2 GHz"));
        assert_eq!((processor(""), processor("model name\t:")), (None, None));
        assert!(distribution("ID=x\nPRETTY_NAME=\"Debian 12\"\n").starts_with("Debian 12, "));
        assert_eq!(distribution(""), std::env::consts::OS);
        let machine = Machine::this();
        assert!(machine.threads >= 1 && machine.program.contains(env!("CARGO_PKG_VERSION")), "{machine:?}");
    }

    #[test]
    fn dates_know_leap_years() {
        assert_eq!(utc(0), "1970-01-01 00:00 UTC");
        assert_eq!(utc(951_782_399), "2000-02-28 23:59 UTC");
        assert_eq!(utc(951_782_400), "2000-02-29 00:00 UTC");
        assert_eq!(utc(1_772_323_199), "2026-02-28 23:59 UTC");
        assert_eq!(utc(1_798_761_599), "2026-12-31 23:59 UTC");
    }
}
