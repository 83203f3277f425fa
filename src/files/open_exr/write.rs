use super::attribute;
use crate::error::{Error, Result};
use crate::files::codec::check_samples;
use crate::files::replace::replace_file;
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes,
    LineOrder, SmallVec, Vec2, WritableImage, f16,
};
use lightcast_core::image::{Frame, Pixels, PolarMap};
use std::io::{Cursor, Seek, Write};
use std::path::Path;

/// Writes radiance as an OpenEXR file, channels `R`, `G`, `B` (and `A`) or `Y`, ZIP-compressed (lossless)
/// scan lines.
///
/// `half` halves the size, with 11 bits of precision; values from 65520 up become infinite. The frame rate is
/// stored as `framesPerSecond`. The same frame always produces the same bytes.
///
/// # Errors
///
/// A frame of sensor codes (for which there is [`write_png16`](crate::files::write_png16)) or of the wrong
/// length, a frame rate that is not a positive number, a file that cannot be written.
pub fn write_exr(path: &Path, frame: &Frame, frame_rate_hz: Option<f64>, half: bool) -> Result<()> {
    let Pixels::Radiance(_) = &frame.pixels else {
        return Err(Error::failed("holds sensor codes, which are written as 16-bit PNG").at(path));
    };
    let attributes = || {
        Ok(LayerAttributes {
            frames_per_second: frame_rate_hz.map(rational).transpose()?,
            ..LayerAttributes::default()
        })
    };
    write(path, frame, attributes, Compression::ZIP16, half)
}

/// A polar map as an OpenEXR file in memory: columns are azimuth, rows are polar angle, with three float
/// channels.
///
/// # Errors
/// A map of the wrong length.
pub fn encode_map_exr(map: &PolarMap) -> Result<Vec<u8>> {
    let frame = Frame {
        width: map.shape.columns(),
        height: map.shape.rows(),
        channels: 3,
        pixels: Pixels::Radiance(map.pixels.as_flattened().to_vec()),
        ..Frame::default()
    };
    encode_exr(&frame, false)
}

/// A frame as [`write_exr`] writes it without a rate, in memory; sensor codes become `uint` channels.
///
/// # Errors
/// A frame of the wrong length.
pub fn encode_exr(frame: &Frame, half: bool) -> Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    encode(&mut bytes, frame, || Ok(LayerAttributes::default()), Compression::ZIP16, half)?;
    Ok(bytes.into_inner())
}

/// Writes a frame of a live recording: sensor codes as `uint` channels (lossless), radiance as floats or,
/// `half`, as half floats; uncompressed, so that a recording keeps up with the camera. The attributes
/// `framesPerSecond`, `expTime` (seconds) and our own record the rate, the exposure, the capture time, the
/// sensor's mosaic and, as text, the lens.
///
/// # Errors
///
/// As [`write_exr`], except that codes are accepted. The error of a full disk has the system's error as its
/// source.
pub fn write_recorded_exr(
    path: &Path,
    frame: &Frame,
    half: bool,
    exposure_s: Option<f64>,
    lens: Option<&str>,
) -> Result<()> {
    let attributes = || {
        let rate_hz = frame.stamp.frame_rate_hz;
        let mut attributes = LayerAttributes {
            // This is for other programs; our own attribute has the rate without rounding, and rates that
            // this one cannot hold.
            frames_per_second: rational(rate_hz).ok(),
            exposure: exposure_s.map(|seconds| seconds as f32),
            ..LayerAttributes::default()
        };
        attribute::add(&mut attributes, frame, lens)?;
        Ok(attributes)
    };
    write(path, frame, attributes, Compression::Uncompressed, half)
}

fn write(
    path: &Path,
    frame: &Frame,
    attributes: impl FnOnce() -> Result<LayerAttributes>,
    compression: Compression,
    half: bool,
) -> Result<()> {
    replace_file(path, |writer| encode(writer, frame, attributes, compression, half))
}

