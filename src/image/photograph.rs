//! Photographs as 8-bit grey, for what looks for shapes and not for radiance.

use super::file::check_size;
use crate::error::{Error, Result};
use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use std::fs::File;
use std::io::BufReader;
use std::panic::catch_unwind;
use std::path::Path;

/// A picture of grey values for display, row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GreyPicture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` values.
    pub values: Vec<u8>,
}

/// Memory that a decoder may take: 1.2 GB are 8 bytes for each of 2^27 pixels and some tables.
const DECODER_BYTES: u64 = 1_200_000_000;

/// Shares of the pixels that may become black and white when 16 bits are scaled to 8: a lamp in the picture is a
/// thousand times brighter than what is to be seen.
const BLACK_SHARE: f64 = 0.01;
const WHITE_SHARE: f64 = 0.05;

/// Reads a PNG (8 or 16 bits) or JPEG file. Colours become luma; 16-bit values are stretched, so that 1 % of the pixels
/// are black and 5 % white.
///
/// # Errors
///
/// `BadFrame`, naming the file: one that cannot be opened, is damaged or of another kind, or has no pixels or more than
/// [`MAX_PIXELS`](super::MAX_PIXELS). No content of a file panics.
pub fn read_grey(path: &Path) -> Result<GreyPicture> {
    // As for frames: a decoder that panics on a damaged file must not end the program.
    catch_unwind(|| decode(path))
        .unwrap_or_else(|_| Err(Error::bad_frame("is damaged: its decoder gave up")))
        .map_err(|error| error.at(path.display()))
}

fn decode(path: &Path) -> Result<GreyPicture> {
    let unreadable = |error: std::io::Error| Error::bad_frame("cannot be opened").because(error);
    let damaged =
        |error: ::image::ImageError| Error::bad_frame("cannot be decoded; is it complete?").because(error);
    let file = BufReader::new(File::open(path).map_err(unreadable)?);
    let mut reader = ImageReader::new(file).with_guessed_format().map_err(unreadable)?;
    if !matches!(reader.format(), Some(ImageFormat::Png | ImageFormat::Jpeg)) {
        return Err(Error::bad_frame("is neither PNG nor JPEG; save photographs as one of them"));
    }
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(DECODER_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height)?;
    let picture = DynamicImage::from_decoder(decoder).map_err(damaged)?;
    let values = match picture {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => stretched(picture.into_luma16().as_raw()),
        _ => picture.into_luma8().into_raw(),
    };
    Ok(GreyPicture { width, height, values })
}

/// 16 bits to 8; a picture of one value becomes black.
fn stretched(values: &[u16]) -> Vec<u8> {
    let mut sorted = values.to_vec();
    let mut at = |share: f64| {
        let index = (share * (values.len() - 1) as f64).round() as usize;
        f64::from(*sorted.select_nth_unstable(index).1)
    };
    let (black, white) = (at(BLACK_SHARE), at(1.0 - WHITE_SHARE));
    let scale = if white > black { 255.0 / (white - black) } else { 0.0 };
    // `as` keeps to 0 ... 255.
    values.iter().map(|&value| ((f64::from(value) - black) * scale).round() as u8).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;
    use crate::image::{Frame, Pixels, write_png8, write_png16};

    #[test]
    fn sixteen_bits_are_stretched_past_lamps_and_eight_stay_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        // Values 1000 to 1090 and, in 2 % of the pixels, a lamp.
        let codes: Vec<u16> =
            (0..10_000u32).map(|at| if at % 50 == 0 { 65_535 } else { 1000 + (at % 91) as u16 }).collect();
        let frame =
            Frame { width: 100, height: 100, pixels: Pixels::Codes(codes.clone()), ..Frame::default() };
        write_png16(&path, &frame).unwrap();
        let grey = read_grey(&path).unwrap();
        assert_eq!((grey.width, grey.height), (100, 100));
        for (value, code) in grey.values.iter().zip(codes) {
            let expected = ((f64::from(code) - 1000.0) / 87.0 * 255.0).clamp(0.0, 255.0);
            assert!((f64::from(*value) - expected).abs() < 4.0, "{code}: {value} {expected}");
        }

        write_png8(&path, 2, 1, &[10, 10, 10, 200, 200, 200]).unwrap();
        assert_eq!(read_grey(&path).unwrap(), GreyPicture { width: 2, height: 1, values: vec![10, 200] });
        assert_eq!(stretched(&[7, 7, 7]), [0, 0, 0]);
    }

    #[test]
    fn jpeg_is_read_and_others_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.jpg");
        let grey = ::image::GrayImage::from_fn(64, 32, |x, _| ::image::Luma([if x < 32 { 20 } else { 220 }]));
        grey.save_with_format(&path, ImageFormat::Jpeg).unwrap();
        let picture = read_grey(&path).unwrap();
        assert_eq!((picture.width, picture.height), (64, 32));
        assert!(picture.values[5].abs_diff(20) < 5 && picture.values[60].abs_diff(220) < 5);
        let whole = std::fs::read(&path).unwrap();
        for (content, part) in
            [(&b"GIF89a"[..], "neither PNG nor JPEG"), (&[], "neither"), (&whole[..whole.len() / 3], "a.jpg")]
        {
            std::fs::write(&path, content).unwrap();
            // A decoder may fill up what is missing of a JPEG file.
            let Err(error) = read_grey(&path) else {
                assert!(content.len() > 10);
                continue;
            };
            assert_eq!(error.kind(), Kind::BadFrame);
            assert!(error.to_string().contains(part), "{error}");
        }
        assert!(
            read_grey(&folder.path().join("b.png"))
                .unwrap_err()
                .to_string()
                .contains("b.png: cannot be opened")
        );
    }
}
