//! What the codecs of picture files share: how large a picture may be, the frame's buffers, and the guard
//! around a decoder that may panic.

use crate::error::{Error, Result};
use crate::rt;
use lightcast_core::image::{Frame, LatLongCentres, Pixels};
use rustix::fs::OFlags;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

/// Longest side that is read. The largest panoramas sold are 16384 x 8192, the largest fisheye sensors far
/// smaller; a damaged header may claim anything up to 2^32.
pub const MAX_SIDE_PX: usize = 16_384;

/// Most pixels that are read: a panorama of 16384 x 8192, which is 1.6 GB as RGB floats.
pub const MAX_PIXELS: usize = 1 << 27;

/// What a file holds besides its pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Attributes {
    /// Frames per second, finite and > 0, where the file says so (OpenEXR `framesPerSecond`); 0 in a
    /// recording of a camera without a rate.
    pub frame_rate_hz: Option<f64>,
    /// How the pixels lie if the picture is a lat-long map.
    pub latlong_centres: LatLongCentres,
    /// Samples that were infinite, because they were beyond what half floats hold or what a renderer could
    /// add up, and are read as the largest value: 65504 of half floats, else the largest finite one of the
    /// picture.
    pub overflowed: u64,
    /// When it was captured, by the clock of the camera; only recorded files say so.
    pub capture_time_ns: Option<i64>,
}

/// Opens a picture file. A pipe, of which no picture is made, is not waited for, and a device is not read.
pub(super) fn open_picture(path: &Path) -> io::Result<File> {
    let flags = OFlags::NONBLOCK.bits() as i32;
    let file = OpenOptions::new().read(true).custom_flags(flags).open(path)?;
    match file.metadata()?.is_file() {
        true => Ok(file),
        false => Err(io::Error::new(ErrorKind::InvalidInput, "it is no file")),
    }
}

/// Runs a decoder. Those of `exr` 1.74 and `image` 0.25 index and multiply with numbers from the file and
/// panic on some damaged ones. One bad frame must not stop a run, so the panic ends here. None of their state
/// outlives the call, and the frame is emptied after any error, so no partial state remains visible.
pub(super) fn guarded<T>(frame: &mut Frame, decode: impl FnOnce(&mut Frame) -> Result<T>) -> Result<T> {
    let outcome = rt::contained(|| decode(frame)).unwrap_or_else(|cause| {
        Err(Error::bad_frame(format!("is damaged: its decoder gave up with `{cause}`")))
    });
    if outcome.is_err() {
        (frame.width, frame.height) = (0, 0);
        match &mut frame.pixels {
            Pixels::Codes(codes) => codes.clear(),
            Pixels::Radiance(values) => values.clear(),
        }
    }
    outcome
}

/// Refuses sizes that no real picture has, and those that are not `wanted`, before anything is allocated for
/// them.
pub(super) fn check_size(width: usize, height: usize, wanted: Option<[usize; 2]>) -> Result<()> {
    if let Some([wanted_width, wanted_height]) = wanted.filter(|&size| size != [width, height]) {
        return Err(Error::bad_frame(format!(
            "is {width} x {height}, and not {wanted_width} x {wanted_height} as the other frames"
        )));
    }
    if width == 0 || height == 0 {
        return Err(Error::bad_frame(format!("has no pixels ({width} x {height})")));
    }
    if width > MAX_SIDE_PX || height > MAX_SIDE_PX || width * height > MAX_PIXELS {
        return Err(Error::bad_frame(format!(
            "is said to be {width} x {height}; at most {MAX_SIDE_PX} a side and {MAX_PIXELS} pixels are read"
        )));
    }
    Ok(())
}

/// Gives `values` exactly `len` elements of any value, without allocating when they fit.
///
/// A buffer that is too small is replaced by zeroed memory, which the system hands out page by page as it is
/// written: a damaged header that claims a huge picture costs little.
pub(super) fn resize<T: Copy + Default>(values: &mut Vec<T>, len: usize) {
    if values.capacity() < len {
        *values = vec![T::default(); len];
    } else {
        values.resize(len, T::default());
    }
}

/// Converts bytes, which fill the first half of the codes' memory, to codes of the same values.
pub(super) fn widen(codes: &mut [u16]) {
    // This runs from the end, because each code is written at or after the bytes that are still to be read.
    for index in (0..codes.len()).rev() {
        codes[index] = u16::from(bytemuck::cast_slice::<u16, u8>(codes)[index]);
    }
}

/// Runs `decode` on the frame's radiance buffer, whose memory is kept whatever the outcome.
pub(super) fn with_radiance<T>(
    frame: &mut Frame,
    decode: impl FnOnce(&mut Vec<f32>) -> Result<T>,
) -> Result<T> {
    if let Pixels::Radiance(values) = &mut frame.pixels {
        return decode(values);
    }
    let mut values = Vec::new();
    let outcome = decode(&mut values);
    frame.pixels = Pixels::Radiance(values);
    outcome
}

/// Runs `decode` on the frame's code buffer, whose memory is kept whatever the outcome.
pub(super) fn with_codes<T>(frame: &mut Frame, decode: impl FnOnce(&mut Vec<u16>) -> Result<T>) -> Result<T> {
    if let Pixels::Codes(codes) = &mut frame.pixels {
        return decode(codes);
    }
    let mut codes = Vec::new();
    let outcome = decode(&mut codes);
    frame.pixels = Pixels::Codes(codes);
    outcome
}

/// Checks that a picture to be written has as many samples as its size requires.
pub(super) fn check_samples(width: usize, height: usize, channels: usize, samples: usize) -> Result<()> {
    if width == 0 || height == 0 || !matches!(channels, 1 | 3 | 4) || samples != width * height * channels {
        return Err(Error::failed(format!(
            "cannot be written: {samples} samples are no picture of {width} x {height} x {channels} (1, 3 or 4 channels)"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_checked_on_both_sides_of_the_limit() {
        assert!(check_size(16_384, 8_192, None).is_ok());
        assert!(check_size(8_192, 16_384, None).is_ok());
        assert!(check_size(16_384, 8_193, None).is_err());
        assert!(check_size(16_385, 1, None).is_err());
        assert!(check_size(0, 5, None).is_err());
        assert!(check_size(6, 5, Some([6, 5])).is_ok());
        let error = check_size(16_384, 8_192, Some([6, 5])).unwrap_err().to_string();
        assert_eq!(error, "is 16384 x 8192, and not 6 x 5 as the other frames");
    }
}
