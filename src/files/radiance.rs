//! Reading Radiance pictures (`.hdr`, `.pic`): RGBE, flat or run-length coded, as `image` decodes them.
//!
//! Every `EXPOSURE=` and `COLORCORR=` line of the header has multiplied the pixels; dividing by the product
//! of all of them recovers radiance. Mantissas are taken as they are, without the half step that Radiance's
//! own tools add: OpenCV and stb do the same, and the figures that we compare with were made in this way.

use super::codec::{Attributes, check_size, resize, with_radiance};
use crate::error::{Error, Place, Result};
use ::image::ImageDecoder;
use ::image::codecs::hdr::HdrDecoder;
use lightcast_core::image::Frame;
use std::io::BufRead;

/// Reads the picture behind `source` into `frame`, 3 channels.
pub(super) fn read(source: &mut impl BufRead, frame: &mut Frame) -> Result<Attributes> {
    // The decoder takes lines of any length; real headers have a few hundred bytes and end within the buffer.
    let head = source.fill_buf().map_err(damaged)?;
    let Some(end) = head.windows(2).position(|pair| pair == b"\n\n") else {
        return Err(Error::bad_frame(format!(
            "is no Radiance picture: its header does not end within {} bytes",
            head.len()
        )));
    };
    let divisors = divisors(&String::from_utf8_lossy(&head[..end]))?;

    // The strict form accepts `#?RADIANCE` only, but many files begin with `#?RGBE`.
    let decoder = HdrDecoder::new_nonstrict(source).map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height)?;
    with_radiance(frame, |values| {
        resize(values, width * height * 3);
        decoder.read_image(bytemuck::cast_slice_mut(values)).map_err(damaged)?;
        if divisors != [1.0; 3] {
            let factors = divisors.map(|divisor| 1.0 / divisor);
            for pixel in values.as_chunks_mut::<3>().0 {
                for (value, factor) in pixel.iter_mut().zip(factors) {
                    *value = (f64::from(*value) * factor) as f32;
                }
            }
        }
        Ok(())
    })?;
    (frame.width, frame.height, frame.channels) = (width, height, 3);
    Ok(Attributes::default())
}

fn damaged(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::bad_frame("cannot be decoded as Radiance HDR; is it complete?").because(error)
}

/// Product of all `EXPOSURE` and `COLORCORR` lines, per channel; refuses formats and numbers that would be
/// misread.
fn divisors(header: &str) -> Result<[f64; 3]> {
    let mut divisors = [1.0; 3];
    for (index, line) in header.lines().enumerate() {
        let Some((key, value)) = line.split_once('=') else { continue };
        let fault = || {
            Error::bad_frame(format!("`{line}` holds no positive number")).at(Place::line(index as u64 + 1))
        };
        match key.trim() {
            "FORMAT" if value.trim() != "32-bit_rle_rgbe" => {
                return Err(Error::bad_frame(format!(
                    "format {} is not read, only 32-bit_rle_rgbe; convert it (`ra_xyze -r`)",
                    value.trim()
                ))
                .at(Place::line(index as u64 + 1)));
            }
            "EXPOSURE" => {
                let exposure = positive(value.trim()).ok_or_else(fault)?;
                divisors = divisors.map(|divisor| divisor * exposure);
            }
            "COLORCORR" => {
                let mut words = value.split_whitespace();
                for divisor in &mut divisors {
                    *divisor *= words.next().and_then(positive).ok_or_else(fault)?;
                }
            }
            _ => {}
        }
    }
    if divisors.iter().all(|divisor| divisor.is_normal()) {
        return Ok(divisors);
    }
    Err(Error::bad_frame(format!(
        "its EXPOSURE lines multiply to {divisors:?}; they must be positive numbers"
    )))
}

