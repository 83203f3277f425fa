use super::*;
use crate::error::Kind;
use glam::{DMat3, DVec3};
use lightcast_core::test_data::real_folder;
use std::path::Path;

/// Pseudorandom normal deviates (splitmix64, Box-Muller), the same in every run.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let (radius, turn) = ((-2.0 * (1.0 - self.uniform()).ln()).sqrt(), self.uniform());
        radius * (std::f64::consts::TAU * turn).cos()
    }
}

fn wide_lens() -> LensParameters {
    LensParameters {
        width: 1024,
        height: 1024,
        fx: 262.0,
        fy: 261.2,
        cx: 515.3,
        cy: 508.1,
        k: [0.018, -0.0052, 0.0011, -0.0002],
        field_of_view_rad: 220f64.to_radians(),
    }
}

/// A start from a rough measurement of the circle of `wide_lens`.
fn wide_start() -> LensStart {
    LensStart {
        width: 1024,
        height: 1024,
        field_of_view_rad: 220f64.to_radians(),
        circle_diameter_px: 1000.0,
        circle_centre_px: DVec2::new(512.0, 512.0),
    }
}

/// Views of a board of 9 x 7 corners whose middle is 0 to 88 degrees from the axis, facing the camera at
/// various tilts, so that corners reach 105 degrees.
fn synthetic(lens: LensParameters, count: usize, noise_px: f64) -> Vec<BoardView> {
    synthetic_within(lens, 230.0, 88.0, count, noise_px)
}

/// The same with the board's middle up to `middle_deg` from the axis, through a lens with a field of view of
/// `field_of_view_deg`.
fn synthetic_within(
    lens: LensParameters,
    field_of_view_deg: f64,
    middle_deg: f64,
    count: usize,
    noise_px: f64,
) -> Vec<BoardView> {
    let lens =
        Lens::new(LensParameters { field_of_view_rad: field_of_view_deg.to_radians(), ..lens }).unwrap();
    let mut noise = Noise(7);
    (0..count)
        .map(|view| {
            let theta = (middle_deg * view as f64 / (count - 1).max(1) as f64).to_radians();
            let psi = 2.4 * view as f64;
            let sight = DVec3::new(theta.sin() * psi.cos(), theta.sin() * psi.sin(), theta.cos());
            let towards = DMat3::from_axis_angle(DVec3::new(-psi.sin(), psi.cos(), 0.0), theta);
            let tilt = DMat3::from_rotation_x(0.5 * (1.3 * view as f64).sin())
                * DMat3::from_rotation_y(0.5 * (2.1 * view as f64).cos())
                * DMat3::from_rotation_z(0.9 * view as f64);
            let corners = (0..63)
                .map(|corner| {
                    let board_m = DVec2::new(f64::from(corner % 9), f64::from(corner / 9)) * 0.03;
                    let point = sight * 0.4 + towards * tilt * (board_m - DVec2::new(0.12, 0.09)).extend(0.0);
                    let noise = DVec2::new(noise.normal(), noise.normal()) * noise_px;
                    Corner { board_m, pixel: lens.project(point).unwrap() + noise }
                })
                .collect();
            BoardView { name: format!("view{view:02}"), corners }
        })
        .collect()
}

fn fit(views: &[BoardView], start: &LensStart) -> LensFit {
    fit_lens(views, start, &LensFitOptions::default()).unwrap()
}

/// Largest distance of pixels between two lenses, over rays up to `theta_max_rad`.
fn farthest_px(a: &Lens, b: &Lens, theta_max_rad: f64) -> f64 {
    let rays = (0..=200).map(|step| {
        let (theta, psi) = (theta_max_rad * f64::from(step) / 200.0, 0.7 * f64::from(step));
        DVec3::new(theta.sin() * psi.cos(), theta.sin() * psi.sin(), theta.cos())
    });
    rays.map(|ray| a.project(ray).unwrap().distance(b.project(ray).unwrap())).fold(0.0, f64::max)
}

