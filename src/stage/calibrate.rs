use crate::camera::{FrameToPolar, PixelCounts, Response};
use crate::error::Result;
use crate::image::{Frame, PolarMap};
use crate::rt::stage::{Flow, Stage};
use crate::rt::{Counter, Metrics};

/// Turns a frame into a polar map: response and lens in one pass. Counts the pixels that carry no light or not
/// all of it.
pub struct Calibrate {
    frame_to_polar: FrameToPolar,
    response: Response,
    counters: PixelCounters,
}

impl Calibrate {
    /// A frame's way into a map; the pixel counts go to named counters of `metrics`.
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
            .map_err(|error| error.at(format_args!("frame {}", frame.stamp.sequence)))?;
        self.counters.add(&counts);
        Ok(Flow::Send)
    }
}

/// Sums of [`PixelCounts`] over the run.
struct PixelCounters {
    saturated: Counter,
    black_clipped: Counter,
    nan: Counter,
    infinite: Counter,
    negative: Counter,
}

impl PixelCounters {
    fn new(metrics: &Metrics) -> Self {
        Self {
            saturated: metrics.counter("saturated"),
            black_clipped: metrics.counter("black-clipped"),
            nan: metrics.counter("NaN"),
            infinite: metrics.counter("infinite"),
            negative: metrics.counter("negative"),
        }
    }

    fn add(&self, counts: &PixelCounts) {
        let PixelCounts { saturated, black_clipped, nan, infinite, negative } = *counts;
        self.saturated.add(saturated);
        self.black_clipped.add(black_clipped);
        self.nan.add(nan);
        self.infinite.add(infinite);
        self.negative.add(negative);
    }
}
