use super::*;
use crate::files::{write_png8, write_png16};
use clap::Parser;
use lightcast_core::camera::ResponseModel;
use lightcast_core::image::Pixels;

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    arguments: Arguments,
}

fn run_line(folder: &Path, line: &str) -> Result<()> {
    let here = |word: &str| match word.strip_prefix('@') {
        Some(name) => folder.join(name).into_os_string(),
        None => word.into(),
    };
    let words = std::iter::once("calibrate".into()).chain(line.split_whitespace().map(here));
    run(&Line::parse_from(words).arguments)
}

/// Five patches of 4 x 4 px side by side, code = 500 + 60 ln L, one code of noise.
fn chart(folder: &Path) {
    let luminances = [0.01, 0.3, 5.0, 80.0, 1000.0f64];
    let codes = (0..20 * 4)
        .map(|at| (500.0 + 60.0 * luminances[at % 20 / 4].ln()).round() as u16 + (at * 7 % 3) as u16 - 1)
        .collect();
    let frame = Frame { width: 20, height: 4, pixels: Pixels::Codes(codes), ..Frame::default() };
    write_png16(&folder.join("chart_1.png"), &frame).unwrap();
    write_png16(&folder.join("chart_2.png"), &frame).unwrap();
    let patches: String = luminances
        .iter()
        .enumerate()
        .map(|(n, l)| {
            let x = 4 * n;
            format!("[[patch]]\nrectangle = [{x}, 0, 4, 4]\nluminance_cd_m2 = {l}\nheld_out = {}\n", n == 2)
        })
        .collect();
    std::fs::write(folder.join("chart.toml"), patches).unwrap();
}

#[test]
fn a_chart_becomes_the_response_of_a_calibration_whose_lens_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    chart(folder.path());
    let lens = r#"{"version": 1, "lens": {"model": "kannala-brandt", "width": 20, "height": 4, "fx": 5.0, "fy": 5.0,
        "cx": 10.0, "cy": 2.0, "k": [0.0, 0.0, 0.0, 0.0], "field_of_view_deg": 90.0}}"#;
    std::fs::write(folder.path().join("lens.json"), lens).unwrap();
    let line =
        "@chart_#.png --patches @chart.toml --calibration @lens.json --output @lens.json --plot @a.svg";
    run_line(folder.path(), line).unwrap();
    let found = Calibration::load(&folder.path().join("lens.json"), None).unwrap();
    assert_eq!(found.lens.parameters().width, 20);
    let ResponseModel::Logarithmic { a, b, saturation_code, .. } = *found.response.model() else { panic!() };
    assert!((a - 500.0).abs() < 0.5 && (b / 60.0 - 1.0).abs() < 0.002 && saturation_code == 1023, "{a} {b}");
    let svg = std::fs::read_to_string(folder.path().join("a.svg")).unwrap();
    assert!(svg.contains("Response: logarithmic") && svg.contains("held out"));
}

#[test]
fn faults_of_a_patch_file_are_named_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    chart(folder.path());
    let good = std::fs::read_to_string(folder.path().join("chart.toml")).unwrap();
    for (from, to, parts) in [
        ("[4, 0, 4, 4]", "[4, 0, 4, 5]", ["line 6", "within the picture of 20 x 4 px"]),
        ("held_out = true", "held = true", ["line 12", "unknown field `held`"]),
        ("held_out = true", "picture = \"b.png\"", ["line 12", "0 of the pictures"]),
    ] {
        std::fs::write(folder.path().join("chart.toml"), good.replace(from, to)).unwrap();
        let error = run_line(folder.path(), "@chart_1.png --patches @chart.toml").unwrap_err();
        assert_eq!(error.kind(), Kind::Usage);
        assert!(parts.iter().all(|part| error.to_string().contains(part)), "{error}");
    }
    std::fs::write(folder.path().join("chart.toml"), good).unwrap();
    let two = run_line(folder.path(), "@chart_1.png @chart_2.png --patches @chart.toml").unwrap_err();
    assert!(two.to_string().contains("say in which of the pictures"), "{two}");
}

/// Three exposures of a grey ramp by a camera of gamma 2.2, and their times.
fn bracket(folder: &Path) {
    for (number, time) in [1.0, 0.25, 0.0625f64].iter().enumerate() {
        let rgb: Vec<u8> = (0..128 * 128)
            .flat_map(|at| {
                let exposure = 2.0 * time * (f64::from(at % 128) + 0.5) / 128.0;
                [(255.0 * exposure.min(1.0).powf(1.0 / 2.2)).round() as u8; 3]
            })
            .collect();
        write_png8(&folder.join(format!("shot_{number}.png")), 128, 128, &rgb).unwrap();
    }
    std::fs::write(folder.join("times.toml"), "exposure_s = [1.0, 0.25, 0.0625]\n").unwrap();
}

#[test]
fn a_bracket_is_merged_to_the_radiance_of_its_scene() {
    let folder = tempfile::tempdir().unwrap();
    bracket(folder.path());
    run_line(
        folder.path(),
        "@shot_#.png --exposures @times.toml --output @response.json --merge @a.exr --plot @a.svg",
    )
    .unwrap();
    let text = std::fs::read_to_string(folder.path().join("response.json")).unwrap();
    let response = Response::new(serde_json::from_str(&text).unwrap()).unwrap();
    assert_eq!((response.black_clip_code(), response.saturation_code()), (0, 255));
    let mut frame = Frame::default();
    read(&folder.path().join("a.exr"), &mut frame).unwrap();
    let Pixels::Radiance(values) = &frame.pixels else { panic!("codes") };
    let ratio = |column: usize| f64::from(values[3 * column]) / (column as f64 + 0.5);
    for column in 10..128 {
        assert!((ratio(column) / ratio(64) - 1.0).abs() < 0.03, "{column}: {}", ratio(column) / ratio(64));
    }
}

#[test]
fn a_bracket_without_times_says_what_is_needed() {
    let folder = tempfile::tempdir().unwrap();
    bracket(folder.path());
    let error = run_line(folder.path(), "@shot_0.png @shot_1.png").unwrap_err();
    assert!(error.to_string().contains("say the times with --exposures"), "{error}");
    let error = run_line(folder.path(), "@shot_0.png @shot_1.png --exposures @times.toml").unwrap_err();
    assert!(error.to_string().contains("line 1: exposure_s: has 3 times for 2 pictures"), "{error}");
}