#[test]
fn a_lens_of_220_degrees_is_recovered_exactly_from_rays_beyond_90_degrees() {
    let views = synthetic(wide_lens(), 16, 0.0);
    let fit = fit(&views, &wide_start());
    assert!(fit.theta_max_rad > 105f64.to_radians(), "{}", fit.theta_max_rad.to_degrees());
    let (found, exact) = (fit.lens.parameters(), wide_lens());
    for (name, found, exact) in [
        ("fx", found.fx, exact.fx),
        ("fy", found.fy, exact.fy),
        ("cx", found.cx, exact.cx),
        ("cy", found.cy, exact.cy),
    ] {
        assert!((found - exact).abs() < 1e-6, "{name}: {found} {exact}");
    }
    for at in 0..4 {
        assert!((found.k[at] - exact.k[at]).abs() < 1e-8, "k{}: {:?}", at + 1, found.k);
    }
    assert!(fit.rms_px < 1e-8, "{}", fit.rms_px);
    assert!(fit.views.iter().all(|view| view.dropped.is_none()));
    assert_eq!(fit.residuals.len(), 16 * 63);
}

#[test]
fn the_start_may_be_a_third_off() {
    let views = synthetic(wide_lens(), 16, 0.1);
    let reference = fit(&views, &wide_start());
    for factor in [0.7, 0.85, 1.2, 1.35] {
        let start = LensStart { circle_diameter_px: 1000.0 * factor, ..wide_start() };
        let other = fit(&views, &start);
        let distance = farthest_px(&reference.lens, &other.lens, 1.8);
        assert!(distance < 1e-4, "{factor}: {distance}");
    }
    let start = LensStart { circle_centre_px: DVec2::new(480.0, 540.0), ..wide_start() };
    assert!(farthest_px(&reference.lens, &fit(&views, &start).lens, 1.8) < 1e-4);
}

#[test]
fn the_declared_field_of_view_is_kept_cut_or_remarked_on() {
    // r' = 1 - 0.3 theta^2 vanishes at 104.6 degrees; corners reach 70 degrees.
    let turning = LensParameters { k: [-0.1, 0.0, 0.0, 0.0], field_of_view_rad: 3.6, ..wide_lens() };
    let mut views = synthetic_within(turning, 208.0, 50.0, 16, 0.0);
    let declare = |field_of_view_deg: f64| LensStart {
        field_of_view_rad: field_of_view_deg.to_radians(),
        circle_diameter_px: 262.0 * field_of_view_deg.to_radians(),
        ..wide_start()
    };
    let cut = fit(&views, &declare(240.0));
    let expected_deg = 2.0 * (10.0f64 / 3.0).sqrt().to_degrees();
    let found_deg = cut.lens.parameters().field_of_view_rad.to_degrees();
    assert!(
        (found_deg - expected_deg).abs() < 1e-3 && found_deg < expected_deg,
        "{found_deg} {expected_deg}"
    );
    assert!(cut.notes[0].contains("cut from the declared 240.00"), "{:?}", cut.notes);
    assert!(cut.notes[1].contains("extrapolated"), "{:?}", cut.notes);
    let narrow = fit(&views, &declare(100.0));
    assert!(narrow.notes[0].contains("beyond the declared field of view of 100.0"), "{:?}", narrow.notes);
    let widest_deg = 2.0 * cut.theta_max_rad.to_degrees();
    assert!(fit(&views, &declare(widest_deg + 4.0)).notes.is_empty());

    // Corners whose radii decrease again towards the rim, which no real lens does.
    for view in &mut views {
        for corner in &mut view.corners {
            let from_centre = corner.pixel - DVec2::new(515.3, 508.1);
            let r = from_centre.length() / 262.0;
            corner.pixel = DVec2::new(515.3, 508.1) + from_centre * (1.0 - 0.5 * r.powi(4));
        }
    }
    let keep_all = LensFitOptions { drop_factor: f64::INFINITY };
    let error = fit_lens(&views, &declare(200.0), &keep_all).unwrap_err();
    assert_eq!(error.kind(), Kind::Failed);
    assert!(
        error.to_string().contains("turns at") && error.to_string().contains("inside the corners"),
        "{error}"
    );
}

