use super::*;
use crate::calibrate::{BoardView, Calibration, LensFitOptions, LensStart, fit_lens};
use crate::error::Kind;
use crate::files::read_grey;
use glam::{DMat3, DVec3};
use lightcast_core::camera::{Lens, LensParameters};
use lightcast_core::test_data::real_folder;
use nalgebra::{Matrix3, SMatrix, SymmetricEigen, Vector3};

const KALIBR: &str = "target_type: 'aprilgrid' #gridtype\ntagCols: 6               #number of apriltags\ntagRows: 6\n\
tagSize: 0.088           #size of apriltag, edge to edge [m]\ntagSpacing: 0.3          #ratio of space between tags to tagSize\n";

fn grid() -> AprilGrid {
    AprilGrid::parse(KALIBR).unwrap()
}

#[test]
fn target_files_of_kalibr_are_read_and_others_refused_by_key() {
    assert_eq!(grid(), AprilGrid { columns: 6, rows: 6, tag_size_m: 0.088, spacing: 0.3 });
    for (text, part) in [
        (KALIBR.replace("'aprilgrid'", "'checkerboard'"), "target_type = checkerboard: only"),
        (KALIBR.replace("tagCols: 6", "tagCols: 0"), "tagCols = 0: with tagRows = 6"),
        (KALIBR.replace("tagCols: 6", "tagCols: 100"), "587 tags"),
        (KALIBR.replace("0.088", "-0.088"), "tagSize = -0.088: is no edge"),
        (KALIBR.replace("0.3 ", ".nan "), "tagSpacing = NaN: is no ratio"),
        (KALIBR.replace("tagRows", "tagLines"), "tagLines"),
        (KALIBR.replace("tagRows: 6\n", ""), "tagRows"),
        (KALIBR.to_owned() + "lowId: 3\n", "lowId = 3: only"),
        (String::new(), "Kalibr"),
    ] {
        let error = AprilGrid::parse(&text).unwrap_err();
        assert_eq!(error.kind(), Kind::Usage);
        assert!(error.to_string().contains(part), "{part}: {error}");
    }
    let missing = AprilGrid::load(Path::new("/nonexistent/april.yaml")).unwrap_err().to_string();
    assert!(missing.contains("april.yaml: cannot be read"), "{missing}");
}

#[test]
fn corners_of_tags_lie_on_the_board_as_kalibr_counts_them() {
    let grid = grid();
    assert_eq!(grid.corner_m(0, 0), Some(DVec2::ZERO));
    assert_eq!(grid.corner_m(0, 2), Some(DVec2::splat(0.088)));
    assert!((grid.corner_m(7, 1).unwrap() - DVec2::new(0.088 * 2.3, 0.088 * 1.3)).length() < 1e-15);
    assert_eq!(grid.corner_m(36, 0), None);
    assert_eq!(grid.corner_m(usize::MAX, 0), None);
}

/// What the board shows at a point, 0 black, 1 white.
fn pattern(grid: &AprilGrid, at: DVec2) -> f64 {
    let (step, gap) = (grid.tag_size_m * (1.0 + grid.spacing), grid.tag_size_m * grid.spacing);
    let cell = (at / step).floor();
    let within = at - cell * step;
    let (columns, rows) = (grid.columns as f64, grid.rows as f64);
    let is_tag = cell.x >= 0.0 && cell.y >= 0.0 && cell.x < columns && cell.y < rows;
    if within.max_element() < grid.tag_size_m {
        if !is_tag {
            return 1.0;
        }
        let bit = (within / grid.tag_size_m * 10.0).floor() - 2.0;
        if bit.min_element() < 0.0 || bit.max_element() > 5.0 {
            return 0.0;
        }
        let code = ::aprilgrid::tag_families::T36H11[cell.y as usize * grid.columns + cell.x as usize];
        // The highest bit is the upper left cell.
        let number = (5 - bit.y as u32) * 6 + bit.x as u32;
        return f64::from((code >> (35 - number)) as u32 & 1);
    }
    // Black squares where four gaps meet, also along the outside.
    let is_corner = within.min_element() >= grid.tag_size_m;
    let is_near = cell.x >= -1.0 && cell.y >= -1.0 && cell.x < columns && cell.y < rows;
    if is_corner && is_near && gap > 0.0 { 0.0 } else { 1.0 }
}

