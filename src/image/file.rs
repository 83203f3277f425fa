//! Picture files of every kind: which kind it is, how big a picture may be, and how a file is replaced.
//!
//! The kind is taken from the first bytes, never from the name, so that a PNG called `.exr` is read and a text
//! called `.exr` is refused by what it is.

use super::{Frame, Pixels, jpeg, open_exr, png, radiance};
use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::{BufRead, BufReader, BufWriter, Cursor, Seek, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Longest side that is read. The largest panoramas sold are 16384 x 8192, the largest fisheye sensors far
/// smaller; a damaged header claims anything up to 2^32.
pub const MAX_SIDE_PX: usize = 16_384;

/// Most pixels that are read: a panorama of 16384 x 8192, which is 1.6 GB as RGB floats.
pub const MAX_PIXELS: usize = 1 << 27;

/// Where the pixel centres of a lat-long picture lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LatLongCentres {
    /// Half a pixel inside the edge: column c of N stands at (c + 1/2) / N of the turn.
    #[default]
    Half,
    /// First and last centre on the poles and on +-pi: column c of N stands at c / (N - 1). OpenEXR files with
    /// the attribute `envmap` are made so.
    Ends,
}

/// What to tell somebody who gives a picture of this size as a lat-long panorama: nothing when it is twice as wide
/// as high. Others are most likely fisheye pictures, mirror balls or cuts, of which no file says so.
pub fn lat_long_note(width: usize, height: usize) -> Option<String> {
    (width != 2 * height).then(|| {
        format!(
            "is {width} x {height}, but a lat-long panorama of the whole sphere is twice as wide as high; taken as one \
             all the same, its pixels stretched"
        )
    })
}

/// What a file says beside its pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Attributes {
    /// Frames per second, finite and > 0, where the file says so (OpenEXR `framesPerSecond`); 0 in a recording of a camera
    /// without a rate.
    pub frame_rate_hz: Option<f64>,
    /// How the pixels lie if the picture is a lat-long map.
    pub latlong_centres: LatLongCentres,
    /// When it was captured, by the clock of the camera; only recorded files say so.
    pub capture_time_ns: Option<i64>,
}

/// Reads a picture into `frame`, whose buffer is reused when it fits; the stamp is left as it is.
///
/// | file | becomes |
/// |---|---|
/// | OpenEXR of `lightcast record` | sensor codes, 1 or 3 channels, with the mosaic; or radiance |
/// | OpenEXR, scan lines or tiles, half, float or uint | radiance, 3 channels (`R`, `G`, `B`) or 1 (`Y`) |
/// | Radiance `.hdr`, RGBE | radiance, 3 channels, divided by all `EXPOSURE` and `COLORCORR` lines |
/// | PNG, 16 or 8 bits, grey or RGB | sensor codes (0 to 255 of 8 bits), 1 or 3 channels |
/// | JPEG, grey or colour | codes 0 to 255, 1 or 3 channels, as [`decode_jpeg`](super::decode_jpeg) |
///
/// Samples are delivered as they stand in the file, NaN, infinite and negative ones included: the calibration
/// counts them.
///
/// # Errors
///
/// Of kind [`BadFrame`](crate::error::Kind::BadFrame), naming the file: missing, empty, truncated, damaged, of no
/// known kind, of a kind or size that is not read. `frame` is then empty (0 x 0). No content of a file panics.
pub fn read(path: &Path, frame: &mut Frame) -> Result<Attributes> {
    guarded(frame, |frame| read_by_kind(path, frame)).map_err(|error| error.at(path.display()))
}

