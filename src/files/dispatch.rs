//! Reads a picture file of any kind.
//!
//! The kind is taken from the first bytes, never from the name, so that a PNG called `.exr` is read and a
//! text file called `.exr` is refused as what it is.

use super::codec::{Attributes, guarded, open_picture};
use super::{jpeg, open_exr, png, radiance};
use crate::error::{Error, Kind, Result};
use crate::rt::is_out_of_handles;
use lightcast_core::image::Frame;
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Seek};
use std::path::Path;

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
/// Of kind [`NotNow`](Kind::NotNow) where no file handle is left, which is no fault of the file. Of kind
/// [`BadFrame`](Kind::BadFrame), naming the file: missing, empty, truncated, damaged,
/// of unknown kind, of a kind or size that is not supported. `frame` is then empty (0 x 0). No content of a
/// file causes a panic.
pub fn read(path: &Path, frame: &mut Frame) -> Result<Attributes> {
    guarded(frame, |frame| read_by_kind(path, frame, None)).map_err(|error| error.at(path))
}

/// [`read`] for a picture that must have `size`, its columns and rows. One of another size is refused before
/// it is decoded: between frames of 128 x 128 a panorama would take gigabytes.
///
/// # Errors
/// Those of [`read`], and of kind [`BadFrame`](Kind::BadFrame) another size.
pub fn read_of_size(path: &Path, size: [usize; 2], frame: &mut Frame) -> Result<Attributes> {
    guarded(frame, |frame| read_by_kind(path, frame, Some(size))).map_err(|error| error.at(path))
}

/// [`read`] for a file's bytes that are already in memory.
///
/// # Errors
/// Those of [`read`], without a name.
pub fn decode(bytes: &[u8], frame: &mut Frame) -> Result<Attributes> {
    guarded(frame, |frame| decode_by_kind(Cursor::new(bytes), bytes.len() as u64, frame, None))
}

fn read_by_kind(path: &Path, frame: &mut Frame, size: Option<[usize; 2]>) -> Result<Attributes> {
    let open = || -> std::io::Result<(BufReader<File>, u64)> {
        let file = open_picture(path)?;
        let bytes = file.metadata()?.len();
        Ok((BufReader::with_capacity(1 << 16, file), bytes))
    };
    let (file, bytes) = open().map_err(|error| {
        let kind = if is_out_of_handles(&error) { Kind::NotNow } else { Kind::BadFrame };
        Error::bad_frame("cannot be opened").because(error).with_kind(kind)
    })?;
    decode_by_kind(file, bytes, frame, size)
}

fn decode_by_kind(
    mut file: impl BufRead + Seek,
    bytes: u64,
    frame: &mut Frame,
    size: Option<[usize; 2]>,
) -> Result<Attributes> {
    (frame.bayer, frame.saturation) = (None, f32::INFINITY);
    let head = file.fill_buf().map_err(|error| Error::bad_frame("cannot be read").because(error))?;
    match head {
        [] => Err(Error::bad_frame("is empty")),
        [0x76, 0x2f, 0x31, 0x01, ..] => open_exr::read(&mut file, bytes, frame, size),
        [b'#', b'?', ..] => radiance::read(&mut file, frame, size),
        [0x89, b'P', b'N', b'G', ..] => png::read(file, bytes, frame, size),
        [0xff, 0xd8, 0xff, ..] => jpeg::read(file, frame, size),
        _ => Err(Error::bad_frame(format!(
            "is neither OpenEXR, Radiance HDR, PNG nor JPEG (it begins with the bytes {:02x?}); give one of these",
            &head[..head.len().min(8)]
        ))),
    }
}

/// The warning for a picture of this size that is used as a lat-long panorama: `None` when it is twice as
/// wide as high. Other pictures are most likely fisheye pictures, mirror balls or crops, but no file says so.
pub fn lat_long_note(width: usize, height: usize) -> Option<String> {
    (width != 2 * height).then(|| {
        format!(
            "is {width} x {height}, but a lat-long panorama of the whole sphere is twice as wide as high; taken as one \
             all the same, its pixels stretched"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::image::Pixels;
    use std::fs;

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
        // Without overflow checks the decoder reads on to the end.
        assert!(error.contains("gave up") || error.contains("complete?"), "{error}");
    }
}
