use super::Shutdown;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{Duration, Instant};

/// The time that paces a source, in nanoseconds since the clock was made. Clones show the same time.
///
/// A replay as fast as it goes is a replay at its own rate under a simulated clock: the code is one and the same,
/// only nobody waits.
#[derive(Clone, Debug)]
pub struct Clock(Kind);

#[derive(Clone, Debug)]
enum Kind {
    Real(Instant),
    Simulated(Arc<AtomicI64>),
}

impl Clock {
    /// Time as it passes.
    pub fn real() -> Self {
        Self(Kind::Real(Instant::now()))
    }

    /// Time that stands still until someone waits, and then has come at once.
    pub fn simulated() -> Self {
        Self(Kind::Simulated(Arc::new(AtomicI64::new(0))))
    }

    /// Now, in nanoseconds.
    pub fn now_ns(&self) -> i64 {
        match &self.0 {
            // An i64 of nanoseconds lasts 292 years.
            Kind::Real(origin) => i64::try_from(origin.elapsed().as_nanos()).unwrap_or(i64::MAX),
            Kind::Simulated(now) => now.load(Ordering::Acquire),
        }
    }

    /// Waits until `time_ns`, not at all if that has passed. Returns false when shutdown was requested before.
    pub fn wait_until(&self, time_ns: i64, shutdown: &Shutdown) -> bool {
        match &self.0 {
            Kind::Real(_) => {
                let wait_ns = u64::try_from(time_ns.saturating_sub(self.now_ns())).unwrap_or(0);
                !shutdown.wait(Duration::from_nanos(wait_ns))
            }
            Kind::Simulated(now) => {
                now.fetch_max(time_ns, Ordering::AcqRel);
                !shutdown.is_requested()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulated_time_comes_when_waited_for_and_never_runs_back() {
        let (clock, shutdown) = (Clock::simulated(), Shutdown::new());
        let hour_ns = 3_600_000_000_000;
        assert_eq!(clock.now_ns(), 0);
        assert!(clock.clone().wait_until(hour_ns, &shutdown));
        assert_eq!(clock.now_ns(), hour_ns);
        assert!(clock.wait_until(hour_ns - 1, &shutdown));
        assert_eq!(clock.now_ns(), hour_ns);
    }

    #[test]
    fn real_time_passes_while_waiting() {
        let (clock, shutdown) = (Clock::real(), Shutdown::new());
        let until_ns = clock.now_ns() + 2_000_000;
        assert!(clock.wait_until(until_ns, &shutdown));
        assert!(clock.now_ns() >= until_ns);
        assert!(clock.wait_until(0, &shutdown), "what has passed is not waited for");
    }

    #[test]
    fn shutdown_ends_a_wait_of_a_century() {
        let (clock, shutdown) = (Clock::real(), Shutdown::new());
        let century_ns = 3_000_000_000_000_000_000;
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| clock.wait_until(century_ns, &shutdown));
            shutdown.request();
            assert!(!waiting.join().unwrap());
        });
        assert!(!Clock::simulated().wait_until(1, &shutdown));
    }
}