/// Runs a decoder. Those of `exr` 1.74 and `image` 0.25 index and multiply with numbers from the file and panic on
/// some damaged ones. One bad frame must not stop a run, so the panic ends here. Nothing of theirs outlives the call,
/// and the frame is emptied after any error, so no half-made state is seen.
pub(super) fn guarded<T>(frame: &mut Frame, decode: impl FnOnce(&mut Frame) -> Result<T>) -> Result<T> {
    let outcome = catch_unwind(AssertUnwindSafe(|| decode(frame))).unwrap_or_else(|panic| {
        let cause = panic
            .downcast_ref::<&str>()
            .map(ToString::to_string)
            .or_else(|| panic.downcast_ref::<String>().cloned())
            .unwrap_or_default();
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

/// [`read`] of a file's bytes, which came another way.
///
/// # Errors
/// Those of [`read`], without a name.
pub fn decode(bytes: &[u8], frame: &mut Frame) -> Result<Attributes> {
    guarded(frame, |frame| decode_by_kind(Cursor::new(bytes), bytes.len() as u64, frame))
}

fn read_by_kind(path: &Path, frame: &mut Frame) -> Result<Attributes> {
    let open = || -> std::io::Result<(BufReader<File>, u64)> {
        let file = File::open(path)?;
        let bytes = file.metadata()?.len();
        Ok((BufReader::with_capacity(1 << 16, file), bytes))
    };
    let (file, bytes) = open().map_err(|error| Error::bad_frame("cannot be opened").because(error))?;
    decode_by_kind(file, bytes, frame)
}

fn decode_by_kind(mut file: impl BufRead + Seek, bytes: u64, frame: &mut Frame) -> Result<Attributes> {
    (frame.bayer, frame.saturation) = (None, f32::INFINITY);
    let head = file.fill_buf().map_err(|error| Error::bad_frame("cannot be read").because(error))?;
    match head {
        [] => Err(Error::bad_frame("is empty")),
        [0x76, 0x2f, 0x31, 0x01, ..] => open_exr::read(&mut file, bytes, frame),
        [b'#', b'?', ..] => radiance::read(&mut file, frame),
        [0x89, b'P', b'N', b'G', ..] => png::read(file, bytes, frame),
        [0xff, 0xd8, 0xff, ..] => jpeg::read(file, frame),
        _ => Err(Error::bad_frame(format!(
            "is neither OpenEXR, Radiance HDR, PNG nor JPEG (it begins with the bytes {:02x?}); give one of these",
            &head[..head.len().min(8)]
        ))),
    }
}

/// Refuses sizes that no real picture has, before anything is allocated for them.
pub(super) fn check_size(width: usize, height: usize) -> Result<()> {
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

/// Turns bytes, which fill the first half of the codes' memory, into codes of the same values.
pub(super) fn widen(codes: &mut [u16]) {
    // From the end: the codes written lie at or behind the bytes still to be read.
    for index in (0..codes.len()).rev() {
        codes[index] = u16::from(bytemuck::cast_slice::<u16, u8>(codes)[index]);
    }
}

/// Runs `decode` on the frame's radiance buffer, which is kept whatever comes out.
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

/// Runs `decode` on the frame's code buffer, which is kept whatever comes out.
pub(super) fn with_codes<T>(frame: &mut Frame, decode: impl FnOnce(&mut Vec<u16>) -> Result<T>) -> Result<T> {
    if let Pixels::Codes(codes) = &mut frame.pixels {
        return decode(codes);
    }
    let mut codes = Vec::new();
    let outcome = decode(&mut codes);
    frame.pixels = Pixels::Codes(codes);
    outcome
}

/// Writes a file under a temporary, hidden name and renames it when it is complete, so that nobody sees half a
/// file and a failed write leaves the old one.
///
/// # Errors
/// Those of `write`, and `Failed` when the file cannot be written; both name it.
pub fn replace(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let part = path.with_file_name(format!(".{name}.{}.part", std::process::id()));
    let failed = |error: std::io::Error| Error::failed("cannot be written").because(error);
    let run = || -> Result<()> {
        let mut writer = BufWriter::new(File::create(&part).map_err(failed)?);
        write(&mut writer)?;
        writer.flush().map_err(failed)?;
        drop(writer);
        fs::rename(&part, path).map_err(failed)
    };
    run().map_err(|error| {
        // Best effort: the error that matters is the one that is returned.
        let _ = fs::remove_file(&part);
        error.at(path.display())
    })
}

/// Checks that a picture to be written has the samples that its size says.
pub(super) fn check_samples(width: usize, height: usize, channels: usize, samples: usize) -> Result<()> {
    if width == 0 || height == 0 || !matches!(channels, 1 | 3) || samples != width * height * channels {
        return Err(Error::failed(format!(
            "cannot be written: {samples} samples are no picture of {width} x {height} x {channels} (1 or 3 channels)"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;

    fn failure(name: &str, content: &[u8]) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, content).unwrap();
        let mut frame =
            Frame { width: 1, height: 1, pixels: Pixels::Radiance(vec![1.0]), ..Frame::default() };
        let error = read(&path, &mut frame).unwrap_err();
        assert_eq!(error.kind(), Kind::BadFrame);
        assert_eq!((frame.width, frame.height, frame.pixels), (0, 0, Pixels::Radiance(Vec::new())));
        assert!(error.to_string().contains(path.to_str().unwrap()), "{error}");
        error.to_string()
    }

    #[test]
    fn files_that_are_no_pictures_are_named_with_their_cause() {
        assert!(failure("empty.exr", b"").ends_with("is empty"));
        assert!(failure("text.exr", b"hello world").contains("[68, 65, 6c, 6c, 6f, 20, 77, 6f]"));
        assert!(failure("short.exr", b"v/1").contains("neither OpenEXR"));
        let missing = read(Path::new("/nonexistent/a.exr"), &mut Frame::default()).unwrap_err();
        assert!(missing.to_string().starts_with("/nonexistent/a.exr: cannot be opened"), "{missing}");
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(read(folder.path(), &mut Frame::default()).unwrap_err().kind(), Kind::BadFrame);
    }

    #[test]
    fn decoders_that_panic_give_an_error() {
        // Run markers of the old Radiance form multiply by 256 each; eight overflow inside the decoder.
        let mut bytes = b"#?RADIANCE\n\n-Y 1 +X 9\n\x09\x09\x09\x80".to_vec();
        bytes.extend([1, 1, 1, 0].repeat(9));
        let error = failure("a.hdr", &bytes);
        // Without overflow checks it reads on to the end.
        assert!(error.contains("gave up") || error.contains("complete?"), "{error}");
    }

    #[test]
    fn sizes_are_checked_on_both_sides_of_the_limit() {
        assert!(check_size(16_384, 8_192).is_ok());
        assert!(check_size(8_192, 16_384).is_ok());
        assert!(check_size(16_384, 8_193).is_err());
        assert!(check_size(16_385, 1).is_err());
        assert!(check_size(0, 5).is_err());
    }

    #[test]
    fn failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        fs::write(&path, b"old").unwrap();
        let error = replace(&path, |writer| {
            writer.write_all(b"half a fi").unwrap();
            Err(Error::failed("disk full"))
        })
        .unwrap_err();
        assert!(error.to_string().ends_with("a.exr: disk full"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
