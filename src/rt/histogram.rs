use std::sync::atomic::{AtomicU64, Ordering};

/// Sub-buckets per power of two: 32 keep a percentile within 1/64 (1.6 %) of the true value.
const STEPS: u64 = 32;
const STEP_BITS: u32 = STEPS.ilog2();
const BUCKETS: usize = (64 - STEP_BITS as usize + 1) * STEPS as usize;

/// Counts of u64 values in buckets that grow with the value (as HdrHistogram's do): fixed memory (15 KiB),
/// any thread may record, nothing is allocated. Values below 32 are exact.
#[derive(Debug)]
pub struct Histogram {
    buckets: Box<[AtomicU64]>,
    maximum: AtomicU64,
}

impl Histogram {
    /// An empty histogram.
    pub fn new() -> Self {
        Self { buckets: (0..BUCKETS).map(|_| AtomicU64::new(0)).collect(), maximum: AtomicU64::new(0) }
    }

    /// Counts one value.
    pub fn record(&self, value: u64) {
        self.buckets[bucket(value)].fetch_add(1, Ordering::Relaxed);
        self.maximum.fetch_max(value, Ordering::Relaxed);
    }

    /// Largest value recorded, exactly; 0 when there is none.
    pub fn maximum(&self) -> u64 {
        self.maximum.load(Ordering::Relaxed)
    }

    /// The value that is not exceeded by a `fraction` in [0, 1] of all values (the smallest such value, the
    /// centre of its bucket); 0 when nothing was recorded.
    pub fn percentile(&self, fraction: f64) -> u64 {
        let total: u64 = self.buckets.iter().map(|count| count.load(Ordering::Relaxed)).sum();
        let rank = ((total as f64 * fraction).ceil() as u64).max(1);
        let mut seen = 0;
        for (index, count) in self.buckets.iter().enumerate() {
            seen += count.load(Ordering::Relaxed);
            if seen >= rank {
                return centre(index).min(self.maximum());
            }
        }
        0
    }
}

impl Default for Histogram {
    fn default() -> Self {
        Self::new()
    }
}

/// Bucket of a value: the value itself below `STEPS`, then exponent and the `STEP_BITS` bits after the
/// leading one.
fn bucket(value: u64) -> usize {
    if value < STEPS {
        return value as usize;
    }
    let shift = value.ilog2() - STEP_BITS;
    (u64::from(shift) * STEPS + (value >> shift)) as usize
}

/// Centre of the values that fall into a bucket.
fn centre(index: usize) -> u64 {
    let index = index as u64;
    if index < 2 * STEPS {
        return index;
    }
    let shift = index / STEPS - 1;
    ((index - shift * STEPS) << shift) + (1 << shift) / 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_falls_into_a_bucket_whose_centre_is_within_a_64th() {
        for exponent in 0..64 {
            for offset in [0, 1, 12345, u64::MAX] {
                let value = (1u64 << exponent) | (offset & ((1 << exponent) - 1));
                let found = centre(bucket(value));
                assert!(found.abs_diff(value) as f64 <= value as f64 / 64.0, "{value} -> {found}");
                assert_eq!(bucket(found), bucket(value));
            }
        }
    }

    #[test]
    fn percentiles_of_a_ramp() {
        let histogram = Histogram::new();
        (1..=10_000).for_each(|value| histogram.record(value));
        for (fraction, expected) in [(0.5, 5000.0), (0.99, 9900.0), (0.001, 10.0)] {
            let found = histogram.percentile(fraction) as f64;
            assert!((found / expected - 1.0).abs() < 1.0 / 64.0, "{fraction}: {found}");
        }
        assert_eq!(histogram.percentile(1.0), 10_000);
        assert_eq!(histogram.maximum(), 10_000);
    }

    #[test]
    fn an_empty_histogram_says_zero() {
        assert_eq!((Histogram::new().percentile(0.5), Histogram::new().maximum()), (0, 0));
    }
}
