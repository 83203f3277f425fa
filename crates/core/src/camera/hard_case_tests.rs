//! The hard cases of METHODS section 10 that concern the frame-to-polar matrix, each by its name.

use super::energy_tests::{DARK, SUN, frame, lens, logarithmic, pixel_solid_angle, raw, set};
use super::{FrameToPolar, LOOKING_UP, Lens, LensParameters, Projection, Response};
use crate::image::{Frame, LatLongCentres, Pixels, PolarMap, PolarShape};
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Maps a raw frame with a sun on the given pixels through a lens, and compares the power with the pixels'
/// solid angle above the map's rim.
fn check_sun(lens: &Lens, rotation: DMat3, shape: PolarShape, sun: &[[usize; 2]]) -> PolarMap {
    let response = logarithmic();
    let (width, height) = (lens.parameters().width, lens.parameters().height);
    let mut matrix = FrameToPolar::new(&Projection::Fisheye(*lens), rotation, shape).unwrap();
    let mut dark = PolarMap::black(shape);
    matrix.apply(&raw(width, height, &response, DARK), &response, &mut dark).unwrap();
    let mut picture = raw(width, height, &response, DARK);
    for pixel in sun {
        set(&mut picture, *pixel, &response, SUN);
    }
    let mut map = PolarMap::black(shape);
    let counts = matrix.apply(&picture, &response, &mut map).unwrap();
    assert_eq!(map.stamp, picture.stamp);
    assert!(counts.saturated <= sun.len() as u64);
    let lowest = shape.theta_max_rad().cos();
    let sun_sr: f64 = sun
        .iter()
        .map(|pixel| pixel_solid_angle(lens, *pixel, 400, |ray| (rotation * ray).y >= lowest))
        .sum();
    let found = map.power()[0] - dark.power()[0];
    let expected = f64::from(SUN - DARK) * sun_sr;
    assert!((found / expected - 1.0).abs() < 1e-3, "{sun:?}: {found} {expected}");
    map
}

/// A lens whose axis pixel coordinate is chosen.
fn centred(cx: f64, cy: f64, field_of_view_deg: f64) -> Lens {
    let parameters = *lens(256, 256, field_of_view_deg).parameters();
    Lens::new(LensParameters { cx, cy, ..parameters }).unwrap()
}

#[test]
fn sun_on_the_pole_keeps_its_power() {
    let shape = PolarShape::hemisphere(360, 90);
    // The pole inside a pixel, on an edge, on a corner, and beside one by rounding.
    for (cx, cy) in [(128.3, 128.6), (128.0, 128.5), (128.5, 128.0), (128.0, 128.0), (128.0 + 1e-12, 128.0)] {
        let map = check_sun(&centred(cx, cy, 180.0), LOOKING_UP, shape, &[[128, 128], [127, 128]]);
        assert!(map.pixels[..360].iter().any(|pixel| pixel[0] > 1e3));
    }
    // The pole at the picture's side, under a camera that looks at the horizon.
    let rotation = DMat3::from_cols(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z);
    let lens = centred(128.0, 128.0, 220.0);
    let pole = lens.project(rotation.transpose() * DVec3::Y).unwrap();
    let pixel = [pole.x.floor() as usize, pole.y.floor() as usize];
    check_sun(&lens, rotation, shape, &[pixel, [pixel[0] - 1, pixel[1]]]);
}

#[test]
fn sun_on_phi_0_keeps_its_power_on_both_sides_of_the_seam() {
    let shape = PolarShape::hemisphere(360, 90);
    let lens = centred(128.0, 128.5, 180.0);
    let map = check_sun(&lens, LOOKING_UP, shape, &[[200, 128], [201, 128]]);
    let lit = |column: usize| (0..90).any(|row| map.luminance(row, column) > 1e3);
    assert!(lit(0) && lit(359) && !lit(180));
}

