//! Energy and constancy through response, lens and polar map (METHODS section 4), by random suns and rotations.

use super::{FrameToPolar, LOOKING_UP, Lens, LensParameters, Projection, Response, ResponseModel};
use crate::image::{Frame, Pixels, PolarMap, PolarShape, Stamp};
use crate::math::fibonacci_sphere;
use glam::{DMat3, DQuat, DVec2, DVec3};
use std::f64::consts::{PI, TAU};

pub(super) const SUN: f32 = 1e6;
pub(super) const DARK: f32 = 0.01;

/// A generator of numbers in [0, 1) with a fixed seed (xorshift).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn rotation(&mut self) -> DMat3 {
        let [a, b, c] = std::array::from_fn(|_| self.next());
        let (low, high) = ((1.0 - a).sqrt(), a.sqrt());
        let (b, c) = (TAU * b, TAU * c);
        DMat3::from_quat(DQuat::from_xyzw(low * b.sin(), low * b.cos(), high * c.sin(), high * c.cos()))
    }
}

pub(super) fn lens(width: usize, height: usize, field_of_view_deg: f64) -> Lens {
    let k = [0.01, -0.003, 0.0004, -0.00002];
    let theta = 0.5 * field_of_view_deg.to_radians();
    let f = 0.49 * width.min(height) as f64 / radius(k, theta);
    Lens::new(LensParameters {
        width,
        height,
        fx: f,
        fy: 0.998 * f,
        cx: 0.5 * width as f64 + 1.3,
        cy: 0.5 * height as f64 - 2.2,
        k,
        field_of_view_rad: 2.0 * theta,
    })
    .unwrap()
}

fn radius(k: [f64; 4], theta: f64) -> f64 {
    theta + k[0] * theta.powi(3) + k[1] * theta.powi(5) + k[2] * theta.powi(7) + k[3] * theta.powi(9)
}

/// Solid angle of the part of a lens's pixel that is seen and whose world direction `keep` accepts: the
/// integral of `sin(theta) / (r r') dx dy / (fx fy)` by the midpoint rule, without any polygon.
pub(super) fn pixel_solid_angle(
    lens: &Lens,
    pixel: [usize; 2],
    steps: usize,
    keep: impl Fn(DVec3) -> bool,
) -> f64 {
    let p = lens.parameters();
    let mut sum = 0.0;
    for i in 0..steps * steps {
        let at = DVec2::new(
            pixel[0] as f64 + ((i % steps) as f64 + 0.5) / steps as f64,
            pixel[1] as f64 + ((i / steps) as f64 + 0.5) / steps as f64,
        );
        let Some(ray) = lens.unproject(at).filter(|ray| keep(*ray)) else { continue };
        let theta = ray.x.hypot(ray.y).atan2(ray.z);
        let slope = (radius(p.k, theta + 1e-5) - radius(p.k, theta - 1e-5)) / 2e-5;
        sum += if theta > 1e-9 { theta.sin() / (radius(p.k, theta) * slope) } else { 1.0 };
    }
    sum / (p.fx * p.fy * (steps * steps) as f64)
}

/// A 16-bit logarithmic sensor on which `DARK` and `SUN` are whole codes.
pub(super) fn logarithmic() -> Response {
    let b = 60_000.0 / f64::from(SUN / DARK).ln();
    let a = 1000.0 - b * f64::from(DARK).ln();
    Response::new(ResponseModel::Logarithmic { a, b, black_clip_code: 0, saturation_code: 65_535 }).unwrap()
}

pub(super) fn frame(width: usize, height: usize, channels: usize, pixels: Pixels) -> Frame {
    let stamp = Stamp { sequence: 5, capture_time_ns: 7, lost_before: 1, frame_rate_hz: 25.0 };
    Frame { stamp, width, height, channels, pixels }
}

pub(super) fn raw(width: usize, height: usize, response: &Response, radiance: f32) -> Frame {
    frame(width, height, 1, Pixels::Codes(vec![response.encode(radiance); width * height]))
}

pub(super) fn set(frame: &mut Frame, pixel: [usize; 2], response: &Response, radiance: f32) {
    let index = pixel[1] * frame.width + pixel[0];
    match &mut frame.pixels {
        Pixels::Codes(codes) => codes[index] = response.encode(radiance),
        Pixels::Radiance(values) => values[index] = radiance,
    }
}