#[test]
fn noise_leaves_the_deviations_that_are_reported() {
    let views = synthetic(wide_lens(), 24, 0.2);
    let fit = fit(&views, &wide_start());
    // Two coordinates of 0.2 px each, less the degrees of freedom of the parameters.
    let degrees: f64 = 2.0 * 24.0 * 63.0;
    let expected = 0.2 * (2.0 * (degrees - 8.0 - 144.0) / degrees).sqrt();
    assert!((fit.rms_px / expected - 1.0).abs() < 0.03, "{} {expected}", fit.rms_px);
    let (found, exact, sigma) = (fit.lens.parameters(), wide_lens(), fit.deviations);
    let errors = [
        (found.fx - exact.fx) / sigma.fx,
        (found.fy - exact.fy) / sigma.fy,
        (found.cx - exact.cx) / sigma.cx,
        (found.cy - exact.cy) / sigma.cy,
        (found.k[0] - exact.k[0]) / sigma.k[0],
        (found.k[1] - exact.k[1]) / sigma.k[1],
        (found.k[2] - exact.k[2]) / sigma.k[2],
        (found.k[3] - exact.k[3]) / sigma.k[3],
    ];
    // Chi-squared of 8: 0.5 % are below 1.3 or above 22, were the parameters independent. They are not, so
    // only the largest error is bounded: 4 sigma in any of 8 numbers has a probability of one in 2000.
    assert!(errors.iter().all(|error| error.abs() < 4.0), "{errors:?}");
    assert!(errors.iter().any(|error| error.abs() > 0.1), "deviations are far too large: {errors:?}");
}

type Spoil = fn(&mut BoardView);

#[test]
fn a_spoiled_view_is_named_and_dropped_and_does_not_bend_the_lens() {
    let good = synthetic(wide_lens(), 16, 0.1);
    let spoils: [(&str, Spoil); 4] = [
        ("noise", |view| {
            let mut noise = Noise(99);
            for corner in &mut view.corners {
                corner.pixel += DVec2::new(noise.normal(), noise.normal()) * 4.0;
            }
        }),
        ("one row shifted", |view| {
            for corner in view.corners.iter_mut().skip(9).take(9) {
                corner.pixel += DVec2::new(3.0, 1.0);
            }
        }),
        ("one corner", |view| view.corners[40].pixel.y += 2.0),
        // Corners numbered column by column. (A mirrored board would look like one seen from behind.)
        ("order", |view| {
            for (at, corner) in view.corners.iter_mut().enumerate() {
                corner.board_m = DVec2::new((at / 7) as f64, (at % 7) as f64) * 0.03;
            }
        }),
    ];
    for (what, spoil) in spoils {
        let mut views = good.clone();
        spoil(&mut views[5]);
        let found = fit(&views, &wide_start());
        let dropped: Vec<&ViewFit> = found.views.iter().filter(|view| view.dropped.is_some()).collect();
        assert_eq!(dropped.len(), 1, "{what}: {dropped:?}");
        assert_eq!(dropped[0].name, "view05");
        let reason = dropped[0].dropped.as_deref().unwrap();
        assert!(reason.contains("the median"), "{what}: {reason}");
        // The result is the fit without the view.
        let mut without = good.clone();
        without.remove(5);
        let distance = farthest_px(&found.lens, &fit(&without, &wide_start()).lens, 1.8);
        assert!(distance < 1e-4, "{what}: {distance}");
    }
}