/// A picture of the board through the lens: 4 x 4 samples a pixel, a grey wall around it.
fn photograph(grid: &AprilGrid, lens: &Lens, rotation: DMat3, translation: DVec3) -> GreyPicture {
    let LensParameters { width, height, .. } = *lens.parameters();
    let board_from_camera = rotation.transpose();
    let extent = grid.tag_size_m * (1.0 + grid.spacing) * DVec2::new(grid.columns as f64, grid.rows as f64);
    let value = |x: usize, y: usize| {
        let mut sum = 0.0;
        for sample in 0..16 {
            let offset = DVec2::new(f64::from(sample % 4), f64::from(sample / 4)) * 0.25 + 0.125;
            let Some(ray) = lens.unproject(DVec2::new(x as f64, y as f64) + offset) else { continue };
            let (direction, origin) = (board_from_camera * ray, -(board_from_camera * translation));
            let distance = -origin.z / direction.z;
            let hit = (origin + direction * distance).truncate();
            let is_board =
                distance > 0.0 && hit.cmpge(DVec2::splat(-0.06)).all() && hit.cmple(extent + 0.04).all();
            sum += if is_board { 25.0 + 200.0 * pattern(grid, hit) } else { 110.0 };
        }
        (sum / 16.0f64).round() as u8
    };
    let values = (0..width * height).map(|at| value(at % width, at / width)).collect();
    GreyPicture { width, height, values }
}

#[test]
fn a_lens_is_recovered_from_rendered_photographs() {
    let exact = LensParameters {
        width: 560,
        height: 560,
        fx: 180.0,
        fy: 179.2,
        cx: 282.3,
        cy: 277.6,
        k: [0.01, -0.004, 0.001, -0.0002],
        field_of_view_rad: 180f64.to_radians(),
    };
    let lens = Lens::new(exact).unwrap();
    let grid = grid();
    let middle = DVec3::new(0.33, 0.33, 0.0);
    let mut errors = Vec::new();
    let views: Vec<BoardView> = (0..8)
        .map(|view| {
            let turn = f64::from(view);
            // Half a turn about x: the board's y points up, the camera's points down.
            let rotation = DMat3::from_rotation_y(0.55 * (0.9 * turn).cos())
                * DMat3::from_rotation_x(0.55 * (1.7 * turn).sin())
                * DMat3::from_rotation_z(0.4 * turn)
                * DMat3::from_rotation_x(std::f64::consts::PI);
            let centre = DVec3::new(0.28 * (2.2 * turn).cos(), 0.28 * (2.2 * turn).sin(), 0.48);
            let translation = centre - rotation * middle;
            let corners = grid.find(&photograph(&grid, &lens, rotation, translation)).unwrap();
            for corner in &corners {
                let truth = lens.project(rotation * corner.board_m.extend(0.0) + translation).unwrap();
                errors.push(corner.pixel - truth);
            }
            println!("view {view}: {} tags", corners.len() / 4);
            BoardView { name: format!("{view}"), corners }
        })
        .collect();
    let count = errors.len() as f64;
    let mean = errors.iter().copied().sum::<DVec2>() / count;
    let rms = (errors.iter().map(|error| error.length_squared()).sum::<f64>() / count).sqrt();
    println!("{count} corners, mean error {mean} px, RMS {rms:.4} px");
    // The detector finds no board in some of the strongly tilted views; the fit drops those.
    assert!(count > 4.0 * 100.0, "{count}");
    // A wrong convention of half a pixel would be detected here.
    assert!(mean.length() < 0.03 && rms < 0.2, "{mean} {rms}");
    let start = LensStart {
        width: 560,
        height: 560,
        field_of_view_rad: exact.field_of_view_rad,
        circle_diameter_px: 560.0,
        circle_centre_px: DVec2::splat(280.0),
    };
    let fit = fit_lens(&views, &start, &LensFitOptions::default()).unwrap();
    println!(
        "RMS {:.4} px to {:.1} degrees: {:?} +- {:?}",
        fit.rms_px,
        fit.theta_max_rad.to_degrees(),
        fit.lens.parameters(),
        fit.deviations
    );
    let distances = (0..60).map(|step| {
        let (theta, psi) = (fit.theta_max_rad * f64::from(step) / 59.0, 0.7 * f64::from(step));
        let ray = DVec3::new(theta.sin() * psi.cos(), theta.sin() * psi.sin(), theta.cos());
        fit.lens.project(ray).unwrap().distance(lens.project(ray).unwrap())
    });
    let farthest = distances.fold(0.0, f64::max);
    println!("lens off by {farthest:.3} px at most");
    // The accuracy of the corners is that of the detector; the lens may be off by a few times that.
    assert!(farthest < 3.0 * rms, "{farthest} {rms}");
}

