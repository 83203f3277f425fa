//! JPEG pictures of ordinary cameras: codes of 8 bits, which a response maps to radiance.

use super::codec::{Attributes, check_size, guarded, resize, widen, with_codes};
use super::huffman_tables::with_tables;
use crate::error::{Error, Result};
use ::image::codecs::jpeg::JpegDecoder;
use ::image::{ColorType, ImageDecoder};
use lightcast_core::image::Frame;
use std::io::{Cursor, Read};

/// Largest file that is read; cameras of 100 megapixels write 60 MB.
const MAX_FILE_BYTES: u64 = 1 << 28;

/// A block of 64 samples takes at least one bit, and a subsampled chroma byte expands to those of up to 4
/// pixels.
const MAX_INFLATION: u64 = 2048;

/// Decodes a JPEG picture, such as one frame of an MJPEG camera, into codes from 0 to 255: 1 channel for
/// grey, 3 for colour as coded (usually sRGB). One without Huffman tables, as many cameras send, is decoded
/// with those of the standard. The frame's buffer is reused when it fits; its stamp is left as it is. The
/// decoder itself allocates.
///
/// # Errors
///
/// Of kind [`BadFrame`](crate::error::Kind::BadFrame): truncated, damaged, CMYK, or of a size that is not
/// supported. `frame` is then empty (0 x 0). No content causes a panic.
pub fn decode_jpeg(bytes: &[u8], frame: &mut Frame) -> Result<()> {
    guarded(frame, |frame| decode(bytes, frame, None))
}

pub(super) fn read(source: impl Read, frame: &mut Frame, size: Option<[usize; 2]>) -> Result<Attributes> {
    let mut bytes = Vec::new();
    source
        .take(MAX_FILE_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| Error::bad_frame("cannot be read").because(error))?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(Error::bad_frame(format!("is a JPEG of more than {} MiB", MAX_FILE_BYTES >> 20)));
    }
    decode(&bytes, frame, size)?;
    Ok(Attributes::default())
}

fn decode(bytes: &[u8], frame: &mut Frame, size: Option<[usize; 2]>) -> Result<()> {
    let bytes = with_tables(bytes);
    let decoder = JpegDecoder::new(Cursor::new(&*bytes)).map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height, size)?;
    let channels = match decoder.color_type() {
        ColorType::L8 => 1,
        ColorType::Rgb8 => 3,
        other => {
            return Err(Error::bad_frame(format!("is a JPEG of {other:?}; save it as grey or RGB")));
        }
    };
    if decoder.total_bytes() > (bytes.len() as u64).saturating_mul(MAX_INFLATION) {
        return Err(Error::bad_frame(format!(
            "is truncated or damaged: {} bytes cannot hold {width} x {height} pixels",
            bytes.len()
        )));
    }
    with_codes(frame, |codes| {
        let samples = width * height * channels;
        resize(codes, samples);
        decoder.read_image(&mut bytemuck::cast_slice_mut(codes)[..samples]).map_err(damaged)?;
        widen(codes);
        Ok(())
    })?;
    (frame.width, frame.height, frame.channels) = (width, height, channels);
    Ok(())
}

fn damaged(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::bad_frame("cannot be decoded as JPEG; is it complete?").because(error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;
    use crate::files::read as read_file;
    use ::image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
    use lightcast_core::image::Pixels;

    fn encoded(width: u32, height: u32, colour: ExtendedColorType, samples: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, 95).encode(samples, width, height, colour).unwrap();
        bytes
    }

    #[test]
    fn grey_and_colour_come_back_near_and_buffers_are_reused() {
        let grey: Vec<u8> = (0..32 * 16).map(|n| (n % 32 * 4 + n / 32 * 7) as u8).collect();
        let colour: Vec<u8> = (0..32 * 16).flat_map(|_| [200, 100, 30]).collect();
        let mut frame = Frame::default();
        decode_jpeg(&encoded(32, 16, ExtendedColorType::Rgb8, &colour), &mut frame).unwrap();
        let Pixels::Codes(codes) = &frame.pixels else { panic!("radiance") };
        assert_eq!((frame.width, frame.height, frame.channels, codes.len()), (32, 16, 3, 32 * 16 * 3));
        assert!(codes.iter().zip(&colour).all(|(&code, &byte)| code.abs_diff(u16::from(byte)) <= 3));
        let capacity = codes.capacity();
        decode_jpeg(&encoded(32, 16, ExtendedColorType::L8, &grey), &mut frame).unwrap();
        let Pixels::Codes(codes) = &frame.pixels else { panic!("radiance") };
        assert_eq!((frame.channels, codes.len(), codes.capacity()), (1, 32 * 16, capacity));
        assert!(codes.iter().zip(&grey).all(|(&code, &byte)| code.abs_diff(u16::from(byte)) <= 6));
    }

    #[test]
    fn damaged_pictures_give_an_error_and_an_empty_frame() {
        let whole = encoded(64, 64, ExtendedColorType::L8, &[77; 64 * 64]);
        let mut huge = whole.clone();
        let size = huge.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap() + 5;
        huge[size..size + 4].copy_from_slice(&[0x3f, 0xff, 0x1f, 0xff]);
        for (bytes, part) in [(&whole[..20], "complete?"), (&huge[..], "cannot hold 8191 x 16383")] {
            let mut frame = Frame { width: 3, ..Frame::default() };
            let error = decode_jpeg(bytes, &mut frame).unwrap_err();
            assert_eq!(error.kind(), Kind::BadFrame);
            assert!(error.to_string().contains(part), "{error}");
            assert_eq!((frame.width, frame.height), (0, 0));
        }
    }

    #[test]
    fn files_are_known_by_their_first_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        std::fs::write(&path, encoded(8, 8, ExtendedColorType::L8, &[128; 64])).unwrap();
        let mut frame = Frame::default();
        read_file(&path, &mut frame).unwrap();
        assert_eq!(frame.pixels, Pixels::Codes(vec![128; 64]));
    }
}
