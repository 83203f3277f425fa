use crate::error::{Error, Place, Result};
use crate::rt::stage::{Flow, Stage};
use crate::rt::{Counter, Metrics};
use lightcast_core::camera::{FrameToPolar, PixelCounts, Response};
use lightcast_core::image::{Frame, PolarMap};

/// Turns a frame into a polar map: response and lens in one pass. Counts the pixels that hold no radiance or
/// too low a one.
pub struct Calibrate {
    frame_to_polar: FrameToPolar,
    response: Response,
    counters: PixelCounters,
}

impl Calibrate {
    /// Converts frames by `frame_to_polar`; the pixel counts go to named counters of `metrics`.
    pub fn new(frame_to_polar: FrameToPolar, response: Response, metrics: &Metrics) -> Self {
        Self { frame_to_polar, response, counters: PixelCounters::new(metrics) }
    }
}

impl Stage for Calibrate {
    type Input = Frame;
    type Output = PolarMap;

    fn step(&mut self, frame: &Frame, map: &mut PolarMap) -> Result<Flow> {
        let counts = self
            .frame_to_polar
            .apply(frame, &self.response, map)
            .map_err(|error| Error::from(error).at(Place::Frame(frame.stamp.sequence)))?;
        self.counters.add(&counts, frame.stamp.sequence);
        Ok(Flow::Send)
    }
}

/// Pixels of one kind: the sum over the run, and the largest count in a frame that was logged. A frame is
/// logged when it has twice as many, so that the first and the worst are known and a bad camera does not fill
/// the log.
struct PixelCounter {
    kind: &'static str,
    sum: Counter,
    named: u64,
}

/// One counter for each kind of [`PixelCounts`].
struct PixelCounters([PixelCounter; 5]);

impl PixelCounters {
    fn new(metrics: &Metrics) -> Self {
        let counter = |kind| PixelCounter { kind, sum: metrics.counter(kind), named: 0 };
        Self(
            ["pixels saturated", "pixels black-clipped", "pixels NaN", "pixels infinite", "pixels negative"]
                .map(counter),
        )
    }

    fn add(&mut self, counts: &PixelCounts, sequence: u64) {
        let PixelCounts { saturated, black_clipped, nan, infinite, negative } = *counts;
        for (counter, count) in self.0.iter_mut().zip([saturated, black_clipped, nan, infinite, negative]) {
            counter.sum.add(count);
            if count > 0 && count >= 2 * counter.named {
                counter.named = count;
                tracing::warn!("frame {sequence}: {count} {}", counter.kind);
            }
        }
    }
}