/// What the exact weights replace: the frame read bilinearly at the centre of every map pixel.
fn bilinear(lens: &Lens, rotation: DMat3, frame: &Frame, response: &Response, map: &mut PolarMap) {
    let Pixels::Codes(codes) = &frame.pixels else { panic!("raw frames only") };
    let camera_from_world = rotation.transpose();
    let radiance = |x: i64, y: i64| {
        let (x, y) = (x.clamp(0, frame.width as i64 - 1), y.clamp(0, frame.height as i64 - 1));
        response.table()[usize::from(codes[y as usize * frame.width + x as usize])]
    };
    for row in 0..map.shape.rows {
        for column in 0..map.shape.columns {
            let ray = camera_from_world * map.shape.pixel_direction(row, column);
            map.pixels[row * map.shape.columns + column] = [lens.project(ray).map_or(0.0, |at| {
                let corner = (at - 0.5).floor();
                let [s, t] = (at - 0.5 - corner).as_vec2().to_array();
                let (x, y) = (corner.x as i64, corner.y as i64);
                let upper = (1.0 - s) * radiance(x, y) + s * radiance(x + 1, y);
                let lower = (1.0 - s) * radiance(x, y + 1) + s * radiance(x + 1, y + 1);
                (1.0 - t) * upper + t * lower
            }); 3];
        }
    }
}

/// Whether a lens sees the whole of a map pixel, by points on its border and inside.
fn sees_whole(lens: &Lens, camera_from_world: DMat3, shape: PolarShape, row: usize, column: usize) -> bool {
    (0..=4).all(|i| {
        (0..=4).all(|j| {
            let theta = shape.theta_max_rad * (row as f64 + f64::from(i) / 4.0) / shape.rows as f64;
            let phi = TAU * (column as f64 + f64::from(j) / 4.0) / shape.columns as f64;
            let ray = camera_from_world * crate::math::direction(theta, phi);
            // A degree from the rim: between the points a border bends out by less.
            let angle = ray.x.hypot(ray.y).atan2(ray.z);
            angle < lens.theta_max_rad() - 0.02
        })
    })
}

struct Worst {
    sun: f64,
    bilinear: f64,
    bilinear_mean: f64,
    constant: f64,
}

/// Random suns of two pixels under random rotations, and constant frames: the worst relative errors.
fn worst_errors(lens: &Lens, shape: PolarShape, rotations: usize, suns: usize, seed: u64) -> Worst {
    let mut random = Random(seed);
    let response = logarithmic();
    let (width, height) = (lens.parameters().width, lens.parameters().height);
    let mut worst = Worst { sun: 0.0, bilinear: 0.0, bilinear_mean: 0.0, constant: 0.0 };
    let mut picture = raw(width, height, &response, DARK);
    let (mut map, mut looked_up) = (PolarMap::black(shape), PolarMap::black(shape));
    let lowest = shape.theta_max_rad.cos();
    let mut seen = 0;
    for turn in 0..rotations {
        // One upright camera among the turned ones.
        let rotation = if turn == 0 && shape.theta_max_rad < PI { LOOKING_UP } else { random.rotation() };
        let mut matrix = FrameToPolar::new(&Projection::Fisheye(*lens), rotation, shape).unwrap();

        matrix.apply(&picture, &response, &mut map).unwrap();
        for row in 0..shape.rows {
            for column in 0..shape.columns {
                if sees_whole(lens, rotation.transpose(), shape, row, column) {
                    let value = map.pixels[row * shape.columns + column][0];
                    worst.constant = worst.constant.max(f64::from(value / DARK - 1.0).abs());
                    seen += 1;
                }
            }
        }

        // The dark room: at most 3 % of the power, so counted points are enough.
        let points = 20_000;
        let room = fibonacci_sphere(points)
            .filter(|ray| ray.y > lowest && lens.project(rotation.transpose() * *ray).is_some())
            .count() as f64
            * 2.0
            * TAU
            / points as f64;
        let mut done = 0;
        while done < suns {
            let x = (random.next() * (width - 1) as f64) as usize;
            let y = (random.next() * (height - 1) as f64) as usize;
            let sun = if random.next() < 0.5 { [[x, y], [x + 1, y]] } else { [[x, y], [x, y + 1]] };
            let whole = |[x, y]: [usize; 2]| {
                [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].into_iter().all(|(i, j)| {
                    lens.unproject(DVec2::new(x as f64 + i, y as f64 + j))
                        .is_some_and(|ray| (rotation * ray).y > lowest + 1e-9)
                })
            };
            // Suns on the rim have their own test.
            if !sun.iter().all(|pixel| whole(*pixel)) {
                continue;
            }
            done += 1;
            let sun_sr: f64 = sun.iter().map(|pixel| pixel_solid_angle(lens, *pixel, 8, |_| true)).sum();
            for pixel in sun {
                set(&mut picture, pixel, &response, SUN);
            }
            let expected = f64::from(SUN) * sun_sr + f64::from(DARK) * (room - sun_sr);
            matrix.apply(&picture, &response, &mut map).unwrap();
            worst.sun = worst.sun.max((map.power()[0] / expected - 1.0).abs());
            bilinear(lens, rotation, &picture, &response, &mut looked_up);
            let error = (looked_up.power()[0] / expected - 1.0).abs();
            worst.bilinear = worst.bilinear.max(error);
            worst.bilinear_mean += error / (rotations * suns) as f64;
            for pixel in sun {
                set(&mut picture, pixel, &response, DARK);
            }
        }
    }
    // A camera that looks down sees little of a hemisphere.
    assert!(seen > rotations * shape.len() / 5, "{seen} map pixels were seen whole");
    worst
}

