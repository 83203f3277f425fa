//! The Moon in a real all-sky video (THEMIS imager at Gillam, 10 March 2014) through the whole program,
//! compared with its ephemeris. `SOURCES.md` next to the recording gives the sources of both.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use flate2::read::GzDecoder;
use glam::{DMat3, DVec2, DVec3};
use lightcast::calibrate::{Calibration, Mark, fit_orientation};
use lightcast::files::write_png16;
use lightcast_core::camera::{LOOKING_UP, Lens, LensParameters, Response, ResponseModel};
use lightcast_core::image::{Frame, Pixels};
use lightcast_core::math::{angle_between, direction};
use std::fs;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const SIDE: usize = 256;
const FRAMES: usize = 40;

/// The recording's folder, or `None` after reporting that it is missing.
fn recording() -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data");
    let data = PathBuf::from(std::env::var_os("LIGHTCAST_DATA").unwrap_or_else(|| default.into()));
    let folder = data.join("seq/themis_gill_20140310");
    if folder.is_dir() {
        return Some(folder);
    }
    // Not eprintln!, which the test harness swallows when a test passes.
    let _ = writeln!(std::io::stderr(), "skipped: the Moon's video: no recording in {}", folder.display());
    None
}

/// Frames of a gzipped file of concatenated binary PGM pictures, each with comment lines in its header.
fn pgm_frames(path: &Path) -> Vec<Vec<u16>> {
    let mut bytes = Vec::new();
    GzDecoder::new(fs::File::open(path).unwrap()).read_to_end(&mut bytes).unwrap();
    let mut rest = bytes.as_slice();
    let mut frames = Vec::new();
    while !rest.is_empty() {
        let mut words = Vec::new();
        while words.len() < 4 {
            let end = rest.iter().position(|&byte| byte == b'\n').expect("a line of the header");
            let line = String::from_utf8_lossy(&rest[..end]);
            if !line.starts_with('#') {
                words.extend(line.split_whitespace().map(str::to_owned));
            }
            rest = &rest[end + 1..];
        }
        assert_eq!(words, ["P5", "256", "256", "65535"]);
        let (pixels, next) = rest.split_at(2 * SIDE * SIDE);
        frames.push(pixels.as_chunks().0.iter().map(|&pair| u16::from_be_bytes(pair)).collect());
        rest = next;
    }
    frames
}

/// The direction of the Moon in every frame. World: +X north, +Z east.
fn moon_directions(folder: &Path) -> Vec<DVec3> {
    let text = fs::read_to_string(folder.join("moon_truth.csv")).unwrap();
    let of_line = |line: &str| {
        let [_, azimuth, altitude, ..] = line.split(',').collect::<Vec<_>>()[..] else { panic!("{line}") };
        let [azimuth, altitude] =
            [azimuth, altitude].map(|degrees| degrees.parse::<f64>().unwrap().to_radians());
        direction(std::f64::consts::FRAC_PI_2 - altitude, azimuth)
    };
    text.lines().skip(1).map(of_line).collect()
}

/// Position of the Moon in a frame, half-pixel centres: the centroid of the 5 x 5 pixels around the brightest
/// one well inside the circle, after subtracting the median of the two rings around them. In the first frames
/// one pixel is saturated; the lost signal moves the centroid by less than 0.04 pixels, 0.03 degrees.
fn moon_pixel(codes: &[u16]) -> DVec2 {
    let at = |x: usize, y: usize| f64::from(codes[y * SIDE + x]);
    let inside = |x: usize, y: usize| (x as f64 - CENTRE_PX.x).hypot(y as f64 - CENTRE_PX.y) < 110.0;
    let pixels = (0..SIDE * SIDE).map(|index| (index % SIDE, index / SIDE)).filter(|&(x, y)| inside(x, y));
    let (x, y) = pixels.max_by(|a, b| at(a.0, a.1).total_cmp(&at(b.0, b.1))).unwrap();
    let window = (y - 4..=y + 4).flat_map(|row| (x - 4..=x + 4).map(move |column| (column, row)));
    let (core, mut ring): (Vec<_>, Vec<_>) =
        window.partition(|&(column, row)| column.abs_diff(x) <= 2 && row.abs_diff(y) <= 2);
    ring.sort_by(|a, b| at(a.0, a.1).total_cmp(&at(b.0, b.1)));
    let middle = ring[ring.len() / 2];
    let (mut sum, mut moment) = (0.0, DVec2::ZERO);
    for (column, row) in core {
        let above = (at(column, row) - at(middle.0, middle.1)).max(0.0);
        sum += above;
        moment += above * DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
    }
    moment / sum
}

/// From `SOURCES.md`: near-equidistant, an image circle of 246 pixels (the sky down to the horizon) centred
/// at (132, 131), counted from the centre of the first pixel; frames have a pedestal of 3300 codes.
const CENTRE_PX: DVec2 = DVec2::new(132.5, 131.5);
const CIRCLE_PX: f64 = 246.0;
const PEDESTAL: u16 = 3300;