#[test]
fn sun_between_two_rows_is_shared_by_both() {
    // One row ends at 45 degrees; the pixel's middle lies there.
    let shape = PolarShape::hemisphere(360, 90);
    let lens = centred(127.5, 128.5, 180.0);
    let at = lens.project(DVec3::new(1.0, 0.0, 1.0)).unwrap();
    let lens = centred(127.5 + (at.x.floor() + 0.5 - at.x), 128.5, 180.0);
    let map = check_sun(&lens, LOOKING_UP, shape, &[[at.x.floor() as usize, 128]]);
    let row_power = |row: usize| (0..360).map(|column| f64::from(map.luminance(row, column))).sum::<f64>();
    assert!(row_power(44) > 1e3 && (row_power(44) / row_power(45) - 1.0).abs() < 0.1);
}

#[test]
fn sun_on_the_horizon_and_on_the_rim_of_the_lens_keeps_what_is_seen() {
    let wide = centred(128.0, 128.5, 220.0);
    let at = wide.project(DVec3::X).unwrap();
    check_sun(&wide, LOOKING_UP, PolarShape::hemisphere(360, 90), &[[at.x.floor() as usize, 128]]);
    let slanted = wide.project(DVec3::new(0.6, -0.8, 0.0)).unwrap();
    let pixel = [slanted.x.floor() as usize, slanted.y.floor() as usize];
    check_sun(&wide, LOOKING_UP, PolarShape::hemisphere(360, 90), &[pixel]);
    // The rim of the field of view cuts through the pixel.
    for psi in [0.0f64, 0.4, 2.0, 4.4] {
        let lens = centred(128.2, 128.4, 180.0);
        let theta = lens.theta_max_rad();
        let ray = DVec3::new(theta.sin() * psi.cos(), theta.sin() * psi.sin(), theta.cos());
        let at = lens
            .project(ray * 0.999_999)
            .unwrap_or_else(|| lens.pixel(DVec2::from_angle(psi) * lens.radius_max()));
        let pixel = [at.x.floor() as usize, at.y.floor() as usize];
        check_sun(&lens, DMat3::from_rotation_z(0.3) * LOOKING_UP, PolarShape::sphere(360, 180), &[pixel]);
    }
}

/// A lat-long frame of linear radiance, one channel.
fn lat_long(width: usize, height: usize, radiance: impl Fn(usize, usize) -> f32) -> Frame {
    let values = (0..width * height).map(|index| radiance(index % width, index / width)).collect();
    frame(width, height, 1, Pixels::Radiance(values))
}

fn check_lat_long(centres: LatLongCentres, rotation: DMat3, shape: PolarShape) -> [f64; 2] {
    let (width, height) = (1024, 512);
    let projection = Projection::LatLong { width, height, centres };
    let mut matrix = FrameToPolar::new(&projection, rotation, shape).unwrap();
    let mut map = PolarMap::black(shape);
    matrix.apply(&lat_long(width, height, |_, _| 3.0), &Response::default(), &mut map).unwrap();
    let constant = map.pixels.iter().map(|pixel| f64::from(pixel[0] / 3.0 - 1.0).abs()).fold(0.0, f64::max);
    let edge = |index: usize, count: usize| match centres {
        LatLongCentres::Half => index as f64 / count as f64,
        LatLongCentres::Ends => ((index as f64 - 0.5) / (count as f64 - 1.0)).clamp(0.0, 1.0),
    };
    let mut worst: f64 = 0.0;
    for (x, y) in [(0, 0), (700, 0), (1023, 511), (0, 256), (1023, 255), (256, 100), (255, 1), (511, 510)] {
        let picture = lat_long(width, height, |i, j| if (i, j) == (x, y) { SUN } else { 0.0 });
        matrix.apply(&picture, &Response::default(), &mut map).unwrap();
        let area = TAU
            * (edge(x + 1, width) - edge(x, width))
            * ((PI * edge(y, height)).cos() - (PI * edge(y + 1, height)).cos());
        worst = worst.max((map.power()[0] / (f64::from(SUN) * area) - 1.0).abs());
    }
    [constant, worst]
}

