use super::Histogram;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// A number that only grows; clones count together.
#[derive(Clone, Debug, Default)]
pub struct Counter(Arc<AtomicU64>);

impl Counter {
    /// Adds to the count.
    pub fn add(&self, count: u64) {
        self.0.fetch_add(count, Ordering::Relaxed);
    }

    /// The count so far.
    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// What one stage has done, readable by any thread while it runs. Recording allocates nothing.
#[derive(Debug)]
pub struct Metrics {
    name: &'static str,
    /// Items processed.
    pub frames: Counter,
    /// Items that this stage was too slow for: overwritten in its link, or dropped because it was full.
    pub drops: Counter,
    /// Items that this stage refused as bad frames.
    pub bad_frames: Counter,
    /// Time per item in nanoseconds, without the waits for neighbours and clock.
    pub time_ns: Histogram,
    counters: Mutex<Vec<(&'static str, Counter)>>,
}

impl Metrics {
    /// Metrics of a stage that has done nothing yet.
    pub fn new(name: &'static str) -> Arc<Self> {
        Arc::new(Self {
            name,
            frames: Counter::default(),
            drops: Counter::default(),
            bad_frames: Counter::default(),
            time_ns: Histogram::new(),
            counters: Mutex::default(),
        })
    }

    /// Name of the stage.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The counter of this name, made on the first call. Keep it: this takes a lock.
    pub fn counter(&self, name: &'static str) -> Counter {
        let mut counters = self.counters.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, counter)) = counters.iter().find(|(known, _)| *known == name) {
            return counter.clone();
        }
        let counter = Counter::default();
        counters.push((name, counter.clone()));
        counter
    }

    /// The named counters and their values, in the order of their creation.
    pub fn counters(&self) -> Vec<(&'static str, u64)> {
        let counters = self.counters.lock().unwrap_or_else(PoisonError::into_inner);
        counters.iter().map(|(name, counter)| (*name, counter.get())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_of_one_name_are_one_counter() {
        let metrics = Metrics::new("calibrate");
        metrics.counter("saturated").add(2);
        metrics.counter("nan").add(1);
        metrics.counter("saturated").add(3);
        assert_eq!(metrics.counters(), [("saturated", 5), ("nan", 1)]);
    }
}
