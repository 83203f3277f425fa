//! The exposure that a photograph's EXIF data record.

use super::codec::open_picture;
use crate::error::{Error, Result};
use exif::{In, Reader, Tag, Value};
use std::io::BufReader;
use std::path::Path;

/// Exposure settings of a photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposureSettings {
    /// Exposure time, finite and > 0. Cameras write nominal values: 13 s is most often 12.8 s, 1/2500 s
    /// 1/2560 s.
    pub time_s: f64,
    /// Sensitivity (ISO 12232), where the file records it.
    pub sensitivity_iso: Option<f64>,
    /// Focal length over aperture diameter, where the file records it.
    pub f_number: Option<f64>,
}

impl ExposureSettings {
    /// The exposure time in s that gives the same signal at the sensitivity and the f-number of `reference`;
    /// the signal is proportional to time times sensitivity over the square of the f-number. A setting that
    /// either file lacks is taken as equal in both.
    pub fn time_at(&self, reference: &Self) -> f64 {
        let ratio = |own: Option<f64>, other: Option<f64>| match (own, other) {
            (Some(own), Some(other)) => own / other,
            _ => 1.0,
        };
        self.time_s * ratio(self.sensitivity_iso, reference.sensitivity_iso)
            / ratio(self.f_number, reference.f_number).powi(2)
    }
}

/// Reads the exposure from the EXIF data of a JPEG, PNG or TIFF file; `None` where it has none or no exposure
/// time.
///
/// # Errors
/// Of kind [`BadFrame`](crate::error::Kind::BadFrame), naming the file, when it cannot be opened.
pub fn exposure_settings(path: &Path) -> Result<Option<ExposureSettings>> {
    let file =
        open_picture(path).map_err(|error| Error::bad_frame("cannot be opened").because(error).at(path))?;
    // Data that cannot be parsed count as missing: the picture itself can still be used.
    let Ok(data) = Reader::new().read_from_container(&mut BufReader::new(file)) else { return Ok(None) };
    let number = |tag: Tag| -> Option<f64> {
        let value = match &data.get_field(tag, In::PRIMARY)?.value {
            Value::Rational(values) => values.first()?.to_f64(),
            other => f64::from(other.get_uint(0)?),
        };
        (value.is_finite() && value > 0.0).then_some(value)
    };
    Ok(number(Tag::ExposureTime).map(|time_s| ExposureSettings {
        time_s,
        sensitivity_iso: number(Tag::PhotographicSensitivity),
        f_number: number(Tag::FNumber),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::test_data::real_folder;

    #[test]
    fn exposures_are_compared_at_one_sensitivity_and_aperture() {
        let one = ExposureSettings { time_s: 0.5, sensitivity_iso: Some(100.0), f_number: Some(4.0) };
        let two = ExposureSettings { time_s: 0.25, sensitivity_iso: Some(400.0), f_number: Some(8.0) };
        assert_eq!(two.time_at(&one), 0.25);
        assert_eq!(ExposureSettings { sensitivity_iso: None, ..two }.time_at(&one), 0.0625);
    }

    #[test]
    fn a_minimal_exif_block_is_read_and_other_files_have_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        // TIFF, little endian: one directory at 8 whose entry 0x8769 leads to the EXIF directory at 26, whose
        // entry 0x829a (ExposureTime, one rational) leads to 1/250 at 44.
        let mut bytes = b"II*\0\x08\0\0\0\x01\0\x69\x87\x04\0\x01\0\0\0\x1a\0\0\0\0\0\0\0".to_vec();
        bytes.extend(b"\x01\0\x9a\x82\x05\0\x01\0\0\0\x2c\0\0\0\0\0\0\0\x01\0\0\0\xfa\0\0\0");
        std::fs::write(&path, &bytes).unwrap();
        let expected = ExposureSettings { time_s: 0.004, sensitivity_iso: None, f_number: None };
        assert_eq!(exposure_settings(&path).unwrap(), Some(expected));
        // A time of 1/0 and a text count as missing.
        bytes[48] = 0;
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(exposure_settings(&path).unwrap(), None);
        std::fs::write(&path, b"hello").unwrap();
        assert_eq!(exposure_settings(&path).unwrap(), None);
        assert!(exposure_settings(&folder.path().join("b.jpg")).unwrap_err().to_string().contains("b.jpg"));
    }

    #[test]
    fn the_office_photographs_say_their_times() {
        let Some(folder) = real_folder("seq/office_fisheye_bracket") else { return };
        for (name, time_s) in [("IMG_6955.JPG", 13.0), ("IMG_6967.JPG", 0.003125), ("IMG_6970.JPG", 0.0004)] {
            let found = exposure_settings(&folder.join(name)).unwrap().unwrap();
            assert_eq!(found.time_s, time_s, "{name}");
            assert_eq!((found.sensitivity_iso, found.f_number), (Some(100.0), Some(5.6)));
        }
    }
}
