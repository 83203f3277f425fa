use serde::{Deserialize, Serialize};
use std::fmt;

/// When and where in its sequence something was captured. Travels with the data from the source to the
/// client.
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

/// Which colour the pixels of a mosaic sensor (Bayer, US patent 3971065) see: the first two letters are those
/// of the first row from the left, the last two those of the second row; all others repeat these.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum Bayer {
    /// Red and green above green and blue.
    Rggb,
    /// Green and red above blue and green.
    Grbg,
    /// Green and blue above red and green.
    Gbrg,
    /// Blue and green above green and red.
    Bggr,
}

impl Bayer {
    /// Channel (0 red, 1 green, 2 blue) of the four pixels of a period, row by row.
    pub fn channels(self) -> [usize; 4] {
        match self {
            Self::Rggb => [0, 1, 1, 2],
            Self::Grbg => [1, 0, 2, 1],
            Self::Gbrg => [1, 2, 0, 1],
            Self::Bggr => [2, 1, 1, 0],
        }
    }
}

impl fmt::Display for Bayer {
    /// As files write it: `RGGB`.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        self.channels().into_iter().try_for_each(|channel| f.write_str(["R", "G", "B"][channel]))
    }
}

/// One picture from a source: 1 channel (luminance, or a mosaic of colours) or 3 (linear RGB). Rendered
/// pictures that are written may have a fourth, alpha, by which the others are multiplied.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Time and place in the sequence.
    pub stamp: Stamp,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// 1, 3, or 4 with alpha.
    pub channels: usize,
    /// Colours of the pixels of a mosaic sensor, whose frames have 1 channel; `None` for all others.
    pub bayer: Option<Bayer>,
    /// Radiance from which on a sample is known to be too low, because its sensor was saturated; infinite
    /// where there is no such limit, and meaningless for codes, where the response gives the limit.
    pub saturation: f32,
    /// `width * height * channels` samples.
    pub pixels: Pixels,
}

impl Frame {
    /// Becomes a copy of `other`; allocates only when it has never held as much before.
    pub fn copy_from(&mut self, other: &Self) {
        let Self { stamp, width, height, channels, bayer, saturation, pixels } = other;
        (self.stamp, self.width, self.height, self.channels, self.bayer, self.saturation) =
            (*stamp, *width, *height, *channels, *bayer, *saturation);
        match (&mut self.pixels, pixels) {
            (Pixels::Codes(to), Pixels::Codes(from)) => to.clone_from(from),
            (Pixels::Radiance(to), Pixels::Radiance(from)) => to.clone_from(from),
            (to, from) => to.clone_from(from),
        }
    }
}

impl Default for Frame {
    /// An empty frame to read into.
    fn default() -> Self {
        Self {
            stamp: Stamp::default(),
            width: 0,
            height: 0,
            channels: 1,
            bayer: None,
            saturation: f32::INFINITY,
            pixels: Pixels::Codes(Vec::new()),
        }
    }
}
