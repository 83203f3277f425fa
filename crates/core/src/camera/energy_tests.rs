//! Energy and constancy through response, lens and polar map (METHODS section 4), by random suns and
//! rotations.

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
    Frame { stamp, width, height, channels, pixels, ..Frame::default() }
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
    for row in 0..map.shape.rows() {
        for column in 0..map.shape.columns() {
            let ray = camera_from_world * map.shape.pixel_direction(row, column);
            map.pixels[row * map.shape.columns() + column] = [lens.project(ray).map_or(0.0, |at| {
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
            let theta = shape.theta_max_rad() * (row as f64 + f64::from(i) / 4.0) / shape.rows() as f64;
            let phi = TAU * (column as f64 + f64::from(j) / 4.0) / shape.columns() as f64;
            let ray = camera_from_world * crate::math::direction(theta, phi);
            // Keeps a degree away from the rim: between the points a border bulges out by less.
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
    let lowest = shape.theta_max_rad().cos();
    let mut seen = 0;
    for turn in 0..rotations {
        // One upright camera among the turned ones.
        let rotation = if turn == 0 && shape.theta_max_rad() < PI { LOOKING_UP } else { random.rotation() };
        let mut matrix = FrameToPolar::new(&Projection::Fisheye(*lens), rotation, shape).unwrap();

        matrix.apply(&picture, &response, &mut map).unwrap();
        for row in 0..shape.rows() {
            for column in 0..shape.columns() {
                if sees_whole(lens, rotation.transpose(), shape, row, column) {
                    let value = map.pixels[row * shape.columns() + column][0];
                    worst.constant = worst.constant.max(f64::from(value / DARK - 1.0).abs());
                    seen += 1;
                }
            }
        }

        // The dark room has at most 3 % of the power, so counting points is accurate enough.
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
            shape.columns(),
            shape.rows(),
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
