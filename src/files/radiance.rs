//! Reading Radiance pictures (`.hdr`, `.pic`): RGBE, flat or run-length coded, as `image` decodes them.
//!
//! Every `EXPOSURE=` and `COLORCORR=` line of the header has multiplied the pixels; dividing by the product
//! of all of them recovers radiance. Only lines that begin in the first column count: those behind a tab are
//! the history of an input. `PRIMARIES=` other than those of Rec. 709 are converted to these. Pictures whose
//! scan lines run otherwise than from the top and the left are turned. Mantissas are taken as they are,
//! without the half step that Radiance's own tools add: OpenCV and stb do the same, and the figures that we
//! compare with were made in this way.

use super::codec::{Attributes, check_size, resize, with_radiance};
use super::colour_space::{Primaries, convert};
use crate::error::{Error, Place, Result};
use ::image::ImageDecoder;
use ::image::codecs::hdr::HdrDecoder;
use glam::{DMat3, DVec2};
use lightcast_core::image::Frame;
use std::io::{BufRead, Cursor, Read};

/// Reads the picture behind `source` into `frame`, 3 channels; `size`: the only one that it may have.
pub(super) fn read(
    source: &mut impl BufRead,
    frame: &mut Frame,
    size: Option<[usize; 2]>,
) -> Result<Attributes> {
    // The decoder takes lines of any length; real headers have a few hundred bytes and end within the buffer.
    let head = source.fill_buf().map_err(damaged)?;
    let Some(header) = Header::split(head) else {
        return Err(Error::bad_frame(format!(
            "is no Radiance picture: its header does not end within {} bytes",
            head.len()
        )));
    };
    let Meaning { divisors, to_rec_709 } = meaning(&header.text)?;
    let scan = Scan::of(&header.resolution)?;
    check_size(scan.width(), scan.height(), size)?;
    let (bytes, is_from_windows) = (header.bytes, header.is_from_windows);
    source.consume(bytes);

    // The decoder knows one order of scan lines: it gets a header that says so.
    let plain = format!("#?RADIANCE\n\n-Y {} +X {}\n", scan.lines, scan.samples);
    let source = Cursor::new(plain.into_bytes()).chain(source);
    let fault = |error| {
        let fault = damaged(error);
        if is_from_windows {
            fault
                .at("a header with CRLF line ends, which a transfer as text makes, and it damages the pixels")
        } else {
            fault
        }
    };
    let decoder = HdrDecoder::new_nonstrict(source).map_err(fault)?;
    with_radiance(frame, |values| {
        resize(values, scan.lines * scan.samples * 3);
        decoder.read_image(bytemuck::cast_slice_mut(values)).map_err(fault)?;
        if divisors != [1.0; 3] {
            let factors = divisors.map(|divisor| 1.0 / divisor);
            for pixel in values.as_chunks_mut::<3>().0 {
                for (value, factor) in pixel.iter_mut().zip(factors) {
                    *value = (f64::from(*value) * factor) as f32;
                }
            }
        }
        if let Some(matrix) = &to_rec_709 {
            convert(values, matrix);
        }
        scan.turn(values);
        Ok(())
    })?;
    (frame.width, frame.height, frame.channels) = (scan.width(), scan.height(), 3);
    Ok(Attributes::default())
}

fn damaged(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::bad_frame("cannot be decoded as Radiance HDR; is it complete?").because(error)
}

/// The text before the pixels.
struct Header {
    /// The lines before the empty one.
    text: String,
    /// The line behind it, such as `-Y 512 +X 1024`.
    resolution: String,
    /// Length of all of it.
    bytes: usize,
    /// Whether its lines end with CRLF.
    is_from_windows: bool,
}

impl Header {
    /// Finds the header at the beginning of a file; `None`: it does not end there.
    fn split(head: &[u8]) -> Option<Self> {
        let mut at = 0;
        let mut line = || {
            let length = head[at..].iter().position(|byte| *byte == b'\n')?;
            let line = &head[at..at + length];
            at += length + 1;
            Some((line, at))
        };
        let mut text = String::new();
        let mut is_from_windows = false;
        loop {
            let (bytes, _) = line()?;
            let trimmed = bytes.strip_suffix(b"\r").unwrap_or(bytes);
            is_from_windows |= trimmed.len() < bytes.len();
            if trimmed.is_empty() {
                break;
            }
            text += &String::from_utf8_lossy(trimmed);
            text.push('\n');
        }
        let (resolution, bytes) = line()?;
        let resolution = String::from_utf8_lossy(resolution).trim_end_matches('\r').to_owned();
        Some(Self { text, resolution, bytes, is_from_windows })
    }
}

