//! The Huffman tables of JPEG pictures that carry none, as the frames of many USB cameras (MJPEG): such
//! pictures use those of the standard (ITU-T T.81, Annex K.3).

use std::borrow::Cow;

const FIRST_BYTES: [u8; 2] = [0xff, 0xd8];
const TABLES: u8 = 0xc4;
const SCAN: u8 = 0xda;

/// A table: class and number, how many codes there are of each length from 1 to 16, and what they stand for.
struct Table {
    class_and_number: u8,
    counts: [u8; 16],
    values: &'static [u8],
}

/// Of luminance and chrominance, DC and AC (tables K.3 to K.6).
const STANDARD: [Table; 4] = [
    Table {
        class_and_number: 0x00,
        counts: [0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0],
        values: &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11],
    },
    Table {
        class_and_number: 0x10,
        counts: [0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 0x7d],
        values: &AC_LUMINANCE,
    },
    Table {
        class_and_number: 0x01,
        counts: [0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0],
        values: &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11],
    },
    Table {
        class_and_number: 0x11,
        counts: [0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 0x77],
        values: &AC_CHROMINANCE,
    },
];

#[rustfmt::skip]
const AC_LUMINANCE: [u8; 162] = [
    0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61, 0x07,
    0x22, 0x71, 0x14, 0x32, 0x81, 0x91, 0xa1, 0x08, 0x23, 0x42, 0xb1, 0xc1, 0x15, 0x52, 0xd1, 0xf0,
    0x24, 0x33, 0x62, 0x72, 0x82, 0x09, 0x0a, 0x16, 0x17, 0x18, 0x19, 0x1a, 0x25, 0x26, 0x27, 0x28,
    0x29, 0x2a, 0x34, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49,
    0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69,
    0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89,
    0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7,
    0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5,
    0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe1, 0xe2,
    0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf1, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8,
    0xf9, 0xfa,
];

#[rustfmt::skip]
const AC_CHROMINANCE: [u8; 162] = [
    0x00, 0x01, 0x02, 0x03, 0x11, 0x04, 0x05, 0x21, 0x31, 0x06, 0x12, 0x41, 0x51, 0x07, 0x61, 0x71,
    0x13, 0x22, 0x32, 0x81, 0x08, 0x14, 0x42, 0x91, 0xa1, 0xb1, 0xc1, 0x09, 0x23, 0x33, 0x52, 0xf0,
    0x15, 0x62, 0x72, 0xd1, 0x0a, 0x16, 0x24, 0x34, 0xe1, 0x25, 0xf1, 0x17, 0x18, 0x19, 0x1a, 0x26,
    0x27, 0x28, 0x29, 0x2a, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48,
    0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59, 0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68,
    0x69, 0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87,
    0x88, 0x89, 0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5,
    0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6, 0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3,
    0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda,
    0xe2, 0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8,
    0xf9, 0xfa,
];

/// A JPEG picture with tables: those of the standard where it has none before its first scan. Anything else
/// is left as it is.
pub(super) fn with_tables(bytes: &[u8]) -> Cow<'_, [u8]> {
    match scan_without_tables(bytes) {
        Some(at) => [&bytes[..at], &standard(), &bytes[at..]].concat().into(),
        None => bytes.into(),
    }
}

/// Where the first scan begins, if no table stands before it.
fn scan_without_tables(bytes: &[u8]) -> Option<usize> {
    let mut at = FIRST_BYTES.len();
    if !bytes.starts_with(&FIRST_BYTES) {
        return None;
    }
    loop {
        let (&first, &marker) = (bytes.get(at)?, bytes.get(at + 1)?);
        match marker {
            _ if first != 0xff => return None,
            // A marker may have any number of these before it.
            0xff => at += 1,
            TABLES => return None,
            SCAN => return Some(at),
            // Markers without contents.
            0x01 | 0xd0..=0xd8 => at += 2,
            _ => {
                let length = u16::from_be_bytes([*bytes.get(at + 2)?, *bytes.get(at + 3)?]);
                at += 2 + usize::from(length);
            }
        }
    }
}

/// The segment with the tables of the standard.
fn standard() -> Vec<u8> {
    let tables: Vec<u8> = STANDARD
        .iter()
        .flat_map(|table| [&[table.class_and_number][..], &table.counts, table.values].concat())
        .collect();
    let length = (tables.len() + 2) as u16;
    [&[0xff, TABLES][..], &length.to_be_bytes(), &tables].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::image::ExtendedColorType;
    use ::image::codecs::jpeg::JpegEncoder;

    /// Segments before the first scan: marker, and contents; and the rest.
    fn segments(bytes: &[u8]) -> (Vec<(u8, Vec<u8>)>, Vec<u8>) {
        let (mut at, mut segments) = (2, Vec::new());
        while bytes[at + 1] != SCAN {
            let length = usize::from(u16::from_be_bytes([bytes[at + 2], bytes[at + 3]]));
            segments.push((bytes[at + 1], bytes[at + 4..at + 2 + length].to_vec()));
            at += 2 + length;
        }
        (segments, bytes[at..].to_vec())
    }

    fn encoded() -> Vec<u8> {
        let samples: Vec<u8> =
            (0..48 * 32 * 3_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, 90)
            .encode(&samples, 48, 32, ExtendedColorType::Rgb8)
            .unwrap();
        bytes
    }

    /// As cameras' drivers make it: the same picture without its tables.
    fn without_tables(bytes: &[u8]) -> Vec<u8> {
        let (segments, rest) = segments(bytes);
        let mut left = FIRST_BYTES.to_vec();
        for (marker, contents) in segments.into_iter().filter(|(marker, _)| *marker != TABLES) {
            left.extend([0xff, marker]);
            left.extend((contents.len() as u16 + 2).to_be_bytes());
            left.extend(contents);
        }
        [left, rest].concat()
    }

    #[test]
    fn the_tables_are_those_that_an_encoder_with_the_standards_writes() {
        let (all, _) = segments(&encoded());
        let mut written: Vec<u8> = all
            .into_iter()
            .filter(|(marker, _)| *marker == TABLES)
            .flat_map(|(_, contents)| contents)
            .collect();
        let mut ours = standard()[4..].to_vec();
        assert_eq!(written.len(), ours.len());
        written.sort_unstable();
        ours.sort_unstable();
        assert_eq!(written, ours);
    }

    #[test]
    fn a_picture_without_tables_gets_them_and_any_other_stays_as_it_is() {
        let whole = encoded();
        assert_eq!(with_tables(&whole), whole);
        let bare = without_tables(&whole);
        assert!(bare.len() + 400 < whole.len());
        let filled = with_tables(&bare);
        let pixels =
            |bytes: &[u8]| ::image::load_from_memory(bytes).map(|picture| picture.into_rgb8().into_raw());
        assert!(pixels(&bare).is_err());
        assert_eq!(pixels(&filled).unwrap(), pixels(&whole).unwrap());
        for cut in 0..bare.len().min(700) {
            with_tables(&bare[..cut]);
        }
        assert_eq!(with_tables(b"no picture"), &b"no picture"[..]);
    }
}