#[test]
fn lat_long_frames_keep_constants_and_power_upright_turned_and_with_centres_on_the_ends() {
    let tilted = DMat3::from_rotation_x(1.1) * DMat3::from_rotation_z(0.4);
    for centres in [LatLongCentres::Half, LatLongCentres::Ends] {
        for rotation in [DMat3::IDENTITY, DMat3::from_rotation_y(0.7), tilted] {
            let [constant, power] = check_lat_long(centres, rotation, PolarShape::sphere(360, 180));
            println!("{centres:?}: constant within {constant:.1e}, power within {power:.1e}");
            assert!(constant < 1e-5 && power < 1e-3, "{centres:?} {constant:e} {power:e}");
        }
    }
}

#[test]
fn an_upright_lat_long_picture_lands_a_quarter_turn_further() {
    // File column u is phi = 2 pi u - pi / 2: +X lies a quarter into the file and at column 0 of the map.
    let projection = Projection::LatLong { width: 16, height: 8, centres: LatLongCentres::Half };
    let shape = PolarShape::sphere(16, 8);
    let mut matrix = FrameToPolar::new(&projection, DMat3::IDENTITY, shape).unwrap();
    let mut map = PolarMap::black(shape);
    let picture = lat_long(16, 8, |x, y| (x + 16 * y) as f32);
    matrix.apply(&picture, &Response::default(), &mut map).unwrap();
    for row in 0..8 {
        for column in 0..16 {
            let expected = ((column + 4) % 16 + 16 * row) as f32;
            assert!((map.luminance(row, column) - expected).abs() <= 1e-5 * expected, "{row} {column}");
        }
    }
}

#[test]
fn constant_maps_of_1_x_1_and_8192_x_2048_pixels_stay_constant() {
    let projection = Projection::LatLong { width: 64, height: 32, centres: LatLongCentres::Half };
    let tilted = DMat3::from_rotation_x(1.1);
    for shape in [PolarShape::sphere(1, 1), PolarShape::hemisphere(1, 1), PolarShape::hemisphere(8192, 2048)]
    {
        let mut matrix = FrameToPolar::new(&projection, tilted, shape).unwrap();
        let mut map = PolarMap::black(shape);
        matrix.apply(&lat_long(64, 32, |_, _| 2.0), &Response::default(), &mut map).unwrap();
        let worst = map.pixels.iter().map(|pixel| (pixel[0] - 2.0).abs()).fold(0.0, f32::max);
        assert!(worst < 2e-5, "{shape:?}: {worst:e}");
    }
}

#[test]
fn one_pixel_of_1e8_over_a_dark_frame_keeps_its_power_and_the_dark_beside_it() {
    let (width, height, dark) = (1024, 512, 1e-3f32);
    let projection = Projection::LatLong { width, height, centres: LatLongCentres::Half };
    let pixel_sr = |y: usize| PolarShape::sphere(width, height).pixel_solid_angle(y);
    for (x, y) in [(300, 200), (0, 0), (1023, 511), (767, 255)] {
        let picture = lat_long(width, height, |i, j| if (i, j) == (x, y) { 1e8 } else { dark });
        let expected = 4.0 * PI * f64::from(dark) + (1e8 - f64::from(dark)) * pixel_sr(y);
        // The smallest map has one pixel, the sum of half a million.
        for shape in [PolarShape::sphere(360, 180), PolarShape::sphere(1, 1)] {
            let mut matrix = FrameToPolar::new(&projection, DMat3::IDENTITY, shape).unwrap();
            let mut map = PolarMap::black(shape);
            matrix.apply(&picture, &Response::default(), &mut map).unwrap();
            let power = map.power()[0];
            assert!((power / expected - 1.0).abs() < 1e-5, "{x} {y} {shape:?}: {power} {expected}");
            let lit = map.pixels.iter().filter(|pixel| (pixel[0] / dark - 1.0).abs() > 1e-4).count();
            // A file pixel meets at most two columns and two rows, at a pole all columns that its width
            // spans.
            assert!((1..=4).contains(&lit), "{x} {y}: {lit} pixels of the map are not dark");
        }
    }
}