/// The order of a file's samples: scan lines along one axis, one after the other along the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Scan {
    lines: usize,
    samples: usize,
    /// Whether scan lines are columns.
    are_columns: bool,
    /// Whether the lines go up, or, where they are columns, to the left.
    lines_reversed: bool,
    /// Whether the samples of a line go to the left, or, where lines are columns, up.
    samples_reversed: bool,
}

impl Scan {
    /// From a line such as `-Y 512 +X 1024`: Y grows upwards, X to the right, the slower axis comes first.
    fn of(resolution: &str) -> Result<Self> {
        let words: Vec<&str> = resolution.split_whitespace().collect();
        let fault = || {
            Error::bad_frame(format!(
                "has the resolution line `{}`; lines such as `-Y 512 +X 1024` are read",
                resolution.chars().take(60).collect::<String>()
            ))
        };
        let [first, lines, second, samples] = words[..] else { return Err(fault()) };
        let axis = |word: &str| match word {
            "+X" => Some((true, false)),
            "-X" => Some((true, true)),
            "-Y" => Some((false, false)),
            "+Y" => Some((false, true)),
            _ => None,
        };
        let (first, second) = (axis(first).ok_or_else(fault)?, axis(second).ok_or_else(fault)?);
        if first.0 == second.0 {
            return Err(fault());
        }
        let number = |word: &str| word.parse::<u32>().map(|number| number as usize).map_err(|_| fault());
        Ok(Self {
            lines: number(lines)?,
            samples: number(samples)?,
            are_columns: first.0,
            lines_reversed: first.1,
            samples_reversed: second.1,
        })
    }

    fn width(&self) -> usize {
        if self.are_columns { self.lines } else { self.samples }
    }

    fn height(&self) -> usize {
        if self.are_columns { self.samples } else { self.lines }
    }

    /// Puts the pixels of the file in the usual order, rows from the top, each from the left.
    fn turn(&self, values: &mut [f32]) {
        let Self { lines, samples, are_columns, lines_reversed, samples_reversed } = *self;
        if (are_columns, lines_reversed, samples_reversed) == (false, false, false) {
            return;
        }
        let width = self.width();
        let file = values.as_chunks::<3>().0.to_vec();
        let picture = values.as_chunks_mut::<3>().0;
        for (index, pixel) in file.iter().enumerate() {
            let (line, sample) = (index / samples, index % samples);
            let line = if lines_reversed { lines - 1 - line } else { line };
            let sample = if samples_reversed { samples - 1 - sample } else { sample };
            let (row, column) = if are_columns { (sample, line) } else { (line, sample) };
            picture[row * width + column] = *pixel;
        }
    }
}

/// What the lines of the header say about the pixels.
struct Meaning {
    /// Product of all `EXPOSURE` and `COLORCORR` lines, per channel.
    divisors: [f64; 3],
    to_rec_709: Option<DMat3>,
}

