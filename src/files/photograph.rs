//! Photographs as 8-bit grey, for detectors that look for shapes and not for radiance.

use super::dispatch::read;
use crate::error::{Error, Result};
use lightcast_core::image::{Frame, Pixels};
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

/// Fractions of the pixels that may become black and white when 16 bits are scaled to 8: a lamp in the
/// picture can be a thousand times brighter than the objects of interest.
const BLACK_SHARE: f64 = 0.01;
const WHITE_SHARE: f64 = 0.05;

/// Reads a picture of codes: PNG, JPEG, or a frame of a recording. Colours become luma; pictures of more than
/// 8 bits are stretched so that 1 % of the pixels are black and 5 % white.
///
/// # Errors
///
/// `BadFrame`, naming the file: those of [`read`], and a picture of radiance.
pub fn read_grey(path: &Path) -> Result<GreyPicture> {
    let mut frame = Frame::default();
    read(path, &mut frame)?;
    let Frame { width, height, channels, pixels, .. } = frame;
    let Pixels::Codes(mut codes) = pixels else {
        return Err(Error::bad_frame("holds radiance; photographs are PNG or JPEG").at(path));
    };
    if channels == 3 {
        // ITU-R BT.601, on coded values.
        let luma = |rgb: &[u16; 3]| {
            (0.299 * f64::from(rgb[0]) + 0.587 * f64::from(rgb[1]) + 0.114 * f64::from(rgb[2])).round()
        };
        codes = codes.as_chunks().0.iter().map(|rgb| luma(rgb) as u16).collect();
    }
    let values = if codes.iter().any(|&code| code > 255) {
        stretched(&codes)
    } else {
        codes.iter().map(|&code| code as u8).collect()
    };
    Ok(GreyPicture { width, height, values })
}

/// Scales 16 bits to 8; a picture of one value becomes black.
fn stretched(values: &[u16]) -> Vec<u8> {
    let mut sorted = values.to_vec();
    let mut at = |share: f64| {
        let index = (share * (values.len() - 1) as f64).round() as usize;
        f64::from(*sorted.select_nth_unstable(index).1)
    };
    let (black, white) = (at(BLACK_SHARE), at(1.0 - WHITE_SHARE));
    let scale = if white > black { 255.0 / (white - black) } else { 0.0 };
    // `as` saturates to 0 ... 255.
    values.iter().map(|&value| ((f64::from(value) - black) * scale).round() as u8).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;
    use crate::files::{write_exr, write_png8, write_png16};

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
    fn jpeg_is_read_and_radiance_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.jpg");
        let grey = ::image::GrayImage::from_fn(64, 32, |x, _| ::image::Luma([if x < 32 { 20 } else { 220 }]));
        grey.save_with_format(&path, ::image::ImageFormat::Jpeg).unwrap();
        let picture = read_grey(&path).unwrap();
        assert_eq!((picture.width, picture.height), (64, 32));
        assert!(picture.values[5].abs_diff(20) < 5 && picture.values[60].abs_diff(220) < 5);
        let path = folder.path().join("a.exr");
        let frame = Frame { width: 1, height: 1, pixels: Pixels::Radiance(vec![1.0]), ..Frame::default() };
        write_exr(&path, &frame, None, false).unwrap();
        let error = read_grey(&path).unwrap_err();
        assert_eq!(error.kind(), Kind::BadFrame);
        assert!(error.to_string().ends_with("a.exr: holds radiance; photographs are PNG or JPEG"), "{error}");
    }
}
