//! Real picture files compared with the figures published with them (in the `SOURCES.md` of each folder).

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use lightcast::files::{Attributes, decode, read};
use lightcast::source::{FrameSource, Next, Sequence, SequenceOptions};
use lightcast_core::image::{Frame, LatLongCentres, Pixels, luminance};
use std::f64::consts::PI;
use std::fs;
use std::io::Write as _;
use std::path::PathBuf;

/// The folder with real data, or `None` after reporting that it is missing.
fn data(test: &str) -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data");
    let folder = PathBuf::from(std::env::var_os("LIGHTCAST_DATA").unwrap_or_else(|| default.into()));
    if folder.join("env").is_dir() {
        return Some(folder);
    }
    // Not eprintln!, which the test harness swallows when a test passes; written in one piece, because tests
    // run in parallel.
    let line = format!("skipped: {test}: no real maps in {}\n", folder.display());
    let _ = std::io::stderr().write_all(line.as_bytes());
    None
}

fn rgb(frame: &Frame) -> &[[f32; 3]] {
    let Pixels::Radiance(values) = &frame.pixels else { panic!("codes") };
    assert_eq!((frame.channels, values.len()), (3, frame.width * frame.height * 3));
    values.as_chunks().0
}

/// Product of the two EXPOSURE lines of `ward_fisheye180_test.hdr`.
const WARD_EXPOSURE: f64 = 2.720623e-2 * 4.676974e1;

/// The figures of a map in `SOURCES.md`; luminance of the values as stored, with the mean weighted by solid
/// angle.
struct Described {
    name: String,
    is_lat_long: bool,
    width: usize,
    height: usize,
    max: f64,
    mean: f64,
}

/// Every map that `SOURCES.md` describes.
fn described(sources: &str) -> Vec<Described> {
    let mut maps = Vec::new();
    for section in sources.split("\n## ").skip(1) {
        let Some((_, projection)) = section.split_once("projection: ") else { continue };
        let line = section.lines().find(|line| line.contains("luminance max")).expect("a line of figures");
        let number = |key: &str| -> f64 {
            let rest = line.split_once(key).expect("the key").1;
            rest.split([',', ';']).next().unwrap().trim().parse().expect("a number")
        };
        let (width, height) = line[2..].split_once(';').unwrap().0.split_once('x').unwrap();
        maps.push(Described {
            name: section.split_whitespace().next().expect("a heading").to_owned(),
            is_lat_long: projection.starts_with("latlong"),
            width: width.parse().unwrap(),
            height: height.parse().unwrap(),
            max: number("luminance max "),
            mean: number("mean "),
        });
    }
    maps
}

/// Takes the primaries out of a Radiance header; returns whether it has any.
fn rename_primaries(bytes: &mut [u8]) -> bool {
    let key = b"\nPRIMARIES=";
    let head = bytes.len().min(1000);
    let at = bytes[..head].windows(key.len()).position(|window| window == key);
    at.map(|at| bytes[at + 1] = b'X').is_some()
}

#[test]
fn every_map_has_the_size_the_peak_and_the_mean_luminance_of_its_description() {
    let Some(folder) = data("maps against their description") else { return };
    let sources = fs::read_to_string(folder.join("env/SOURCES.md")).unwrap();
    let maps = described(&sources);
    let mut frame = Frame::default();
    let mut compared = 0;
    for Described { name, is_lat_long, width, height, max, mean } in &maps {
        let mut bytes = fs::read(folder.join("env").join(name)).unwrap();
        // The description is of the values as stored.
        rename_primaries(&mut bytes);
        let attributes = decode(&bytes, &mut frame).unwrap();
        assert_eq!((frame.width, frame.height), (*width, *height), "{name}");
        let (mut sum, mut weights, mut peak) = (0.0, 0.0, 0.0_f64);
        for (index, &pixel) in rgb(&frame).iter().enumerate() {
            let (row, column) = (index / frame.width, index % frame.width);
            // The weights used in `SOURCES.md`: sine of the polar angle, and sin(theta) / theta for the
            // angular map, whose circle touches the edges.
            let weight = if *is_lat_long {
                (PI * (row as f64 + 0.5) / frame.height as f64).sin()
            } else {
                let x = 2.0 * (column as f64 + 0.5) / frame.width as f64 - 1.0;
                let y = 2.0 * (row as f64 + 0.5) / frame.height as f64 - 1.0;
                let theta = x.hypot(y) * PI / 2.0;
                if theta > PI / 2.0 { continue } else { theta.sin() / theta }
            };
            sum += weight * f64::from(luminance(pixel));
            weights += weight;
            peak = peak.max(f64::from(luminance(pixel)));
        }
        let measured = sum / weights;
        println!("{name}: max {peak:.6} ({max}), mean {measured:.6} ({mean}), {attributes:?}");
        // The figures are of stored values, with five digits.
        let exposure = if name.starts_with("ward") { WARD_EXPOSURE } else { 1.0 };
        let (max, mean) = (max / exposure, mean / exposure);
        compared += 1;
        assert!((measured / mean - 1.0).abs() < 1e-4, "{name}: mean {measured}, described as {mean}");
        assert!((peak / max - 1.0).abs() < 1e-4, "{name}: max {peak}, described as {max}");
    }
    assert_eq!(maps.iter().filter(|map| map.name.ends_with("_1k.hdr")).count(), 13);
    assert_eq!(compared, maps.len());
}