fn calibration() -> Calibration {
    let focal_px = CIRCLE_PX / std::f64::consts::PI;
    let lens = Lens::new(LensParameters {
        width: SIDE,
        height: SIDE,
        fx: focal_px,
        fy: focal_px,
        cx: CENTRE_PX.x,
        cy: CENTRE_PX.y,
        k: [0.0; 4],
        field_of_view_rad: std::f64::consts::PI,
    })
    .unwrap();
    let response =
        Response::new(ResponseModel::Linear { black_level: PEDESTAL, white_level: u16::MAX, gain: 1e-4 })
            .unwrap();
    Calibration { lens, response, notes: Vec::new() }
}

fn rows(matrix: DMat3) -> String {
    let row = |i| matrix.row(i).to_array();
    format!("{:?}", [row(0), row(1), row(2)])
}

#[test]
fn the_moon_is_one_light_that_goes_the_moons_way() {
    let Some(recording) = recording() else { return };
    let moon = moon_directions(&recording);
    let frames: Vec<Vec<u16>> = ["0602", "0603"]
        .iter()
        .flat_map(|time| pgm_frames(&recording.join(format!("20140310_{time}_gill_themis19_full.pgm.gz"))))
        .collect();
    assert_eq!((frames.len(), moon.len()), (FRAMES, FRAMES));

    // The camera's orientation, from the first frame alone.
    let calibration = calibration();
    let mark = Mark { pixel: moon_pixel(&frames[0]), direction_world: moon[0] };
    let orientation = fit_orientation(&calibration.lens, &[mark], LOOKING_UP).unwrap();
    let axis = orientation.world_from_camera * DVec3::Z;
    println!(
        "the Moon at {:.2} in the first frame; the camera leans by {:.2} degrees",
        mark.pixel,
        angle_between(axis, DVec3::Y).to_degrees()
    );

    let folder = tempfile::tempdir().unwrap();
    for (number, codes) in frames.into_iter().enumerate() {
        let pixels = Pixels::Codes(codes);
        let frame = Frame { width: SIDE, height: SIDE, channels: 1, pixels, ..Frame::default() };
        write_png16(&folder.path().join(format!("sky.{number:02}.png")), &frame).unwrap();
    }
    fs::write(folder.path().join("camera.json"), calibration.to_json()).unwrap();
    let configuration = folder.path().join("run.toml");
    fs::write(
        &configuration,
        format!(
            "[source]\nkind = \"sequence\"\npath = \"sky.##.png\"\nframe_rate_hz = {}\npace = \"fast\"\n\
             [camera]\nprojection = \"fisheye\"\ncalibration = \"camera.json\"\nworld_from_camera = {}\n\
             [map]\ncolumns = 720\nrows = 180\n[lights]\ncount = 64\n",
            1.0 / 3.0,
            rows(orientation.world_from_camera)
        ),
    )
    .unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_lightcast"))
        .args(["run", "--config"])
        .arg(&configuration)
        .env_remove("RUST_LOG")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let text = String::from_utf8(output.stdout).unwrap();
    let lists: Vec<serde_json::Value> =
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lists.len(), FRAMES);
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    // The light that carries the Moon: the nearest one with power.
    let carriers: Vec<(u64, DVec3, f64)> = lists
        .iter()
        .zip(&moon)
        .map(|(list, &moon)| {
            // One frame every three seconds is too slow for the filter, which is then disabled and adds no
            // delay.
            assert_eq!(list["filter_delay_frames"], 0);
            let lights = list["lights"].as_array().unwrap().iter();
            lights
                .map(|light| {
                    let [x, y, z] = [0, 1, 2].map(|axis| number(&light["direction"][axis]));
                    let share = number(&light["irradiance"][1]) / number(&list["power"][1]);
                    (light["id"].as_u64().unwrap(), DVec3::new(x, y, z), share)
                })
                .filter(|&(_, _, share)| share > 0.0)
                .min_by(|a, b| angle_between(a.1, moon).total_cmp(&angle_between(b.1, moon)))
                .unwrap()
        })
        .collect();
    let (mut worst_deg, mut sum_deg, mut worst_drift_deg) = (0.0f64, 0.0, 0.0f64);
    for (frame, (&(id, found, _), &moon_now)) in carriers.iter().zip(&moon).enumerate() {
        let off_deg = angle_between(found, moon_now).to_degrees();
        let drift_off = (found - carriers[0].1) - (moon_now - moon[0]);
        let drift_off_deg = drift_off.length().to_degrees();
        assert_eq!(id, carriers[0].0, "frame {frame}: another light carries the Moon");
        assert!(off_deg < 0.3, "frame {frame}: {off_deg} degrees off");
        assert!(drift_off_deg < 0.1, "frame {frame}: the drift is {drift_off_deg} degrees off");
        (worst_deg, worst_drift_deg) = (worst_deg.max(off_deg), worst_drift_deg.max(drift_off_deg));
        sum_deg += off_deg;
    }
    println!(
        "light {}: at most {worst_deg:.3} degrees off, {:.3} on average; drift of {:.3} degrees at most \
         {worst_drift_deg:.3} off; {:.3} % of the light in the first frame, {:.3} % in the last",
        carriers[0].0,
        sum_deg / FRAMES as f64,
        angle_between(moon[0], moon[FRAMES - 1]).to_degrees(),
        100.0 * carriers[0].2,
        100.0 * carriers[FRAMES - 1].2
    );
}