fn positive(word: &str) -> Option<f64> {
    word.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::image::Pixels;

    /// 2 x 1 pixels: mantissas 128, 64, 32 at exponent 129 (1, 0.5, 0.25), and black.
    const PIXELS: [u8; 8] = [128, 64, 32, 129, 0, 0, 0, 0];

    fn picture(header: &str, pixels: &[u8]) -> Result<Vec<f32>> {
        let mut bytes = header.as_bytes().to_vec();
        bytes.extend_from_slice(pixels);
        let mut frame = Frame::default();
        read(&mut bytes.as_slice(), &mut frame)?;
        assert_eq!((frame.width, frame.height, frame.channels), (2, 1, 3));
        let Pixels::Radiance(values) = frame.pixels else { panic!("codes") };
        Ok(values)
    }

    #[test]
    fn every_exposure_and_colour_line_divides() {
        let plain = [1.0, 0.5, 0.25, 0.0, 0.0, 0.0];
        let cases = [
            ("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n", [1.0, 1.0, 1.0]),
            ("#?RGBE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n", [1.0, 1.0, 1.0]),
            ("#?RADIANCE\n# EXPOSURE=9\n\n-Y 1 +X 2\n", [1.0, 1.0, 1.0]),
            ("#?RADIANCE\nEXPOSURE=2\n\n-Y 1 +X 2\n", [2.0, 2.0, 2.0]),
            (
                "#?RADIANCE\nEXPOSURE= 4.0\npfilt -x 2\n\tEXPOSURE=.5e0\nEXPOSURE=8\n\n-Y 1 +X 2\n",
                [16.0, 16.0, 16.0],
            ),
            ("#?RADIANCE\nCOLORCORR= 2 4 8\nEXPOSURE=2\nCOLORCORR=1 1 2\n\n-Y 1 +X 2\n", [4.0, 8.0, 32.0]),
        ];
        for (header, divisors) in cases {
            let expected: Vec<f32> =
                plain.iter().enumerate().map(|(n, value)| value / divisors[n % 3]).collect();
            assert_eq!(picture(header, &PIXELS).unwrap(), expected, "{header}");
        }
    }

    #[test]
    fn forms_that_would_be_misread_are_refused_by_name() {
        for (header, expected) in [
            ("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 2\n", "32-bit_rle_xyze"),
            ("#?RADIANCE\nEXPOSURE=bright\n\n-Y 1 +X 2\n", "line 2: `EXPOSURE=bright`"),
            ("#?RADIANCE\nEXPOSURE=0\n\n-Y 1 +X 2\n", "EXPOSURE=0"),
            ("#?RADIANCE\nEXPOSURE=-1\n\n-Y 1 +X 2\n", "EXPOSURE=-1"),
            ("#?RADIANCE\nEXPOSURE=nan\n\n-Y 1 +X 2\n", "EXPOSURE=nan"),
            ("#?RADIANCE\nEXPOSURE=1e300\nEXPOSURE=1e300\n\n-Y 1 +X 2\n", "inf"),
            ("#?RADIANCE\nCOLORCORR=1 2\n\n-Y 1 +X 2\n", "COLORCORR=1 2"),
            ("#?RADIANCE\n\n+Y 1 +X 2\n", "Orientation +Y +X"),
            ("#?RADIANCE\n\n+X 2 -Y 1\n", "Orientation +X -Y"),
            ("#?RADIANCE\n\n-Y 0 +X 2\n", "no pixels"),
            ("#?RADIANCE\n\n-Y 16385 +X 2\n", "2 x 16385"),
            ("#?RADIANCE\n\n-Y 1 +X 4294967295\n", "4294967295 x 1"),
            ("#?RADIANCE\n\n-Y 1\n", "imensions"),
            ("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", "does not end"),
        ] {
            let error = picture(header, &PIXELS).unwrap_err().to_string();
            assert!(error.contains(expected), "{header:?}: {error}");
        }
        let header = "#?RADIANCE\n\n-Y 1 +X 2\n";
        assert!(picture(header, &PIXELS[..7]).unwrap_err().to_string().contains("complete?"));
    }
}