#[test]
fn millions_of_frame_pixels_on_one_map_pixel_lose_no_small_ones_beside_1e8() {
    // A quarter of the frame is so bright that a sum of the frame in f32 drops the rest.
    let (width, height) = (2048, 1024);
    let projection = Projection::LatLong { width, height, centres: LatLongCentres::Half };
    let mut matrix = FrameToPolar::new(&projection, DMat3::IDENTITY, PolarShape::sphere(1, 1)).unwrap();
    let mut map = PolarMap::black(PolarShape::sphere(1, 1));
    let picture =
        lat_long(width, height, |x, _| if x < width / 4 { 1e8 } else { 1.0 + 2e4 * (x % 2) as f32 });
    matrix.apply(&picture, &Response::default(), &mut map).unwrap();
    let expected = 0.25e8 + 0.75 * 10_001.0;
    // Without the small ones it is 3e-4 less; what is left is the rounding of weights and of the map's f32.
    assert!((f64::from(map.pixels[0][0]) / expected - 1.0).abs() < 1e-6, "{} {expected}", map.pixels[0][0]);
}

#[test]
fn a_frame_of_one_pixel_fills_the_sphere() {
    let projection = Projection::LatLong { width: 1, height: 1, centres: LatLongCentres::Half };
    let shape = PolarShape::sphere(36, 18);
    let mut matrix = FrameToPolar::new(&projection, DMat3::IDENTITY, shape).unwrap();
    let mut map = PolarMap::black(shape);
    matrix.apply(&lat_long(1, 1, |_, _| 2.0), &Response::default(), &mut map).unwrap();
    assert!(map.pixels.iter().all(|pixel| (pixel[0] - 2.0).abs() < 1e-5));
}

#[test]
fn camera_looking_at_the_horizon_fills_its_half_of_the_map() {
    // The axis to +X, the picture upright: right is +Z, down is -Y.
    let rotation = DMat3::from_cols(DVec3::Z, DVec3::NEG_Y, DVec3::X);
    let shape = PolarShape::sphere(72, 36);
    let projection = Projection::Fisheye(centred(128.0, 128.0, 180.0));
    let mut matrix = FrameToPolar::new(&projection, rotation, shape).unwrap();
    let mut map = PolarMap::black(shape);
    let response = logarithmic();
    matrix.apply(&raw(256, 256, &response, 1.0), &response, &mut map).unwrap();
    for row in 0..36 {
        for column in 0..72 {
            let coverage = matrix.coverage()[row * 72 + column];
            let expected = if (18..54).contains(&column) { 0.0 } else { 1.0 };
            assert!((coverage - expected).abs() < 1e-5, "{row} {column}: {coverage}");
            assert!((map.luminance(row, column) - expected).abs() < 2e-4, "{row} {column}");
        }
    }
}

