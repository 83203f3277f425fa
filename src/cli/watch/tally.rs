use crate::cli::messages::print;
use crate::rt::{monotonic_ns, utc_from_monotonic_ns};
use crate::wire::Message;
use lightcast_core::light::LightList;
use std::fmt::Write as _;
use std::time::{Duration, Instant};

/// What has arrived since the last line was printed.
pub(super) struct Tally {
    /// Whether anything is printed.
    is_told: bool,
    since: Instant,
    lists: u64,
    bytes_before: u64,
    lost: u64,
    /// Ages of lists from a server.
    ages_ns: Vec<i64>,
    sequence: u64,
    light_count: usize,
    error: Option<f32>,
}

/// Most ages that are kept for a second.
const AGES_MAX: usize = 10_000;

impl Tally {
    pub fn new(is_told: bool) -> Self {
        Self {
            is_told,
            since: Instant::now(),
            lists: 0,
            bytes_before: 0,
            lost: 0,
            ages_ns: Vec::new(),
            sequence: 0,
            light_count: 0,
            error: None,
        }
    }

    /// Counts a list.
    pub fn add(&mut self, list: &LightList) {
        self.lists += 1;
        (self.sequence, self.light_count, self.error) = (list.stamp.sequence, list.lights.len(), list.error);
    }

    /// Counts a list from a server.
    pub fn add_message(&mut self, message: &Message) {
        let Message { list, delivery } = message;
        self.add(list);
        self.lost += delivery.lost;
        let now_ns = monotonic_ns().saturating_add(utc_from_monotonic_ns());
        if self.ages_ns.len() < AGES_MAX {
            self.ages_ns.push(now_ns.saturating_sub(delivery.capture_utc_ns.unwrap_or(delivery.sent_utc_ns)));
        }
    }

    /// Prints, when a second has passed, what arrived in it; `bytes` is the total from a server so far.
    pub fn tell_each_second(&mut self, bytes: u64) {
        let elapsed = self.since.elapsed();
        if elapsed >= Duration::from_secs(1) {
            self.tell(bytes, elapsed);
        }
    }

    /// Prints what has arrived since then, if anything has.
    pub fn tell_rest(&mut self, bytes: u64) {
        if self.lists > 0 {
            self.tell(bytes, self.since.elapsed());
        }
    }

    fn tell(&mut self, bytes: u64, elapsed: Duration) {
        if self.is_told {
            let line = self.line(bytes, elapsed.as_secs_f64());
            print(&format!("{line}\n"));
        }
        (self.lists, self.lost, self.bytes_before) = (0, 0, bytes);
        self.ages_ns.clear();
        self.since = Instant::now();
    }

    fn line(&mut self, bytes: u64, seconds: f64) -> String {
        if self.lists == 0 {
            return "no list".to_owned();
        }
        let mut line = format!(
            "sequence {:>8}  {:>5} lights  error {}  {:>6.1} lists/s",
            self.sequence,
            self.light_count,
            self.error.map_or("-".to_owned(), |error| format!("{error:.5}")),
            self.lists as f64 / seconds,
        );
        self.ages_ns.sort_unstable();
        if let Some(largest) = self.ages_ns.last() {
            let ms = |ns: i64| ns as f64 * 1e-6;
            // Writing to a string cannot fail.
            let _ = write!(
                line,
                "  {:>8.1} kB/s  age {:>7.1} ms, at most {:>7.1}  {} lost",
                (bytes - self.bytes_before) as f64 * 1e-3 / seconds,
                ms(self.ages_ns[self.ages_ns.len() / 2]),
                ms(*largest),
                self.lost,
            );
        }
        line
    }
}