#[test]
fn all_pictures_of_the_folder_are_read() {
    let Some(folder) = data("all pictures") else { return };
    let mut frame = Frame::default();
    let mut count = 0;
    for entry in fs::read_dir(folder.join("env")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "hdr" || extension == "exr") {
            read(&path, &mut frame).unwrap();
            assert!(rgb(&frame).iter().flatten().all(|value| value.is_finite()), "{}", path.display());
            count += 1;
        }
    }
    assert!(count >= 18, "{count}");
}

#[test]
fn tiled_mip_mapped_lat_longs_with_the_attribute_have_their_centres_on_the_poles() {
    let Some(folder) = data("envmap attribute") else { return };
    let mut frame = Frame::default();
    for name in
        ["KernerEnvLatLong.exr", "StageEnvLatLong.exr", "OrientationLatLong.exr", "WavyLinesLatLong.exr"]
    {
        let attributes = read(&folder.join("env").join(name), &mut frame).unwrap();
        assert_eq!(attributes.latlong_centres, LatLongCentres::Ends, "{name}");
        // In that case the first and the last row are one point each, and the first and the last column are
        // the same meridian; a chart drawn in this way is constant along the pole.
        if name.starts_with("Wavy") {
            let row = &rgb(&frame)[..frame.width];
            assert!(row.iter().all(|pixel| (luminance(*pixel) - luminance(row[0])).abs() < 0.01));
        }
    }
    let half = read(&folder.join("env/dancing_hall_1k.hdr"), &mut frame).unwrap();
    assert_eq!(half, Attributes::default());
}

#[test]
fn both_exposure_lines_of_the_fisheye_divide() {
    let Some(folder) = data("two EXPOSURE lines") else { return };
    let mut bytes = fs::read(folder.join("env/ward_fisheye180_test.hdr")).unwrap();
    // Their conversion would round once more.
    assert!(rename_primaries(&mut bytes));
    let mut frame = Frame::default();
    decode(&bytes, &mut frame).unwrap();
    let divided = rgb(&frame).to_vec();
    // With its EXPOSURE lines renamed, the same file yields the pixels as stored.
    let mut lines = 0;
    for at in 0..1000 {
        if bytes[at..].starts_with(b"\nEXPOSURE=") {
            bytes[at + 1] = b'X';
            lines += 1;
        }
    }
    assert_eq!(lines, 2);
    decode(&bytes, &mut frame).unwrap();
    for (stored, divided) in rgb(&frame).as_flattened().iter().zip(divided.as_flattened()) {
        let expected = f64::from(*stored) / WARD_EXPOSURE;
        assert!((f64::from(*divided) - expected).abs() <= 1e-7 * expected, "{divided} for {expected}");
    }
}

#[test]
fn probe_sweep_plays_as_a_sequence() {
    let Some(folder) = data("probe sweep") else { return };
    let options = SequenceOptions {
        path: folder.join("probes/scene_a/sweep_###.exr"),
        frame_rate_hz: Some(25.0),
        last: Some(9),
        ..SequenceOptions::default()
    };
    let mut sequence = Sequence::open(&options).unwrap();
    let format = sequence.format();
    assert_eq!((format.width, format.height % 32, format.channels), (64, 0, 3));
    let mut frame = Frame::default();
    for number in 0..10 {
        assert_eq!(sequence.next(&mut frame).unwrap(), Next::Frame);
        assert_eq!((frame.stamp.sequence, frame.stamp.lost_before), (number, 0));
        assert_eq!(frame.stamp.capture_time_ns, number as i64 * 40_000_000);
        assert!(rgb(&frame).iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
    }
    assert_eq!(sequence.next(&mut frame).unwrap(), Next::End);
    // The last file of the sweep is smaller: a frame of another size.
    let all = SequenceOptions { last: None, ..options };
    let mut sequence = Sequence::open(&all).unwrap();
    assert_eq!(sequence.file_count(), 11);
    let errors: Vec<String> =
        (0..11).filter_map(|_| sequence.next(&mut frame).err().map(|error| error.to_string())).collect();
    assert_eq!(errors.len(), 1);
    assert!(errors[0].contains("sweep_010.exr: is 64 x "), "{}", errors[0]);
}

#[test]
fn camera_codes_of_16_bits_are_read_as_they_stand() {
    let Some(folder) = data("16-bit camera pictures") else { return };
    let mut frame = Frame::default();
    for name in ["cam0.png", "cam1.png", "tum_vi_with_chart.png"] {
        read(&folder.join("calib/tum_vi").join(name), &mut frame).unwrap();
        assert_eq!((frame.width, frame.height, frame.channels), (512, 512, 1));
        let Pixels::Codes(codes) = &frame.pixels else { panic!("radiance") };
        let max = codes.iter().max().unwrap();
        let mean = codes.iter().map(|&code| u64::from(code)).sum::<u64>() / codes.len() as u64;
        println!("{name}: mean code {mean}, largest {max}");
        assert!(*max > 255, "{name}: 8 bits only");
    }
}
