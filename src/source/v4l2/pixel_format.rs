//! The pixel formats of V4L2 that can be captured, and what their bytes mean. (Linux media documentation,
//! "Image Formats": luma-only, raw Bayer, packed YUV and compressed formats.)

use lightcast_core::image::Bayer;

/// Memory layout of the samples of one row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Samples {
    /// One byte each.
    Bytes,
    /// Two bytes each, least significant first; the upper bits of 10 to 14 bits are zero.
    LittleEndian,
    /// Two bytes each, most significant first.
    BigEndian,
    /// Four samples of 10 bits in five bytes: the upper eight bits of each, then the lower two of all (MIPI
    /// RAW10).
    Packed10,
    /// Four samples of 14 bits in seven bytes: the upper eight bits of each, then the lower six of all, from
    /// the least significant bit on (MIPI RAW14).
    Packed14,
    /// Two samples of 12 bits in three bytes: the upper eight bits of each, then the lower four of both (MIPI
    /// RAW12).
    Packed12,
    /// Y0 Cb Y1 Cr for two pixels.
    Yuyv,
    /// One JPEG picture.
    Jpeg,
}

impl Samples {
    /// Bytes of a row of `width` samples, without padding; 0 for compressed pictures, which have no rows.
    pub(super) fn row_bytes(self, width: usize) -> usize {
        match self {
            Self::Bytes => width,
            Self::LittleEndian | Self::BigEndian | Self::Yuyv => 2 * width,
            Self::Packed10 => (5 * width).div_ceil(4),
            Self::Packed12 => (3 * width).div_ceil(2),
            Self::Packed14 => (7 * width).div_ceil(4),
            Self::Jpeg => 0,
        }
    }

    /// Channels of the resulting frames.
    pub(super) fn channels(self) -> usize {
        if matches!(self, Self::Yuyv | Self::Jpeg) { 3 } else { 1 }
    }
}

/// A format that can be captured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PixelFormat {
    /// V4L2's code.
    pub(super) fourcc: [u8; 4],
    pub(super) samples: Samples,
    /// Colours of a mosaic sensor's pixels.
    pub(super) bayer: Option<Bayer>,
}

const fn plain(fourcc: [u8; 4], samples: Samples) -> PixelFormat {
    PixelFormat { fourcc, samples, bayer: None }
}

const fn mosaic(fourcc: &[u8; 4], samples: Samples, bayer: Bayer) -> PixelFormat {
    PixelFormat { fourcc: *fourcc, samples, bayer: Some(bayer) }
}

/// Bit 31 of a code means "most significant byte first".
const BIG_ENDIAN: u8 = 0x80;

use Bayer::{Bggr, Gbrg, Grbg, Rggb};
use Samples::{BigEndian, Bytes, Jpeg, LittleEndian, Packed10, Packed12, Packed14, Yuyv};