/// RMS distance in px of corners from where a homography of the board, fitted to their rays, puts them.
fn flatness_px(lens: &Lens, corners: &[Corner]) -> f64 {
    let mut normal_matrix = SMatrix::<f64, 9, 9>::zeros();
    let board = |corner: &Corner| Vector3::new(corner.board_m.x, corner.board_m.y, 0.3);
    for corner in corners {
        let ray = lens.unproject(corner.pixel).unwrap();
        let cross = Vector3::new(ray.x, ray.y, ray.z).cross_matrix();
        let p = board(corner);
        for row in 0..3 {
            let equation = SMatrix::<f64, 9, 1>::from_fn(|at, _| cross[(row, at / 3)] * p[at % 3]);
            normal_matrix += equation * equation.transpose();
        }
    }
    let eigen = SymmetricEigen::new(normal_matrix);
    let h = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let h = Matrix3::from_fn(|row, column| h[3 * row + column]);
    let squares = corners.iter().map(|corner| {
        let p = h * board(corner);
        let p = DVec3::new(p.x, p.y, p.z);
        // The sign of the homography is undetermined.
        let seen =
            [p, -p].into_iter().filter_map(|p| lens.project(p)).map(|at| at.distance_squared(corner.pixel));
        seen.fold(f64::INFINITY, f64::min)
    });
    (squares.sum::<f64>() / corners.len() as f64).sqrt()
}

#[test]
fn the_grid_in_tum_vis_photograph_is_found_and_flat() {
    let Some(folder) = real_folder("calib/tum_vi") else { return };
    let picture = read_grey(&folder.join("tum_vi_with_chart.png")).unwrap();
    let corners = grid().find(&picture).unwrap();
    println!("{} tags, {} corners", corners.len() / 4, corners.len());
    // The data do not record which camera of the pair took the photograph.
    let flatness = ["cam0", "cam1"].map(|camera| {
        let lens = Calibration::load(&folder.join("kalibr_imucam_chain.yaml"), Some(camera)).unwrap().lens;
        flatness_px(&lens, &corners)
    });
    println!("RMS distance from a plane through the published lenses: {flatness:?} px");
    assert!(corners.len() >= 4 * 30, "{}", corners.len());
    assert!(flatness.into_iter().fold(f64::INFINITY, f64::min) < 0.3, "{flatness:?}");
    // A picture without a board has no corners.
    let lamps = read_grey(&folder.join("cam0.png")).unwrap();
    println!("cam0.png: {} corners", grid().find(&lamps).unwrap().len());
}

#[test]
fn pictures_without_a_board_give_no_corners_and_tiny_ones_an_error() {
    let grid = grid();
    let flat = GreyPicture { width: 64, height: 48, values: vec![128; 64 * 48] };
    assert_eq!(grid.find(&flat).unwrap(), []);
    let noise: Vec<u8> = (0..64u32 * 48).map(|at| (at.wrapping_mul(2_654_435_769) >> 24) as u8).collect();
    assert_eq!(grid.find(&GreyPicture { values: noise, ..flat.clone() }).unwrap(), []);
    for (width, height) in [(0, 0), (1, 1), (31, 64)] {
        let tiny = GreyPicture { width, height, values: vec![0; width * height] };
        assert_eq!(grid.find(&tiny).unwrap_err().kind(), Kind::BadFrame);
    }
}