/// Reads the lines of a header; refuses formats and numbers that would be misread.
fn meaning(header: &str) -> Result<Meaning> {
    let mut divisors = [1.0; 3];
    let mut to_rec_709 = None;
    for (index, line) in header.lines().enumerate() {
        let Some((key, value)) = line.split_once('=') else { continue };
        let place = || Place::line(index as u64 + 1);
        let fault = || Error::bad_frame(format!("`{line}` holds no positive number")).at(place());
        match key.trim_end() {
            "FORMAT" if value.trim() != "32-bit_rle_rgbe" => {
                return Err(Error::bad_frame(format!(
                    "format {} is not read, only 32-bit_rle_rgbe; convert it (`ra_xyze -r`)",
                    value.trim()
                ))
                .at(place()));
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
            "PRIMARIES" => {
                let numbers: Option<Vec<f64>> =
                    value.split_whitespace().map(|word| word.parse().ok()).collect();
                let Some(&[rx, ry, gx, gy, bx, by, wx, wy]) = numbers.as_deref() else {
                    return Err(Error::bad_frame(format!(
                        "`{line}` does not hold eight numbers: x and y of red, green, blue and white"
                    ))
                    .at(place()));
                };
                // What programs write that know none, many panoramas for sale among their pictures.
                if numbers.iter().flatten().all(|number| *number == 0.0) {
                    continue;
                }
                let [red, green, blue, white] =
                    [[rx, ry], [gx, gy], [bx, by], [wx, wy]].map(DVec2::from_array);
                let primaries = Primaries { red, green, blue, white };
                to_rec_709 = primaries.to_rec_709("PRIMARIES").map_err(|error| error.at(place()))?;
            }
            _ => {}
        }
    }
    if divisors.iter().all(|divisor| divisor.is_normal()) {
        return Ok(Meaning { divisors, to_rec_709 });
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
        read(&mut bytes.as_slice(), &mut frame, None)?;
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
                [32.0, 32.0, 32.0],
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
            ("#?RADIANCE\n\n+X 2 -X 1\n", "`+X 2 -X 1`"),
            ("#?RADIANCE\nPRIMARIES=1 2 3\n\n-Y 1 +X 2\n", "line 2: `PRIMARIES=1 2 3`"),
            ("#?RADIANCE\nPRIMARIES=.64 .33 .3 .6 .15 .06 .3 0\n\n-Y 1 +X 2\n", "y = 0"),
            ("#?RADIANCE\n\n-Y 0 +X 2\n", "no pixels"),
            ("#?RADIANCE\n\n-Y 16385 +X 2\n", "2 x 16385"),
            ("#?RADIANCE\n\n-Y 1 +X 4294967295\n", "4294967295 x 1"),
            ("#?RADIANCE\n\n-Y 1\n", "`-Y 1`"),
            ("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", "does not end"),
        ] {
            let error = picture(header, &PIXELS).unwrap_err().to_string();
            assert!(error.contains(expected), "{header:?}: {error}");
        }
        let header = "#?RADIANCE\n\n-Y 1 +X 2\n";
        assert!(picture(header, &PIXELS[..7]).unwrap_err().to_string().contains("complete?"));
    }

    /// The numbers of a picture's pixels in rows from the top: its file holds 1, 2, 3, 4, 5, 6 as red.
    fn turned(resolution: &str) -> Vec<u32> {
        let mut bytes = format!("#?RADIANCE\n\n{resolution}\n").into_bytes();
        bytes.extend((1..=6).flat_map(|number| [number, 0, 0, 136]));
        let mut frame = Frame::default();
        read(&mut bytes.as_slice(), &mut frame, None).unwrap();
        let Pixels::Radiance(values) = frame.pixels else { panic!("codes") };
        let size = if resolution.contains("Y 2") { (3, 2) } else { (2, 3) };
        assert_eq!((frame.width, frame.height), size, "{resolution}");
        values.as_chunks::<3>().0.iter().map(|pixel| pixel[0] as u32).collect()
    }

    #[test]
    fn all_eight_orders_of_pixels_are_turned() {
        for (resolution, expected) in [
            ("-Y 2 +X 3", [1, 2, 3, 4, 5, 6]),
            ("-Y 2 -X 3", [3, 2, 1, 6, 5, 4]),
            ("+Y 2 +X 3", [4, 5, 6, 1, 2, 3]),
            ("+Y 2 -X 3", [6, 5, 4, 3, 2, 1]),
            // Scan lines are columns.
            ("+X 3 -Y 2", [1, 3, 5, 2, 4, 6]),
            ("-X 3 -Y 2", [5, 3, 1, 6, 4, 2]),
            ("+X 3 +Y 2", [2, 4, 6, 1, 3, 5]),
            ("-X 3 +Y 2", [6, 4, 2, 5, 3, 1]),
        ] {
            assert_eq!(turned(resolution), expected, "{resolution}");
        }
        assert_eq!(turned("-Y 3 +X 2"), [1, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn a_header_with_crlf_is_read_where_the_pixels_are_whole() {
        let header = "#?RADIANCE\r\nEXPOSURE=2\r\n\r\n-Y 1 +X 2\r\n";
        assert_eq!(picture(header, &PIXELS).unwrap()[..3], [0.5, 0.25, 0.125]);
        let error = picture(header, &PIXELS[..7]).unwrap_err().to_string();
        assert!(error.contains("transfer as text"), "{error}");
    }

    #[test]
    fn primaries_are_converted() {
        let none = "#?RADIANCE\nPRIMARIES=0 0 0 0 0 0 0 0\n\n-Y 1 +X 2\n";
        assert_eq!(picture(none, &PIXELS).unwrap()[..3], [1.0, 0.5, 0.25]);
        let srgb = "#?RADIANCE\nPRIMARIES=.64 .33 .3 .6 .15 .06 .3127 .329\n\n-Y 1 +X 2\n";
        assert_eq!(picture(srgb, &PIXELS).unwrap()[..3], [1.0, 0.5, 0.25]);
        // XYZ (1, 0.5, 0.25), by the published inverse of the matrix of sRGB.
        let xyz = "#?RADIANCE\nPRIMARIES=1 0 0 1 0 0 .333333 .333333\n\n-Y 1 +X 2\n";
        let found = picture(xyz, &PIXELS).unwrap();
        for (found, expected) in found.iter().zip([2.3470, -0.0209, 0.2178]) {
            assert!((found - expected).abs() < 2e-3, "{found} {expected}");
        }
    }
}
