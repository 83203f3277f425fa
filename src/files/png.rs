//! PNG pictures: 16 bits are sensor codes, read and written; 8 bits are codes of an ordinary camera when
//! read, and pictures for display when written.

use super::codec::{Attributes, check_samples, check_size, resize, widen, with_codes};
use super::replace::replace_file;
use crate::error::{Error, Result};
use ::image::codecs::png::{CompressionType, FilterType, PngDecoder, PngEncoder};
use ::image::{ColorType, ExtendedColorType, ImageDecoder, ImageEncoder, Limits};
use lightcast_core::image::{Frame, Pixels};
use std::io::{BufRead, Seek, Write};
use std::path::Path;

/// Memory that the decoder may allocate besides the pixels: rows, palettes, texts, colour profiles.
const DECODER_BYTES: u64 = 1 << 26;

/// Deflate expands one byte to at most 1032 bytes (258 bytes for two bits, RFC 1951).
const MAX_INFLATION: u64 = 1032;

/// Reads the picture behind `source`, which is `file_bytes` long, into `frame` as codes; `size`: the only one
/// that it may have.
pub(super) fn read(
    source: impl BufRead + Seek,
    file_bytes: u64,
    frame: &mut Frame,
    size: Option<[usize; 2]>,
) -> Result<Attributes> {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(DECODER_BYTES);
    let decoder = PngDecoder::with_limits(source, limits).map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height, size)?;
    let (channels, is_bytes) = match decoder.color_type() {
        ColorType::L8 => (1, true),
        ColorType::Rgb8 => (3, true),
        ColorType::L16 => (1, false),
        ColorType::Rgb16 => (3, false),
        _ => {
            return Err(Error::bad_frame("is a PNG with an alpha channel; save it as grey or RGB without"));
        }
    };
    if decoder.total_bytes() > file_bytes.saturating_mul(MAX_INFLATION) {
        return Err(Error::bad_frame(format!(
            "is truncated or damaged: {file_bytes} bytes cannot hold {width} x {height} pixels"
        )));
    }
    with_codes(frame, |codes| {
        resize(codes, width * height * channels);
        if is_bytes {
            let samples = codes.len();
            decoder.read_image(&mut bytemuck::cast_slice_mut(codes)[..samples]).map_err(damaged)?;
            widen(codes);
            return Ok(());
        }
        decoder.read_image(bytemuck::cast_slice_mut(codes)).map_err(damaged)
    })?;
    (frame.width, frame.height, frame.channels) = (width, height, channels);
    Ok(Attributes::default())
}

fn damaged(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::bad_frame("cannot be decoded as PNG; is it complete?").because(error)
}

/// Writes sensor codes as a 16-bit PNG, grey or RGB. The same frame always produces the same bytes.
///
/// # Errors
///
/// A frame of radiance (for which there is [`write_exr`](super::write_exr)) or of the wrong length, a file
/// that cannot be written.
pub fn write_png16(path: &Path, frame: &Frame) -> Result<()> {
    let Pixels::Codes(codes) = &frame.pixels else {
        return Err(Error::failed("holds radiance, which is written as OpenEXR").at(path));
    };
    let colour = match frame.channels {
        1 => ExtendedColorType::L16,
        3 => ExtendedColorType::Rgb16,
        channels => {
            return Err(
                Error::failed(format!("has {channels} channels; PNG files of codes have 1 or 3")).at(path)
            );
        }
    };
    replace_file(path, |writer| {
        check_samples(frame.width, frame.height, frame.channels, codes.len())?;
        write(writer, frame.width, frame.height, colour, bytemuck::cast_slice(codes))
    })
}

/// Writes a picture for display: `width * height` pixels of three bytes, sRGB, row-major.
///
/// # Errors
///
/// A slice of the wrong length, a file that cannot be written.
pub fn write_png8(path: &Path, width: usize, height: usize, rgb: &[u8]) -> Result<()> {
    replace_file(path, |writer| {
        check_samples(width, height, 3, rgb.len())?;
        write(writer, width, height, ExtendedColorType::Rgb8, rgb)
    })
}

/// [`write_png8`] with alpha: four bytes per pixel, colours not premultiplied by alpha.
///
/// # Errors
///
/// As [`write_png8`].
pub fn write_png8_with_alpha(path: &Path, width: usize, height: usize, rgba: &[u8]) -> Result<()> {
    replace_file(path, |writer| {
        check_samples(width, height, 4, rgba.len())?;
        write(writer, width, height, ExtendedColorType::Rgba8, rgba)
    })
}

/// The bytes of the file that [`write_png8`] writes.
///
/// # Errors
/// A slice of the wrong length.
pub fn encode_png8(width: usize, height: usize, rgb: &[u8]) -> Result<Vec<u8>> {
    check_samples(width, height, 3, rgb.len())?;
    let mut bytes = Vec::new();
    write(&mut bytes, width, height, ExtendedColorType::Rgb8, rgb)?;
    Ok(bytes)
}

fn write(
    writer: &mut impl Write,
    width: usize,
    height: usize,
    colour: ExtendedColorType,
    bytes: &[u8],
) -> Result<()> {
    check_size(width, height, None).map_err(|error| error.with_kind(crate::error::Kind::Failed))?;
    PngEncoder::new_with_quality(writer, CompressionType::Default, FilterType::Adaptive)
        .write_image(bytes, width as u32, height as u32, colour)
        .map_err(|error| Error::failed("cannot be written").because(error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;
    use crate::files::read;

    fn codes(width: usize, height: usize, channels: usize) -> Frame {
        let codes = (0..width * height * channels).map(|n| (n * 7919 % 65536) as u16).collect();
        Frame { width, height, channels, pixels: Pixels::Codes(codes), ..Frame::default() }
    }

    #[test]
    fn grey_and_rgb_codes_come_back_and_buffers_are_reused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let mut frame = Frame::default();
        for channels in [3, 1] {
            write_png16(&path, &codes(31, 17, channels)).unwrap();
            assert_eq!(read(&path, &mut frame).unwrap(), Attributes::default());
            assert_eq!(frame, codes(31, 17, channels));
        }
        let Pixels::Codes(values) = &frame.pixels else { panic!("radiance") };
        assert!(values.capacity() >= 31 * 17 * 3, "the buffer of the larger picture was given up");
    }

    #[test]
    fn pictures_of_8_bits_are_codes_to_255() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_png8(&path, 2, 1, &[1, 2, 3, 4, 5, 255]).unwrap();
        let mut frame = Frame::default();
        read(&path, &mut frame).unwrap();
        assert_eq!((frame.width, frame.height, frame.channels), (2, 1, 3));
        assert_eq!(frame.pixels, Pixels::Codes(vec![1, 2, 3, 4, 5, 255]));
        assert_eq!(write_png8(&path, 2, 2, &[0; 6]).unwrap_err().kind(), Kind::Failed);
        let radiance = Frame { pixels: Pixels::Radiance(vec![0.0]), width: 1, height: 1, ..Frame::default() };
        assert_eq!(write_png16(&path, &radiance).unwrap_err().kind(), Kind::Failed);
    }

    #[test]
    fn header_that_claims_more_than_its_bytes_is_refused_before_allocation() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_png16(&path, &codes(16_384, 1, 1)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let error = super::read(std::io::Cursor::new(&bytes), 20, &mut Frame::default(), None).unwrap_err();
        assert!(error.to_string().contains("20 bytes cannot hold 16384 x 1"), "{error}");
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        let error = read(&path, &mut Frame::default()).unwrap_err();
        assert!(error.to_string().contains("complete?"), "{error}");
    }
}
