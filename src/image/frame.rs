use serde::{Deserialize, Serialize};

/// When and where in its sequence something was captured. Travels with the data from the source to the client.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stamp {
    /// Number of the frame as its source counts: the file's number, the kernel's counter.
    pub sequence: u64,
    /// Capture time in nanoseconds; the epoch is the source's (a replay starts at 0).
    pub capture_time_ns: i64,
    /// Frames lost between the previous item and this one.
    pub lost_before: u64,
    /// Nominal frame rate of the source.
    pub frame_rate_hz: f64,
}

/// Samples of a frame, row-major, channels interleaved.
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// Raw sensor codes, to be turned into radiance by a response.
    Codes(Vec<u16>),
    /// Linear radiance.
    Radiance(Vec<f32>),
}

/// One picture from a source: 1 channel (luminance) or 3 (linear RGB).
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Time and place in the sequence.
    pub stamp: Stamp,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// 1 or 3.
    pub channels: usize,
    /// `width * height * channels` samples.
    pub pixels: Pixels,
}

impl Default for Frame {
    /// An empty frame to read into.
    fn default() -> Self {
        Self { stamp: Stamp::default(), width: 0, height: 0, channels: 1, pixels: Pixels::Codes(Vec::new()) }
    }
}