#[test]
fn what_determines_no_lens_is_an_error_that_says_what_to_do() {
    let views = synthetic(wide_lens(), 16, 0.1);
    let options = LensFitOptions::default();
    let failure = |views: &[BoardView], start: &LensStart| {
        let error = fit_lens(views, start, &options).unwrap_err();
        (error.kind(), error.to_string())
    };
    for few in [0, 1, 2] {
        let (kind, message) = failure(&views[..few], &wide_start());
        assert_eq!(kind, Kind::Failed);
        assert!(
            message.contains(&format!("{few} of {few} views")) && message.contains("take 10 to 30"),
            "{message}"
        );
    }

    let mut line = views.clone();
    for view in &mut line {
        view.corners.retain(|corner| corner.board_m.y == 0.0);
    }
    let (_, message) = failure(&line, &wide_start());
    assert!(message.contains("0 of 16 views") && message.contains("one line of the board"), "{message}");
    assert!(message.contains("view00") && message.contains("and 13 more"), "{message}");

    let mut few = views.clone();
    for view in &mut few {
        view.corners.truncate(5);
    }
    assert!(failure(&few, &wide_start()).1.contains("5 corners, at least 6"));

    let mut nan = views.clone();
    nan[3].corners[7].pixel.x = f64::NAN;
    let (kind, message) = failure(&nan, &wide_start());
    assert_eq!(kind, Kind::Usage);
    assert!(message.contains("view03: corner 8") && message.contains("leave out"), "{message}");

    for (start, part) in [
        (LensStart { circle_diameter_px: 0.0, ..wide_start() }, "circle_diameter_px = 0"),
        (LensStart { circle_diameter_px: f64::NAN, ..wide_start() }, "circle_diameter_px = NaN"),
        (LensStart { field_of_view_rad: 0.0, ..wide_start() }, "field_of_view_deg = 0"),
        (LensStart { circle_centre_px: DVec2::NAN, ..wide_start() }, "cx"),
        (LensStart { width: 0, ..wide_start() }, "width"),
    ] {
        let (kind, message) = failure(&views, &start);
        assert_eq!(kind, Kind::Usage);
        assert!(message.contains(part), "{part}: {message}");
    }
    let never = LensFitOptions { drop_factor: f64::NAN };
    assert!(fit_lens(&views, &wide_start(), &never).unwrap_err().to_string().contains("drop_factor"));
}

#[test]
fn views_without_any_agreement_are_an_error() {
    let mut views = synthetic(wide_lens(), 9, 0.1);
    for (number, view) in views.iter_mut().enumerate() {
        let mut noise = Noise(number as u64);
        for corner in &mut view.corners {
            corner.pixel = DVec2::new(noise.uniform(), noise.uniform()) * 1024.0;
        }
    }
    let error = fit_lens(&views, &wide_start(), &LensFitOptions::default()).unwrap_err();
    assert_eq!(error.kind(), Kind::Failed);
    assert!(error.to_string().contains("add pictures") || error.to_string().contains("half of"), "{error}");
}

/// A test set of real corners, with the lens that other software fitted to it.
struct RealSet {
    views: Vec<BoardView>,
    size: [usize; 2],
}

fn points(value: &serde_json::Value) -> Vec<DVec2> {
    let pair = |pair: &serde_json::Value| DVec2::new(pair[0].as_f64().unwrap(), pair[1].as_f64().unwrap());
    value.as_array().unwrap().iter().map(pair).collect()
}