fn encode(
    writer: impl Write + Seek,
    frame: &Frame,
    attributes: impl FnOnce() -> Result<LayerAttributes>,
    compression: Compression,
    half: bool,
) -> Result<()> {
    let count = match &frame.pixels {
        Pixels::Codes(codes) => codes.len(),
        Pixels::Radiance(values) => values.len(),
    };
    check_samples(frame.width, frame.height, frame.channels, count)?;
    let names: &[&str] = match frame.channels {
        1 => &["Y"],
        4 => &["R", "G", "B", "A"],
        _ => &["R", "G", "B"],
    };
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = names
        .iter()
        .enumerate()
        .map(|(place, &name)| AnyChannel::new(name, samples(frame, place, half)))
        .collect();
    let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let size = Vec2(frame.width, frame.height);
    let layer = Layer::new(size, attributes()?, encoding, AnyChannels::sort(channels));
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(writer)
        .map_err(|error| Error::failed("cannot be written").because(error))
}

/// The samples of one channel.
fn samples(frame: &Frame, place: usize, half: bool) -> FlatSamples {
    match &frame.pixels {
        Pixels::Codes(codes) => FlatSamples::U32(
            codes.iter().skip(place).step_by(frame.channels).map(|&code| code.into()).collect(),
        ),
        Pixels::Radiance(values) => {
            let values = values.iter().skip(place).step_by(frame.channels);
            if half {
                FlatSamples::F16(values.map(|&value| f16::from_f32(value)).collect())
            } else {
                FlatSamples::F32(values.copied().collect())
            }
        }
    }
}

