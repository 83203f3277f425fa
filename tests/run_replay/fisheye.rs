use crate::recording::{lightcast, lists, stderr};
use lightcast::calibrate::Calibration;
use lightcast::files::write_png16;
use lightcast_core::camera::{Lens, LensParameters, Response, ResponseModel};
use lightcast_core::image::{Frame, Pixels};
use std::fs;
use std::process::Output;
use tempfile::TempDir;

const SIDE: usize = 64;

/// Ten frames of sensor codes through a lens that looks up: a lamp 30 degrees from the axis, towards +X.
fn fisheye(calibrated_side: usize, response: Response, camera_lines: &str) -> (TempDir, Output) {
    fisheye_from("", calibrated_side, response, camera_lines)
}

/// The same with additional configuration of the source.
fn fisheye_from(
    source_lines: &str,
    calibrated_side: usize,
    response: Response,
    camera_lines: &str,
) -> (TempDir, Output) {
    let folder = tempfile::tempdir().unwrap();
    let focal_px = 20.0;
    let lamp_column = (SIDE as f64 / 2.0 + focal_px * 30f64.to_radians()) as usize;
    for number in 0..10 {
        let mut codes = vec![100; SIDE * SIDE];
        codes[SIDE / 2 * SIDE + lamp_column] = 60_000;
        let frame = Frame {
            width: SIDE,
            height: SIDE,
            channels: 1,
            pixels: Pixels::Codes(codes),
            ..Frame::default()
        };
        write_png16(&folder.path().join(format!("eye.{number:02}.png")), &frame).unwrap();
    }
    let lens = Lens::new(LensParameters {
        width: calibrated_side,
        height: calibrated_side,
        fx: focal_px,
        fy: focal_px,
        cx: calibrated_side as f64 / 2.0,
        cy: calibrated_side as f64 / 2.0,
        k: [0.0; 4],
        field_of_view_rad: 3.1,
    })
    .unwrap();
    let calibration = Calibration { lens, response, notes: Vec::new() };
    fs::write(folder.path().join("lens.json"), calibration.to_json()).unwrap();
    let configuration = folder.path().join("run.toml");
    fs::write(
        &configuration,
        format!(
            "[source]\nkind = \"sequence\"\npath = \"eye.##.png\"\nframe_rate_hz = 25\npace = \"fast\"\n\
             {source_lines}\n[camera]\nprojection = \"fisheye\"\ncalibration = \"lens.json\"\n{camera_lines}\n[lights]\ncount = 16\n"
        ),
    )
    .unwrap();
    let output = lightcast().args(["run", "--config"]).arg(&configuration).output().unwrap();
    (folder, output)
}

fn linear() -> Response {
    Response::new(ResponseModel::Linear { black_level: 50, white_level: 50_000, gain: 1e-3 }).unwrap()
}

#[test]
fn sensor_codes_through_a_lens_become_lights_where_the_lamp_is() {
    let (_folder, output) = fisheye(SIDE, linear(), "");
    assert!(output.status.success(), "{}", stderr(&output));
    let found = lists(&output.stdout);
    assert_eq!(found.len(), 10);
    let lights = found[9]["lights"].as_array().unwrap();
    let brightest = lights
        .iter()
        .max_by(|a, b| a["irradiance"][1].as_f64().unwrap().total_cmp(&b["irradiance"][1].as_f64().unwrap()))
        .unwrap();
    let [x, y, z] = [0, 1, 2].map(|axis| brightest["direction"][axis].as_f64().unwrap());
    // Half a pixel is 1.4 degrees; the sky in the lamp's cell shifts the direction much less.
    let angle_deg = x.atan2(y).to_degrees();
    assert!((angle_deg - 30.0).abs() < 3.0 && z.abs() < 0.05, "{x} {y} {z}: {angle_deg} degrees");
    let summary = stderr(&output);
    assert!(summary.contains("10 pixels saturated"), "one pixel in each frame: {summary}");
}

#[test]
fn a_calibration_for_another_size_is_refused_before_the_first_frame() {
    let (_folder, output) = fisheye(32, linear(), "");
    let messages = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{messages}");
    for words in ["lens.json", "32 x 32", "64 x 64", "eye.##.png"] {
        assert!(messages.contains(words), "{words} is not in {messages}");
    }
}

#[test]
fn sensor_codes_without_a_response_are_refused_before_the_first_frame() {
    let (_folder, output) = fisheye(SIDE, Response::default(), "");
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("no response"), "{}", stderr(&output));
    assert!(stderr(&output).contains("the key `response` of [camera]"), "{}", stderr(&output));
}

#[test]
fn a_response_in_the_configuration_serves_a_calibration_without_one() {
    let (_first, in_calibration) = fisheye(SIDE, linear(), "");
    let line = "response = { model = \"linear\", black_level = 50, white_level = 50000, gain = 1e-3 }";
    let (_second, in_configuration) = fisheye(SIDE, Response::default(), line);
    assert!(in_configuration.status.success(), "{}", stderr(&in_configuration));
    assert_eq!(in_configuration.stdout, in_calibration.stdout);
}

#[test]
fn a_mosaic_keeps_its_colours_from_file_to_list() {
    // Row 32 and column 42 are even: the lamp is on a pixel with the colour of the first letter.
    for (bayer, lit) in [("RGGB", 0), ("GRBG", 1), ("BGGR", 2)] {
        let (_folder, output) = fisheye_from(&format!("bayer = \"{bayer}\""), SIDE, linear(), "");
        assert!(output.status.success(), "{}", stderr(&output));
        let found = lists(&output.stdout);
        assert_eq!(found.len(), 10);
        let power = [0, 1, 2].map(|channel| found[9]["power"][channel].as_f64().unwrap());
        let others = power.iter().enumerate().filter(|(channel, _)| *channel != lit).map(|(_, power)| *power);
        assert!(others.into_iter().all(|other| power[lit] > 1.5 * other), "{bayer}: {power:?}");
        let summary = stderr(&output);
        assert!(summary.contains("10 pixels saturated"), "one pixel in each frame: {summary}");
    }
    let swap = "rec709_from_sensor = [[0, 0, 1], [0, 1, 0], [1, 0, 0]]";
    let (_first, swapped) = fisheye_from("bayer = \"RGGB\"", SIDE, linear(), swap);
    let (_second, blue) = fisheye_from("bayer = \"BGGR\"", SIDE, linear(), "");
    assert!(swapped.status.success(), "{}", stderr(&swapped));
    assert_eq!(swapped.stdout, blue.stdout);
}

#[test]
fn colours_that_the_frames_cannot_have_are_refused_before_the_first_frame() {
    let white_balance = "rec709_from_sensor = [[2, 0, 0], [0, 1, 0], [0, 0, 1.5]]";
    let (_folder, output) = fisheye(SIDE, linear(), white_balance);
    let messages = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{messages}");
    for words in ["the key `rec709_from_sensor`", "without colours", "eye.##.png"] {
        assert!(messages.contains(words), "{words} is not in {messages}");
    }
}