#[test]
fn nan_infinite_and_negative_samples_are_counted_and_give_no_light() {
    let projection = Projection::LatLong { width: 64, height: 32, centres: LatLongCentres::Half };
    let shape = PolarShape::sphere(32, 16);
    let mut matrix = FrameToPolar::new(&projection, DMat3::IDENTITY, shape).unwrap();
    let mut map = PolarMap::black(shape);
    let bad = |x: usize, y: usize| match (x, y) {
        (1, 1) | (2, 1) => f32::NAN,
        (3, 3) => f32::INFINITY,
        (4, 4) => f32::NEG_INFINITY,
        (5, 5) | (6, 6) | (7, 7) => -2.0,
        (40, 16) => f32::MAX,
        _ => 1.0,
    };
    let counts = matrix.apply(&lat_long(64, 32, bad), &Response::default(), &mut map).unwrap();
    assert_eq!((counts.nan, counts.infinite, counts.negative), (2, 1, 4));
    assert_eq!((counts.saturated, counts.black_clipped), (0, 0));
    assert!(map.pixels.iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
    // The whole frame: one filled with the largest number gives a map filled with it, never infinity.
    matrix.apply(&lat_long(64, 32, |_, _| f32::MAX), &Response::default(), &mut map).unwrap();
    assert!(map.pixels.iter().flatten().all(|value| value.is_finite() && *value > 3.4e38));
    let counts = matrix.apply(&lat_long(64, 32, |_, _| f32::NAN), &Response::default(), &mut map).unwrap();
    assert_eq!(counts.nan, 64 * 32);
    assert_eq!(map.power(), [0.0; 3]);
}

#[test]
fn three_channels_are_three_times_one_channel() {
    let lens = centred(128.3, 127.1, 180.0);
    let shape = PolarShape::hemisphere(90, 30);
    let mut matrix = FrameToPolar::new(&Projection::Fisheye(lens), LOOKING_UP, shape).unwrap();
    let response = logarithmic();
    let code = |pixel: usize, channel: usize| (pixel * 37 % 60_000 + channel * 2000) as u16;
    let rgb: Vec<u16> = (0..3 * 256 * 256).map(|sample| code(sample / 3, sample % 3)).collect();
    let mut map = PolarMap::black(shape);
    let counts = matrix.apply(&frame(256, 256, 3, Pixels::Codes(rgb)), &response, &mut map).unwrap();
    let mut black = 0;
    for channel in 0..3 {
        let codes = (0..256 * 256).map(|pixel| code(pixel, channel)).collect();
        let mut single = PolarMap::black(shape);
        let one = matrix.apply(&frame(256, 256, 1, Pixels::Codes(codes)), &response, &mut single).unwrap();
        for (rgb, mono) in map.pixels.iter().zip(&single.pixels) {
            assert_eq!((rgb[channel], mono[1], mono[2]), (mono[0], mono[0], mono[0]));
        }
        black = black.max(one.black_clipped);
    }
    assert!(black > 0 && counts.black_clipped == black);
}

#[test]
fn frames_that_do_not_match_are_bad_frames_that_name_both() {
    let projection = Projection::LatLong { width: 8, height: 4, centres: LatLongCentres::Half };
    let shape = PolarShape::sphere(4, 2);
    let mut matrix = FrameToPolar::new(&projection, DMat3::IDENTITY, shape).unwrap();
    let mut map = PolarMap::black(shape);
    let good = lat_long(8, 4, |_, _| 1.0);
    let cases = [
        (Frame { width: 9, ..good.clone() }, "9 x 4 pixels, its calibration is for 8 x 4"),
        (Frame { channels: 2, ..good.clone() }, "2 channels"),
        (Frame { pixels: Pixels::Radiance(vec![1.0; 31]), ..good.clone() }, "31 samples"),
        (Frame { pixels: Pixels::Codes(vec![1; 32]), ..good }, "no response"),
    ];
    for (frame, part) in cases {
        let error = matrix.apply(&frame, &Response::default(), &mut map).unwrap_err();
        assert_eq!(error.kind(), crate::error::Kind::BadFrame);
        assert!(error.to_string().contains(part), "{error}");
    }
}

#[test]
fn matrices_that_are_no_rotation_and_absurd_sizes_are_refused() {
    let projection = Projection::LatLong { width: 8, height: 4, centres: LatLongCentres::Half };
    let shape = PolarShape::sphere(4, 2);
    let mirror = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
    for matrix in [DMat3::ZERO, mirror, DMat3::IDENTITY * 2.0, DMat3::IDENTITY * f64::NAN] {
        let error = FrameToPolar::new(&projection, matrix, shape).unwrap_err();
        assert_eq!(error.option(), Some("world_from_camera"));
        assert!(error.message().starts_with("is not a rotation"), "{error}");
    }
    // A matrix that a file gives with six digits counts as a rotation.
    let rounded =
        DMat3::from_cols_array(&DMat3::from_rotation_x(0.5).to_cols_array().map(|v| (v * 1e6).round() / 1e6));
    assert!(FrameToPolar::new(&projection, rounded, shape).is_ok());
    let huge = Projection::LatLong { width: 60_000, height: 60_000, centres: LatLongCentres::Half };
    let error = FrameToPolar::new(&huge, DMat3::IDENTITY, shape).unwrap_err();
    assert_eq!((error.option(), error.value()), (Some("width"), Some("60000")));
}