/// A rate as OpenEXR stores it: a whole number, an NTSC rate (such as 24000/1001), or millionths.
fn rational(rate_hz: f64) -> Result<(i32, u32)> {
    // 23.976 and 29.97 are common notations for 24000/1001 and 30000/1001, accurate to 1e-6.
    for (divisor, tolerance) in [(1_u32, 1e-12), (1001, 2e-6), (1_000_000, f64::INFINITY)] {
        let count = (rate_hz * f64::from(divisor)).round();
        let deviation = (count / f64::from(divisor) / rate_hz - 1.0).abs();
        if (1.0..=f64::from(i32::MAX)).contains(&count) && deviation <= tolerance {
            let ntsc = divisor == 1001;
            if !ntsc || count % 1000.0 == 0.0 {
                return Ok((count as i32, divisor));
            }
        }
    }
    Err(Error::failed(format!(
        "cannot be written: a frame rate of {rate_hz} Hz is not between 1e-6 and 2147 Hz"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;
    use crate::files::{Attributes, read};
    use lightcast_core::image::{Bayer, Stamp};

    fn ramp(width: usize, height: usize, channels: usize) -> Frame {
        let values = (0..width * height * channels).map(|n| n as f32 * 0.25 - 1.0).collect();
        Frame { width, height, channels, pixels: Pixels::Radiance(values), ..Frame::default() }
    }

    #[test]
    fn rgb_and_luminance_come_back_with_their_rate() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let mut read_back = Frame::default();
        // 37 rows: the last block of 16 scan lines is incomplete. Multiples of 1/4 below 512 are exact in
        // half precision.
        for (channels, half) in [(1, true), (3, true), (1, false), (3, false)] {
            let frame = ramp(13, 37, channels);
            write_exr(&path, &frame, Some(25.0), half).unwrap();
            let attributes = read(&path, &mut read_back).unwrap();
            assert_eq!(read_back, frame);
            let expected = Attributes { frame_rate_hz: Some(25.0), ..Attributes::default() };
            assert_eq!(attributes, expected);
        }
        write_exr(&path, &ramp(1, 1, 1), None, false).unwrap();
        assert_eq!(read(&path, &mut read_back).unwrap().frame_rate_hz, None);
        assert_eq!((read_back.width, read_back.height), (1, 1));
    }

    #[test]
    fn nan_and_negative_samples_are_delivered_and_infinite_ones_have_the_largest_value() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let values = vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -2.5, 65504.0, 1e6];
        let frame =
            Frame { width: 2, height: 1, channels: 3, pixels: Pixels::Radiance(values), ..Frame::default() };
        for half in [false, true] {
            write_exr(&path, &frame, None, half).unwrap();
            let mut read_back = Frame::default();
            let overflowed = read(&path, &mut read_back).unwrap().overflowed;
            let Pixels::Radiance(values) = read_back.pixels else { panic!("codes") };
            assert!(values[0].is_nan());
            let (most, count) = if half { (65504.0, 2) } else { (1e6, 1) };
            assert_eq!(values[1..], [most, f32::NEG_INFINITY, -2.5, 65504.0, most]);
            assert_eq!(overflowed, count);
        }
    }

    #[test]
    fn same_frame_gives_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let [one, two] = ["1.exr", "2.exr"].map(|name| folder.path().join(name));
        write_exr(&one, &ramp(64, 40, 3), Some(23.976), true).unwrap();
        write_exr(&two, &ramp(64, 40, 3), Some(23.976), true).unwrap();
        assert_eq!(std::fs::read(one).unwrap(), std::fs::read(two).unwrap());
    }

    #[test]
    fn recorded_codes_come_back_with_all_that_was_said_of_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let stamp =
            Stamp { capture_time_ns: -12_345_678_901_234_567, frame_rate_hz: 59.94, ..Stamp::default() };
        for (channels, bayer) in [(1, None), (1, Some(Bayer::Gbrg)), (3, None)] {
            let codes = (0..16 * 40 * channels).map(|n| (n * 7919 % 65_536) as u16).collect();
            let frame = Frame {
                stamp,
                width: 16,
                height: 40,
                channels,
                bayer,
                pixels: Pixels::Codes(codes),
                ..Frame::default()
            };
            write_recorded_exr(&path, &frame, true, Some(0.01), Some("{\"fx\": 1}")).unwrap();
            let mut read_back = Frame { stamp, ..Frame::default() };
            let attributes = read(&path, &mut read_back).unwrap();
            assert_eq!(read_back, frame);
            assert_eq!(attributes.capture_time_ns, Some(stamp.capture_time_ns));
            assert_eq!(attributes.frame_rate_hz, Some(59.94), "not 60000/1001");
        }
        let meta = exr::meta::MetaData::read_from_file(&path, false).unwrap();
        assert_eq!(meta.headers[0].own_attributes.exposure, Some(0.01));
        assert_eq!(meta.headers[0].own_attributes.other.len(), 4, "samples, time, rate and lens");
    }

    #[test]
    fn codes_beyond_16_bits_and_codes_in_floats_are_no_codes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let write = |samples: FlatSamples, bayer: &str| {
            let mut attributes = LayerAttributes::default();
            for (name, value) in [("lightcastSamples", "codes"), ("lightcastBayer", bayer)] {
                let value = exr::meta::attribute::AttributeValue::Text(value.into());
                attributes.other.insert(name.into(), value);
            }
            let channels = AnyChannels::sort(SmallVec::from_vec(vec![AnyChannel::new("Y", samples)]));
            let layer = Layer::new(Vec2(2, 1), attributes, Encoding::UNCOMPRESSED, channels);
            Image::from_layer(layer).write().non_parallel().to_file(&path).unwrap();
            read(&path, &mut Frame::default()).unwrap_err().to_string()
        };
        assert!(write(FlatSamples::U32(vec![1, 65_536]), "RGGB").contains("the sensor code 65536"));
        assert!(write(FlatSamples::F32(vec![1.0, 2.0]), "RGGB").contains("not of type uint"));
        assert!(write(FlatSamples::U32(vec![1, 2]), "RGBW").contains("lightcastBayer = RGBW"));
    }

    #[test]
    fn rates_become_the_usual_rationals() {
        for (rate, expected) in [
            (25.0, (25, 1)),
            (1000.0, (1000, 1)),
            (23.976, (24000, 1001)),
            (29.97, (30000, 1001)),
            (60_000.0 / 1001.0, (60000, 1001)),
            (12.5, (12_500_000, 1_000_000)),
            (1.0 / 3.0, (333_333, 1_000_000)),
        ] {
            assert_eq!(rational(rate).unwrap(), expected);
        }
        for rate in [0.0, -25.0, f64::NAN, f64::INFINITY, 1e-9] {
            assert!(rational(rate).is_err(), "{rate}");
        }
    }

    #[test]
    fn codes_and_wrong_lengths_are_refused_without_leaving_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let codes =
            Frame { width: 1, height: 1, channels: 1, pixels: Pixels::Codes(vec![1]), ..Frame::default() };
        let short = Frame { width: 9, ..ramp(2, 2, 3) };
        for frame in [codes, short] {
            assert_eq!(write_exr(&path, &frame, None, false).unwrap_err().kind(), Kind::Failed);
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
