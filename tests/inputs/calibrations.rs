//! Calibration files of ROS and Kalibr, named in a configuration.

use super::{fault, said};
use std::fs;
use std::process::{Command, Output};

/// What `run` says of one frame of this size through the lens of a calibration file.
fn run(name: &str, [width, height]: [usize; 2], more: &str) -> Option<Output> {
    let calibration = fault(&format!("calib/{name}"))?;
    let folder = tempfile::tempdir().unwrap();
    let frame = lightcast_core::image::Frame {
        width,
        height,
        channels: 1,
        pixels: lightcast_core::image::Pixels::Radiance(vec![1.0; width * height]),
        ..Default::default()
    };
    lightcast::files::write_exr(&folder.path().join("a.0001.exr"), &frame, Some(25.0), false).unwrap();
    let configuration = folder.path().join("c.toml");
    fs::write(
        &configuration,
        format!(
            "[source]\nkind = \"sequence\"\npath = \"a.####.exr\"\n[camera]\nprojection = \"fisheye\"\ncalibration = {calibration:?}\n\
             {more}"
        ),
    )
    .unwrap();
    Some(Command::new(env!("CARGO_BIN_EXE_lightcast")).arg("run").arg(&configuration).output().unwrap())
}

#[test]
fn a_model_that_is_no_fisheye_is_refused_by_its_name() {
    for (name, size) in [("euroc_plumb_bob.yaml", [752, 480]), ("topic_plumb4.yaml", [640, 480])] {
        let Some(output) = run(name, size, "") else { return };
        assert_eq!(output.status.code(), Some(2), "{name}: {}", said(&output));
        assert!(said(&output).contains("distortion_model = plumb_bob"), "{}", said(&output));
    }
}

#[test]
fn ros_messages_of_a_fisheye_are_read() {
    for (name, size) in [("euroc_equidistant.yaml", [752, 480]), ("topic_equi.yaml", [640, 480])] {
        let Some(output) = run(name, size, "") else { return };
        assert!(output.status.success(), "{name}: {}", said(&output));
    }
}

#[test]
fn a_chain_whose_first_camera_is_refused_names_the_key_that_chooses_another() {
    let Some(output) = run("k_radtan_first.yaml", [640, 480], "") else { return };
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("kalibr_camera") && said(&output).contains("cam1"), "{}", said(&output));
    let output = run("k_radtan_first.yaml", [640, 480], "kalibr_camera = \"cam1\"\n").unwrap();
    assert!(output.status.success(), "{}", said(&output));
}