fn check_energy(width: usize, height: usize, rotations: [usize; 2], suns: usize) {
    let cases = [
        (180.0, PolarShape::hemisphere(360, 90), rotations[0]),
        (220.0, PolarShape::sphere(180, 90), rotations[1]),
    ];
    for (field_of_view_deg, shape, rotations) in cases {
        let lens = lens(width, height, field_of_view_deg);
        let started = std::time::Instant::now();
        let worst = worst_errors(&lens, shape, rotations, suns, 0x9e37_79b9_7f4a_7c15);
        println!(
            "{width} x {height}, {field_of_view_deg} degrees, to {} x {}: {} suns, power error at most {:.1e} \
             (bilinear look-up: mean {:.2}, at most {:.2}); constant frame within {:.1e}; {:.1} s",
            shape.columns,
            shape.rows,
            rotations * suns,
            worst.sun,
            worst.bilinear_mean,
            worst.bilinear,
            worst.constant,
            started.elapsed().as_secs_f64(),
        );
        assert!(worst.sun < 1e-3, "sun {:e}", worst.sun);
        assert!(worst.constant < 1e-3, "constant {:e}", worst.constant);
        assert!(worst.bilinear > 10.0 * worst.sun && worst.bilinear_mean > 0.05, "the look-up is not worse");
    }
}

#[test]
fn sun_and_constant_frame_keep_their_energy_at_640_x_480() {
    check_energy(640, 480, [5, 3], 40);
}

#[test]
fn sun_and_constant_frame_keep_their_energy_at_1024_x_1024() {
    check_energy(1024, 1024, [2, 2], 40);
}

#[test]
fn sun_and_constant_frame_keep_their_energy_at_2880_x_2880() {
    check_energy(2880, 2880, [1, 1], 20);
}

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
    let lowest = shape.theta_max_rad.cos();
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
    // File column u is phi = 2 pi u - pi / 2: +X stands a quarter into the file and at column 0 of the map.
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
    // All of it: every frame of the largest number is a map of it, never infinity.
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
        let message = FrameToPolar::new(&projection, matrix, shape).unwrap_err().to_string();
        assert!(message.contains("not a rotation"), "{message}");
    }
    // Six digits from a file are a rotation.
    let rounded =
        DMat3::from_cols_array(&DMat3::from_rotation_x(0.5).to_cols_array().map(|v| (v * 1e6).round() / 1e6));
    assert!(FrameToPolar::new(&projection, rounded, shape).is_ok());
    let huge = Projection::LatLong { width: 60_000, height: 60_000, centres: LatLongCentres::Half };
    for (projection, shape) in [
        (huge, shape),
        (projection, PolarShape::sphere(0, 5)),
        (projection, PolarShape::sphere(60_000, 60_000)),
        (projection, PolarShape { theta_max_rad: f64::NAN, ..shape }),
        (projection, PolarShape { theta_max_rad: 4.0, ..shape }),
    ] {
        assert!(FrameToPolar::new(&projection, DMat3::IDENTITY, shape).is_err());
    }
}
