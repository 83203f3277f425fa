//! Grey patches: the codes of a part of a camera's picture whose luminance is known.

use crate::error::{Error, Result};
use lightcast_core::image::{Frame, Pixels};
use std::collections::BTreeMap;

/// A part of a picture, in whole pixels from its top left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rectangle {
    /// First column.
    pub x: usize,
    /// First row.
    pub y: usize,
    /// Columns, > 0.
    pub width: usize,
    /// Rows, > 0.
    pub height: usize,
}

/// The codes of a patch's pixels, of all channels, over one or more frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PatchCodes {
    counts: BTreeMap<u16, u64>,
    /// Sum and number of codes by channel.
    channels: [(f64, u64); 3],
}

/// A patch of known luminance.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Its luminance, finite and > 0.
    pub luminance_cd_m2: f64,
    /// The camera's codes.
    pub codes: PatchCodes,
    /// Whether it is excluded from the fit, so that it shows how well the fit predicts.
    pub is_held_out: bool,
}

impl PatchCodes {
    /// Adds the pixels of `rectangle`.
    ///
    /// # Errors
    /// `Usage`: a rectangle without pixels or not within the frame, and frames of radiance, which have no
    /// codes.
    pub fn add(&mut self, frame: &Frame, rectangle: Rectangle) -> Result<()> {
        let Pixels::Codes(codes) = &frame.pixels else {
            return Err(Error::usage(
                "holds radiance, which has no response to find; give the camera's raw codes (PNG or JPEG)",
            ));
        };
        let Rectangle { x, y, width, height } = rectangle;
        let is_inside = |from: usize, len: usize, size: usize| {
            len > 0 && from.checked_add(len).is_some_and(|end| end <= size)
        };
        if !is_inside(x, width, frame.width) || !is_inside(y, height, frame.height) {
            return Err(Error::usage(format!(
                "the rectangle of {width} x {height} px at ({x}, {y}) does not lie within the picture of {} x {} px",
                frame.width, frame.height
            )));
        }
        for row in codes.chunks_exact(frame.width * frame.channels).skip(y).take(height) {
            let samples = &row[x * frame.channels..(x + width) * frame.channels];
            for (at, &code) in samples.iter().enumerate() {
                *self.counts.entry(code).or_default() += 1;
                let (sum, number) = &mut self.channels[at % frame.channels];
                *sum += f64::from(code);
                *number += 1;
            }
        }
        Ok(())
    }

    /// Mean code; 0 without pixels.
    pub fn mean(&self) -> f64 {
        self.moment(|code| code)
    }

    /// Standard deviation of the codes, due to noise and non-uniformity of the patch.
    pub fn spread(&self) -> f64 {
        let mean = self.mean();
        self.moment(|code| (code - mean) * (code - mean)).sqrt()
    }

    /// Largest difference between the means of two channels; 0 for one channel. One response serves all
    /// channels, so a grey patch should look grey.
    pub fn channel_difference(&self) -> f64 {
        let means = self.channels.iter().filter(|(_, number)| *number > 0).map(|(sum, n)| sum / *n as f64);
        let (low, high) =
            means.fold((f64::MAX, f64::MIN), |(low, high), mean| (low.min(mean), high.max(mean)));
        (high - low).max(0.0)
    }

    /// Largest code; 0 without pixels.
    pub(super) fn max(&self) -> u16 {
        self.counts.last_key_value().map_or(0, |(&code, _)| code)
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> u64 {
        self.counts.values().sum()
    }

    /// Share of the samples at or above a code.
    pub(super) fn share_from(&self, code: u16) -> f64 {
        self.counts.range(code..).map(|(_, n)| n).sum::<u64>() as f64 / self.samples().max(1) as f64
    }

    /// Share of the samples at or below a code.
    pub(super) fn share_to(&self, code: u16) -> f64 {
        self.counts.range(..=code).map(|(_, n)| n).sum::<u64>() as f64 / self.samples().max(1) as f64
    }

    fn moment(&self, of: impl Fn(f64) -> f64) -> f64 {
        let sum: f64 = self.counts.iter().map(|(&code, &n)| n as f64 * of(f64::from(code))).sum();
        sum / self.samples().max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_pixels_of_the_rectangle_count() {
        let codes = (0..4 * 3).flat_map(|n| [n, n, n + 6]).collect();
        let frame =
            Frame { width: 4, height: 3, channels: 3, pixels: Pixels::Codes(codes), ..Frame::default() };
        let mut patch = PatchCodes::default();
        patch.add(&frame, Rectangle { x: 1, y: 1, width: 2, height: 2 }).unwrap();
        // Pixels 5, 6, 9 and 10: 7.5 on average, and 6 more in the last channel.
        assert_eq!(
            (patch.mean(), patch.channel_difference(), patch.max(), patch.samples()),
            (9.5, 6.0, 16, 12)
        );
        assert!((patch.spread() - (8.0 + 4.25f64).sqrt()).abs() < 1e-12);
        assert_eq!((patch.share_from(11), patch.share_to(6)), (4.0 / 12.0, 4.0 / 12.0));
        for rectangle in [
            Rectangle { x: 3, y: 0, width: 2, height: 1 },
            Rectangle { x: 0, y: 0, width: 0, height: 1 },
            Rectangle { x: 0, y: usize::MAX, width: 1, height: 2 },
        ] {
            assert!(
                patch.add(&frame, rectangle).unwrap_err().to_string().contains("within the picture of 4 x 3")
            );
        }
        let radiance = Frame { pixels: Pixels::Radiance(vec![1.0; 36]), ..frame };
        assert!(patch.add(&radiance, Rectangle { x: 0, y: 0, width: 1, height: 1 }).is_err());
        let empty = PatchCodes::default();
        assert_eq!(
            (empty.mean(), empty.spread(), empty.channel_difference(), empty.share_to(9)),
            (0.0, 0.0, 0.0, 0.0)
        );
    }
}