/// All supported formats; where a camera offers several and the user names none, the earliest in this list is
/// taken.
pub(super) const KNOWN: &[PixelFormat] = &[
    plain(*b"Y16 ", LittleEndian),
    plain([b'Y', b'1', b'6', b' ' | BIG_ENDIAN], BigEndian),
    mosaic(b"RG16", LittleEndian, Rggb),
    mosaic(b"GR16", LittleEndian, Grbg),
    mosaic(b"GB16", LittleEndian, Gbrg),
    mosaic(b"BYR2", LittleEndian, Bggr),
    plain(*b"Y14 ", LittleEndian),
    mosaic(b"RG14", LittleEndian, Rggb),
    mosaic(b"GR14", LittleEndian, Grbg),
    mosaic(b"GB14", LittleEndian, Gbrg),
    mosaic(b"BG14", LittleEndian, Bggr),
    plain(*b"Y14P", Packed14),
    mosaic(b"pREE", Packed14, Rggb),
    mosaic(b"pgEE", Packed14, Grbg),
    mosaic(b"pGEE", Packed14, Gbrg),
    mosaic(b"pBEE", Packed14, Bggr),
    plain(*b"Y12 ", LittleEndian),
    plain(*b"Y12P", Packed12),
    mosaic(b"RG12", LittleEndian, Rggb),
    mosaic(b"BA12", LittleEndian, Grbg),
    mosaic(b"GB12", LittleEndian, Gbrg),
    mosaic(b"BG12", LittleEndian, Bggr),
    mosaic(b"pRCC", Packed12, Rggb),
    mosaic(b"pgCC", Packed12, Grbg),
    mosaic(b"pGCC", Packed12, Gbrg),
    mosaic(b"pBCC", Packed12, Bggr),
    plain(*b"Y10 ", LittleEndian),
    plain(*b"Y10P", Packed10),
    mosaic(b"RG10", LittleEndian, Rggb),
    mosaic(b"BA10", LittleEndian, Grbg),
    mosaic(b"GB10", LittleEndian, Gbrg),
    mosaic(b"BG10", LittleEndian, Bggr),
    mosaic(b"pRAA", Packed10, Rggb),
    mosaic(b"pgAA", Packed10, Grbg),
    mosaic(b"pGAA", Packed10, Gbrg),
    mosaic(b"pBAA", Packed10, Bggr),
    plain(*b"GREY", Bytes),
    mosaic(b"RGGB", Bytes, Rggb),
    mosaic(b"GRBG", Bytes, Grbg),
    mosaic(b"GBRG", Bytes, Gbrg),
    mosaic(b"BA81", Bytes, Bggr),
    plain(*b"YUYV", Yuyv),
    plain(*b"MJPG", Jpeg),
    plain(*b"JPEG", Jpeg),
];

/// The format of a code; `None` for those that cannot be captured.
pub(super) fn find(fourcc: [u8; 4]) -> Option<PixelFormat> {
    KNOWN.iter().copied().find(|format| format.fourcc == fourcc)
}

/// The code of a name as `lightcast devices` and `v4l2-ctl` write it: up to four characters, followed by
/// `-BE` for samples with the most significant byte first. `None` for anything else.
pub(super) fn fourcc(name: &str) -> Option<[u8; 4]> {
    let (letters, is_big_endian) = name.strip_suffix("-BE").map_or((name, false), |letters| (letters, true));
    let letters = letters.trim_end_matches(' ').as_bytes();
    if !(1..=4).contains(&letters.len()) || !letters.iter().all(u8::is_ascii_graphic) {
        return None;
    }
    let mut fourcc = [b' '; 4];
    fourcc[..letters.len()].copy_from_slice(letters);
    if is_big_endian {
        fourcc[3] |= BIG_ENDIAN;
    }
    Some(fourcc)
}

/// The name of a code: the inverse of [`fourcc`].
pub(super) fn name(fourcc: [u8; 4]) -> String {
    let is_big_endian = fourcc[3] & BIG_ENDIAN != 0;
    let letters: String = fourcc
        .iter()
        .map(|&byte| char::from(byte & !BIG_ENDIAN))
        .map(|c| if c.is_ascii_graphic() { c } else { ' ' })
        .collect();
    format!("{}{}", letters.trim_end(), if is_big_endian { "-BE" } else { "" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_names_are_each_others_inverse_and_unique() {
        for (index, format) in KNOWN.iter().enumerate() {
            let name = name(format.fourcc);
            assert_eq!(fourcc(&name), Some(format.fourcc), "{name}");
            assert_eq!(find(format.fourcc), Some(*format));
            assert!(KNOWN[..index].iter().all(|other| other.fourcc != format.fourcc), "{name}");
        }
        assert_eq!(fourcc("Y16"), Some(*b"Y16 "));
        assert_eq!(fourcc("Y16-BE"), Some([b'Y', b'1', b'6', 0xa0]));
        for wrong in ["", "-BE", "YUYV2", "Y 6", "Y\u{e9}1"] {
            assert_eq!(fourcc(wrong), None, "{wrong}");
        }
    }
}
