use super::Shutdown;
use rustix::time::{ClockId, clock_gettime};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{Duration, Instant};

/// The current time of the kernel's CLOCK_MONOTONIC, in nanoseconds: the same for all programs of a machine,
/// and for the time stamps of most camera drivers.
pub fn monotonic_ns() -> i64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec.saturating_mul(1_000_000_000).saturating_add(now.tv_nsec)
}

/// The current offset from [`monotonic_ns`] to nanoseconds since 1970: UTC is set and slewed, the monotonic
/// clock never is.
pub fn utc_from_monotonic_ns() -> i64 {
    let utc = std::time::SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
    i64::try_from(utc.as_nanos()).unwrap_or(i64::MAX).saturating_sub(monotonic_ns())
}

/// The offset from a source's capture times to [`monotonic_ns`], shared by all threads that need it; unknown
/// until the source has begun, and always under a simulated clock. Clones share the value.
#[derive(Clone, Debug)]
pub struct CaptureEpoch(Arc<AtomicI64>);

/// No offset: 292 years.
const UNKNOWN: i64 = i64::MIN;

impl CaptureEpoch {
    /// Sets the offset, anew where a source goes on after a time in which it had nothing.
    pub fn set(&self, monotonic_from_capture_ns: i64) {
        self.0.store(monotonic_from_capture_ns, Ordering::Release);
    }

    /// A capture time on the kernel's monotonic clock.
    pub fn monotonic_ns(&self, capture_time_ns: i64) -> Option<i64> {
        let offset = self.0.load(Ordering::Acquire);
        (offset != UNKNOWN).then(|| capture_time_ns.saturating_add(offset))
    }
}

impl Default for CaptureEpoch {
    fn default() -> Self {
        Self(Arc::new(AtomicI64::new(UNKNOWN)))
    }
}

/// The time that paces a source, in nanoseconds since the clock was made. Clones show the same time.
///
/// A replay as fast as possible is a replay at its own rate under a simulated clock: the code is the same,
/// but nothing waits.
#[derive(Clone, Debug)]
pub struct Clock(Kind);

#[derive(Clone, Debug)]
enum Kind {
    Real(Instant),
    Simulated(Arc<AtomicI64>),
}

impl Clock {
    /// Real time.
    pub fn real() -> Self {
        Self(Kind::Real(Instant::now()))
    }

    /// Time that stands still until something waits for a time, and then jumps to it.
    pub fn simulated() -> Self {
        Self(Kind::Simulated(Arc::new(AtomicI64::new(0))))
    }

    /// The current time in nanoseconds.
    pub fn now_ns(&self) -> i64 {
        match &self.0 {
            // An i64 of nanoseconds lasts 292 years.
            Kind::Real(origin) => i64::try_from(origin.elapsed().as_nanos()).unwrap_or(i64::MAX),
            Kind::Simulated(now) => now.load(Ordering::Acquire),
        }
    }

    /// The offset from this clock's time to [`monotonic_ns`]; `None` for simulated time.
    pub fn monotonic_from_clock_ns(&self) -> Option<i64> {
        match &self.0 {
            Kind::Real(_) => Some(monotonic_ns().saturating_sub(self.now_ns())),
            Kind::Simulated(_) => None,
        }
    }

    /// Waits until `time_ns`, not at all if that has passed. Returns false when shutdown was requested
    /// before.
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
    fn a_real_clock_knows_the_kernels_and_a_simulated_one_does_not() {
        let clock = Clock::real();
        let offset_ns = clock.monotonic_from_clock_ns().unwrap();
        assert!((monotonic_ns() - offset_ns - clock.now_ns()).abs() < 1_000_000_000);
        assert_eq!(Clock::simulated().monotonic_from_clock_ns(), None);
        let year_2020_ns = 1_577_836_800_000_000_000;
        assert!(monotonic_ns() + utc_from_monotonic_ns() > year_2020_ns);
    }

    #[test]
    fn an_epoch_is_that_of_all_clones() {
        let epoch = CaptureEpoch::default();
        assert_eq!(epoch.monotonic_ns(5), None);
        epoch.clone().set(100);
        assert_eq!((epoch.monotonic_ns(5), epoch.monotonic_ns(i64::MAX)), (Some(105), Some(i64::MAX)));
        epoch.set(200);
        assert_eq!(epoch.clone().monotonic_ns(5), Some(205));
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
