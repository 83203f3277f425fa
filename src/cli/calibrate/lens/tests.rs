use super::*;
use crate::calibrate::{BoardView, Corner};
use crate::error::Kind;
use clap::Parser;
use glam::{DMat3, DVec3};
use lightcast_core::camera::{Lens, ResponseModel};

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    arguments: Arguments,
}

fn arguments(words: &[&str]) -> Arguments {
    Line::try_parse_from([&["lens"], words].concat()).unwrap().arguments
}

/// Corners of a board of 8 x 6 in 12 pictures by an equidistant lens of 170 degrees.
fn corner_set() -> CornerSet {
    let lens = Lens::new(LensParameters {
        width: 800,
        height: 600,
        fx: 200.0,
        fy: 200.0,
        cx: 403.5,
        cy: 298.25,
        k: [0.01, 0.0, 0.0, 0.0],
        field_of_view_rad: 170f64.to_radians(),
    })
    .unwrap();
    let views = (0..12).map(|view| {
        let turn = f64::from(view);
        let rotation =
            DMat3::from_rotation_y(0.5 * turn.sin()) * DMat3::from_rotation_x(0.5 * (1.9 * turn).cos());
        let centre = DVec3::new(0.2 * (2.4 * turn).cos(), 0.15 * (2.4 * turn).sin(), 0.25);
        let corners = (0..48).map(|corner| {
            let board_m = DVec2::new(f64::from(corner % 8), f64::from(corner / 8)) * 0.025;
            let point = centre + rotation * (board_m - DVec2::new(0.0875, 0.0625)).extend(0.0);
            Corner { board_m, pixel: lens.project(point).unwrap() }
        });
        BoardView { name: format!("picture{view:02}.png"), corners: corners.collect() }
    });
    CornerSet { width: 800, height: 600, views: views.collect() }
}

#[test]
fn what_is_written_loads_again_in_every_form() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let word = |name: &str| path(name).display().to_string();
    let mut set = corner_set();
    // One picture of a board that was moved.
    for corner in &mut set.views[4].corners {
        corner.pixel.x += 40.0 * corner.board_m.x;
    }
    std::fs::write(path("corners.json"), set.to_json()).unwrap();
    let response = ResponseModel::PiecewiseLinear { knees: vec![(16, 0.0), (1000, 1.0)] };
    let old = Calibration {
        lens: LensStart {
            width: 800,
            height: 600,
            field_of_view_rad: 3.0,
            circle_diameter_px: 600.0,
            circle_centre_px: DVec2::new(400.0, 300.0),
        }
        .lens()
        .unwrap(),
        response: Response::new(response.clone()).unwrap(),
        notes: Vec::new(),
    };
    std::fs::write(path("lens.json"), old.to_json()).unwrap();

    run(&arguments(&[
        &word("corners.json"),
        "--field-of-view-deg=170",
        "--circle-centre-px",
        "390,310",
        "--output",
        &word("lens.json"),
        "--opencv",
        &word("lens.yml"),
        "--kalibr",
        &word("chain.yaml"),
        "--plot",
        &word("residuals.svg"),
    ]))
    .unwrap();
    let own = Calibration::load(&path("lens.json"), None).unwrap();
    assert_eq!(own.response.model(), &response, "the response of the old file");
    let lens = own.lens.parameters();
    assert!((lens.cx - 403.5).abs() < 1e-6 && (lens.k[0] - 0.01).abs() < 1e-8, "{lens:?}");
    assert!((lens.field_of_view_rad.to_degrees() - 170.0).abs() < 1e-9);
    for name in ["lens.yml", "chain.yaml"] {
        let other = *Calibration::load(&path(name), None).unwrap().lens.parameters();
        assert_eq!((other.width, other.height), (lens.width, lens.height));
        let numbers = |p: &LensParameters| [p.fx, p.fy, p.cx, p.cy, p.k[0], p.k[1], p.k[2], p.k[3]];
        for (a, b) in numbers(&other).into_iter().zip(numbers(lens)) {
            // The last digit of a number in JSON may be read as its neighbour.
            assert!((a - b).abs() <= 1e-13 * (1.0 + b.abs()), "{name}: {a} {b}");
        }
    }
    let plot = std::fs::read_to_string(path("residuals.svg")).unwrap();
    assert!(roxmltree::Document::parse(&plot).is_ok());
    assert!(plot.contains("By field angle") && plot.contains("RMS of a dropped picture"));
}

#[test]
fn the_report_names_dropped_pictures() {
    let mut set = corner_set();
    set.views[2].corners.truncate(3);
    let start = LensStart {
        width: 800,
        height: 600,
        field_of_view_rad: 170f64.to_radians(),
        circle_diameter_px: 600.0,
        circle_centre_px: DVec2::new(400.0, 300.0),
    };
    let fit = fit_lens(&set.views, &start, &LensFitOptions::default()).unwrap();
    let report = report(&fit);
    assert_eq!((&report["pictures_used"], &report["pictures_dropped"]), (&json!(11), &json!(1)));
    assert_eq!(report["pictures"][2]["name"], "picture02.png");
    assert_eq!(report["pictures"][2]["dropped"], "3 corners, at least 6 are needed");
    assert!(report["pictures"][1]["dropped"].is_null());
    assert_eq!(report["corners_used"], 11 * 48);
}

#[test]
fn a_position_is_two_numbers() {
    assert_eq!(position("390, 310.5"), Ok(DVec2::new(390.0, 310.5)));
    for wrong in ["390", "390,", "390,310,2", "a,b", ""] {
        assert!(position(wrong).unwrap_err().contains("512,498.5"), "{wrong}");
    }
}

#[test]
fn wrong_use_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let word = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(folder.path().join("corners.json"), corner_set().to_json()).unwrap();
    std::fs::write(folder.path().join("notes.txt"), "not to be lost").unwrap();
    let corners = word("corners.json");
    for (words, part) in [
        (vec![&*corners, "--field-of-view-deg=170", "-o", &word("notes.txt")], "will not be replaced"),
        (vec![&*corners, "--field-of-view-deg=0", "-o", &word("a.json")], "field_of_view_deg = 0"),
        (
            vec![&*corners, "--field-of-view-deg=170", "--drop-factor=1", "-o", &word("a.json")],
            "drop_factor = 1",
        ),
        (vec![&*corners, &*corners, "--field-of-view-deg=170", "-o", &word("a.json")], "one file of corners"),
        (vec![&*word("b.json"), "--field-of-view-deg=170", "-o", &word("a.json")], "b.json: cannot be read"),
        (
            vec![&*corners, "--field-of-view-deg=170", "--opencv=lens.txt", "-o", &word("a.json")],
            ".yml, .yaml or .json",
        ),
    ] {
        let error = run(&arguments(&words)).unwrap_err();
        assert_eq!(error.kind(), Kind::Usage, "{error}");
        assert!(error.to_string().contains(part), "{part}: {error}");
        assert!(!folder.path().join("a.json").exists());
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("notes.txt")).unwrap(), "not to be lost");
}