/// Half a pixel is added: the files have OpenCV's coordinates.
fn view(name: String, pixels: &serde_json::Value, columns: usize, pitch_m: f64) -> BoardView {
    let corners = points(pixels).into_iter().enumerate().map(|(at, pixel)| Corner {
        board_m: DVec2::new((at % columns) as f64, (at / columns) as f64) * pitch_m,
        pixel: pixel + 0.5,
    });
    BoardView { name, corners: corners.collect() }
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers<const N: usize>(value: &serde_json::Value) -> [f64; N] {
    std::array::from_fn(|at| value[at].as_f64().unwrap())
}

fn opencv_set(folder: &Path) -> RealSet {
    let file = json(&folder.join("opencv_calib3_left_corners.json"));
    let (columns, pitch) =
        (file["grid_cols_rows"][0].as_u64().unwrap() as usize, file["pitch"].as_f64().unwrap());
    let views = file["views"].as_array().unwrap().iter().enumerate();
    RealSet {
        views: views.map(|(at, pixels)| view(format!("left{at:02}"), pixels, columns, pitch)).collect(),
        size: numbers::<2>(&file["image_size"]).map(|side| side as usize),
    }
}

fn reference_set(path: &Path) -> RealSet {
    let file = json(path);
    let columns = file["pattern_inner_corners_cols_rows"][0].as_u64().unwrap() as usize;
    let pitch = file["square_size"].as_f64().unwrap();
    let views = file["views"].as_array().unwrap().iter();
    RealSet {
        views: views
            .map(|entry| view(entry["file"].as_str().unwrap().to_owned(), &entry["corners"], columns, pitch))
            .collect(),
        size: numbers::<2>(&file["image_size"]).map(|side| side as usize),
    }
}

impl RealSet {
    /// Only quantities that a user measures: the field of view along the diagonal, or the circle.
    fn start(&self, field_of_view_deg: f64, circle_diameter_px: f64) -> LensStart {
        let [width, height] = self.size;
        LensStart {
            width,
            height,
            field_of_view_rad: field_of_view_deg.to_radians(),
            circle_diameter_px,
            circle_centre_px: DVec2::new(width as f64, height as f64) * 0.5,
        }
    }
}

fn print(name: &str, fit: &LensFit) {
    let rms: Vec<f64> = fit.views.iter().filter_map(|view| view.rms_px).collect();
    let mut sorted = rms.clone();
    sorted.sort_by(f64::total_cmp);
    println!(
        "{name}: RMS {:.6} px, corners to {:.2} degrees, {:?}, deviations {:?}, worst view {:.3} median {:.3}; dropped: {:?}; {:?}",
        fit.rms_px,
        fit.theta_max_rad.to_degrees(),
        fit.lens.parameters(),
        fit.deviations,
        sorted[sorted.len() - 1],
        sorted[sorted.len() / 2],
        fit.views.iter().filter(|view| view.dropped.is_some()).collect::<Vec<_>>(),
        fit.notes
    );
}

#[test]
fn opencvs_own_test_gives_the_published_lens_within_its_uncertainties() {
    let Some(folder) = real_folder("calib") else { return };
    let set = opencv_set(&folder);
    // A picture without a visible circle: 130 degrees over its 1280 columns is a rough guess.
    let fit = fit(&set.views, &set.start(130.0, 1280.0));
    print("OpenCV calib-3", &fit);
    assert!(fit.rms_px <= 0.265, "{}", fit.rms_px);
    assert_eq!(fit.views.iter().filter(|view| view.dropped.is_none()).count(), 34);
    let lens = fit.lens.parameters();
    // test_fisheye.cpp: K, D and uncertainties.
    let published = [
        (lens.fx, 558.478087865323, 1.29837),
        (lens.fy, 560.506767351568, 1.31566),
        (lens.cx - 0.5, 620.458515360843, 0.890439),
        (lens.cy - 0.5, 381.939424848348, 0.816097),
        (lens.k[0], -0.0014613319981768, 0.00516249),
        (lens.k[1], -0.00329861110580401, 0.0168181),
        (lens.k[2], 0.00605760088590183, 0.0213119),
        (lens.k[3], -0.00374209380722371, 0.00916011),
    ];
    for (found, expected, uncertainty) in published {
        // The two differ only by the rounding of corners to 0.001 px: far less than the uncertainty.
        assert!((found - expected).abs() < 0.01 * uncertainty, "{found} {expected} +- {uncertainty}");
    }
    // OpenCV returns three standard deviations, and divides the sum of squares by the number of coordinates
    // without subtracting the unknowns.
    let coordinates = 2.0 * 34.0 * 48.0;
    let factor = 3.0 * f64::sqrt((coordinates - 8.0 - 6.0 * 34.0) / coordinates);
    for (sigma, (_, _, uncertainty)) in list(fit.deviations).into_iter().zip(published) {
        assert!((factor * sigma / uncertainty - 1.0).abs() < 1e-3, "{} {uncertainty}", factor * sigma);
    }
}

fn list(LensDeviations { fx, fy, cx, cy, k: [k1, k2, k3, k4] }: LensDeviations) -> [f64; 8] {
    [fx, fy, cx, cy, k1, k2, k3, k4]
}

#[test]
fn real_chessboards_fit_as_well_as_with_others_solvers() {
    let Some(folder) = real_folder("calib") else { return };
    // RMS, lens and 1-sigma of an independent least-squares fit.
    let sets = [
        (
            "stereo_left_9x6",
            (180.0, 700.0),
            None,
            0.18498,
            [227.9677, 227.2858, 471.3161, 305.8419, 0.023837, -0.021707, 0.017822, -0.006492],
            [0.285, 0.299, 0.222, 0.187, 0.00207, 0.00483, 0.0045, 0.00141],
        ),
        (
            "urban_fisheye1_8x6",
            (185.0, 1080.0),
            // One of its corners was found 7 px off; the reference leaves it out too.
            Some("Fisheye1_5.jpg"),
            0.40620,
            [336.7101, 336.3795, 543.1978, 377.8679, 0.001211, -0.00661, 0.000929, -0.000543],
            [0.222, 0.213, 0.113, 0.113, 0.00222, 0.00374, 0.00248, 0.000561],
        ),
    ];
    for (name, (field_of_view_deg, circle_px), bad, rms_px, expected, sigma) in sets {
        let set = reference_set(&folder.join(name).join("reference.json"));
        let fit = fit(&set.views, &set.start(field_of_view_deg, circle_px));
        print(name, &fit);
        let dropped = fit.views.iter().filter(|view| view.dropped.is_some()).map(|view| view.name.as_str());
        assert!(dropped.eq(bad), "{name}");
        assert!(fit.rms_px <= 1.01 * rms_px, "{name}: {}", fit.rms_px);
        let lens = fit.lens.parameters();
        let found =
            [lens.fx, lens.fy, lens.cx - 0.5, lens.cy - 0.5, lens.k[0], lens.k[1], lens.k[2], lens.k[3]];
        let deviations = list(fit.deviations);
        for at in 0..8 {
            assert!((found[at] - expected[at]).abs() < 0.2 * sigma[at], "{name} {at}: {found:?}");
            assert!((deviations[at] / sigma[at] - 1.0).abs() < 0.1, "{name} {at}: {deviations:?}");
        }
        // Neither the lens nor the dropped views depend on how accurately the circle was measured.
        for factor in [0.5, 0.8, 1.3, 2.0] {
            let other = fit_lens(
                &set.views,
                &set.start(field_of_view_deg, factor * circle_px),
                &LensFitOptions::default(),
            )
            .unwrap();
            let distance = farthest_px(&fit.lens, &other.lens, 1.4);
            assert!(distance < 1e-4, "{name}, circle {factor} times as large: {distance} px");
            let dropped = |fit: &LensFit| -> Vec<bool> {
                fit.views.iter().map(|view| view.dropped.is_some()).collect()
            };
            assert_eq!(dropped(&fit), dropped(&other), "{name}, circle {factor} times as large");
        }
    }
}

#[test]
fn a_spoiled_view_among_real_ones_is_named() {
    let Some(folder) = real_folder("calib") else { return };
    let mut set = reference_set(&folder.join("stereo_left_9x6/reference.json"));
    let name = set.views[11].name.clone();
    // A board that moved during the exposure: its far end is off by 3 px.
    for corner in &mut set.views[11].corners {
        corner.pixel.x += 3.0 * (corner.board_m.x / 0.2).powi(3);
    }
    let fit = fit(&set.views, &set.start(180.0, 700.0));
    let dropped: Vec<&str> =
        fit.views.iter().filter(|view| view.dropped.is_some()).map(|view| view.name.as_str()).collect();
    print("spoiled", &fit);
    assert_eq!(dropped, [name.as_str()]);
}
