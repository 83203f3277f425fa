//! The scene of the benchmarks: a lens, a response, and surroundings that change a little from frame to
//! frame.

use glam::{DVec2, DVec3};
use lightcast_core::camera::{Lens, LensParameters, Response, ResponseModel};
use lightcast_core::image::{Frame, Pixels, PolarMap, PolarShape, Stamp};
use lightcast_core::math::{angle_between, direction, polar};
use std::f64::consts::{FRAC_PI_2, PI};

/// A 180 degree lens whose circle fills the shorter side.
pub fn lens(width: usize, height: usize) -> Lens {
    let f = 0.5 * width.min(height) as f64 / FRAC_PI_2;
    Lens::new(LensParameters {
        width,
        height,
        fx: f,
        fy: f,
        cx: 0.5 * width as f64 + 0.3,
        cy: 0.5 * height as f64 - 0.2,
        k: [0.0; 4],
        field_of_view_rad: PI,
    })
    .expect("the lens is sound")
}

/// A 12-bit logarithmic sensor.
pub fn response() -> Response {
    let model =
        ResponseModel::Logarithmic { a: 1500.0, b: 216.0, black_clip_code: 10, saturation_code: 4095 };
    Response::new(model).expect("the response is sound")
}

/// Stamp of frame `time` at 25 Hz.
pub fn stamp(time: u64) -> Stamp {
    Stamp { sequence: time, capture_time_ns: time as i64 * 40_000_000, lost_before: 0, frame_rate_hz: 25.0 }
}

/// Radiance from a direction in frame `time`: a sky, a sun that moves by a tenth of a degree, flickering
/// lamps.
fn radiance(towards: DVec3, time: u64) -> [f32; 3] {
    let (theta, phi) = polar(towards);
    let near = |theta: f64, phi: f64, radius: f64| angle_between(towards, direction(theta, phi)) < radius;
    if near(0.7, 1.9 + 0.0017 * time as f64, 0.009) {
        return [6e4, 5e4, 4e4];
    }
    if near(1.1, 5.0, 0.05) || near(0.8, 0.3, 0.03) || near(0.3, 3.8, 0.03) {
        let flicker = 1.0 + 0.3 * (time as f32).sin();
        return [90.0 * flicker, 60.0 * flicker, 30.0 * flicker];
    }
    let sky = 0.3 + 0.3 * theta as f32 + 0.2 * ((phi * 4.0).sin() * (theta * 6.0).cos()) as f32;
    [0.6 * sky, 0.8 * sky, sky]
}

/// The surroundings as a polar map.
pub fn map(shape: PolarShape) -> PolarMap {
    PolarMap::from_fn(shape, |row, column| radiance(shape.pixel_direction(row, column), 0))
}

/// The surroundings as one-channel codes behind a lens that looks up; black outside of its circle.
pub fn raw_frame(lens: &Lens, response: &Response, time: u64) -> Frame {
    let (width, height) = (lens.parameters().width, lens.parameters().height);
    let codes = (0..width * height).map(|index| {
        let centre = DVec2::new((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
        let value = lens.unproject(centre).map_or(0.0, |towards| {
            let [r, g, b] = radiance(DVec3::new(towards.x, towards.z, -towards.y), time);
            (r + g + b) / 3.0
        });
        response.encode(value)
    });
    Frame {
        stamp: stamp(time),
        width,
        height,
        channels: 1,
        bayer: None,
        saturation: f32::INFINITY,
        pixels: Pixels::Codes(codes.collect()),
    }
}
