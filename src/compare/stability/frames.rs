//! Hard frames and lenses: from the camera's pixels to the map.

use super::super::plain_paper;
use super::maps::reference;
use super::{Bound, Case, Row, row};
use crate::error::Result;
use crate::files::{decode_exr, encode_exr};
use crate::stage::radiance_within_half;
use glam::{DMat3, DVec2};
use lightcast_core::camera::{FrameToPolar, LOOKING_UP, Lens, LensParameters, Projection, Response};
use lightcast_core::image::{Frame, LatLongCentres, Pixels, PolarMap, PolarShape, luminance_f64};

fn frame(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Frame {
    let values = (0..width * height).map(|index| value(index % width, index / width)).collect();
    Frame { width, height, pixels: Pixels::Radiance(values), ..Frame::default() }
}

/// Size of the panoramas.
const WIDTH: usize = 64;
const HEIGHT: usize = 32;

/// A panorama of ones, except for one sample.
fn ones_but(bad: f32) -> Frame {
    frame(WIDTH, HEIGHT, |x, y| if [x, y] == [40, 10] { bad } else { 1.0 })
}

/// Luminous power of the map to which a panorama is resampled.
fn power_of_map(panorama: &Frame) -> Result<f64> {
    let centres = LatLongCentres::Half;
    let projection = Projection::LatLong { width: WIDTH, height: HEIGHT, centres };
    let mut map = PolarMap::black(PolarShape::sphere(32, 16));
    FrameToPolar::new(&projection, DMat3::IDENTITY, map.shape)?.apply(
        panorama,
        &Response::default(),
        &mut map,
    )?;
    Ok(luminance_f64(map.power()))
}

/// A panorama of one channel as a map of the same pixels, each mapped by `value`.
fn as_map(panorama: &Frame, value: impl Fn(f32) -> f32) -> PolarMap {
    let Pixels::Radiance(values) = &panorama.pixels else { return PolarMap::black(PolarShape::sphere(1, 1)) };
    PolarMap::from_fn(PolarShape::sphere(WIDTH, HEIGHT), |row, column| {
        [value(values[row * WIDTH + column]); 3]
    })
}

fn plain_power(panorama: &Frame) -> f64 {
    f64::from(plain_paper::power(&as_map(panorama, |value| value)))
}

/// Samples that cannot be radiance (NaN, infinite, negative): the light of the others is kept.
fn of_sample(case: &'static str, input: &'static str, panorama: &Frame) -> Result<Row> {
    let lawful = |value: f32| if value.is_finite() && value >= 0.0 { value } else { 0.0 };
    Ok(row(
        [case, input, "luminous power of the map"],
        plain_power(panorama),
        power_of_map(panorama)?,
        reference(&as_map(panorama, lawful)).0,
        Bound::Relative(1e-5),
    ))
}

/// A sample of 1e5, which exceeds the range of half floats, through files of half floats: one that is
/// recorded here, in which it becomes the largest finite value, and one that is written naively, in which it
/// becomes infinity.
fn half_floats() -> Result<[Row; 2]> {
    let case = "half-float overflow";
    let panorama = ones_but(1e5);
    let through_file = |frame: &Frame| -> Result<Frame> {
        let mut back = Frame::default();
        decode_exr(&encode_exr(frame, true)?, &mut back)?;
        Ok(back)
    };
    let mut within = Frame::default();
    radiance_within_half(&panorama, &[], &mut within);
    let (recorded, plain) = (through_file(&within)?, through_file(&panorama)?);
    let recorded = row(
        [case, "one sample of 1e5, recorded as half floats", "luminous power of the map with 65,504 for it"],
        plain_power(&plain),
        power_of_map(&recorded)?,
        reference(&as_map(&panorama, |value| value.min(65_504.0))).0,
        Bound::Relative(1e-5),
    );
    Ok([recorded, of_sample(case, "one sample of 1e5, cast to half floats by others", &plain)?])
}

fn parameters(field_of_view_deg: f64, k: [f64; 4]) -> LensParameters {
    let side = 256.0;
    LensParameters {
        width: 256,
        height: 256,
        fx: 0.24 * side,
        fy: 0.24 * side,
        cx: 0.5 * side,
        cy: 0.5 * side,
        k,
        field_of_view_rad: field_of_view_deg.to_radians(),
    }
}

/// Solid angle of a pixel: `sin(theta) / r` over its area, for a lens with r = theta, by the midpoint rule.
fn pixel_solid_angle(lens: &LensParameters, [x, y]: [usize; 2]) -> f64 {
    const STEPS: usize = 400;
    let mut sum = 0.0;
    for i in 0..STEPS * STEPS {
        let at = |pixel: usize, step: usize| pixel as f64 + (step as f64 + 0.5) / STEPS as f64;
        let offset = DVec2::new(at(x, i % STEPS) - lens.cx, at(y, i / STEPS) - lens.cy) / lens.fx;
        sum += offset.length().sin() / offset.length();
    }
    sum / (lens.fx * lens.fy * (STEPS * STEPS) as f64)
}

/// A small sun 100 degrees from the axis of a lens that sees up to 110 degrees.
fn wide_lens() -> Result<Row> {
    let parameters = parameters(220.0, [0.0; 4]);
    let lens = Lens::new(parameters)?;
    let shape = PolarShape::new(360, 110, 110f64.to_radians())?;
    let sun = [(parameters.cx + 100f64.to_radians() * parameters.fx) as usize, 140];
    let picture = frame(256, 256, |x, y| if [x, y] == sun { 1e6 } else { 0.0 });
    let mut map = PolarMap::black(shape);
    FrameToPolar::new(&Projection::Fisheye(lens), LOOKING_UP, shape)?.apply(
        &picture,
        &Response::default(),
        &mut map,
    )?;
    // The naive method: every pixel of the map is looked up where the lens projects its centre.
    let camera_from_world = LOOKING_UP.transpose();
    let looked_up = PolarMap::from_fn(shape, |row, column| {
        let at = lens.project(camera_from_world * shape.pixel_direction(row, column));
        let is_sun = at.is_some_and(|at| [at.x as usize, at.y as usize] == sun);
        [if is_sun { 1e6 } else { 0.0 }; 3]
    });
    Ok(row(
        ["220 degree lens", "a sun of one pixel, 100 degrees from the axis", "luminous power of the map"],
        f64::from(plain_paper::power(&looked_up)),
        luminance_f64(map.power()),
        1e6 * pixel_solid_angle(&parameters, sun),
        Bound::Relative(1e-3),
    ))
}

/// A lens whose radius decreases again inside its field of view: how much of the field is folded over the
/// rest.
fn folded_lens() -> Row {
    let parameters = parameters(180.0, [-0.3, 0.0, 0.0, 0.0]);
    // In steps of a degree, in f32: r(theta) = theta + k1 theta^3.
    let radius = |degrees: u8| {
        let theta = f32::from(degrees).to_radians();
        theta + parameters.k[0] as f32 * theta.powi(3)
    };
    let folded = (0u8..90).filter(|&degrees| radius(degrees + 1) <= radius(degrees)).count() as f64;
    let accepted = if Lens::new(parameters).is_ok() { folded } else { 0.0 };
    row(
        [
            "lens coefficients that turn",
            "k1 = -0.3, a field of view of 180 degrees",
            "degrees that fold back, in accepted lenses",
        ],
        folded,
        accepted,
        0.0,
        Bound::Absolute(0.0),
    )
}

pub(super) const CASES: [Case; 6] = [
    || Ok(vec![of_sample("NaN in a file", "one sample among 64 x 32 of 1", &ones_but(f32::NAN))?]),
    || Ok(vec![of_sample("infinity in a file", "one sample among 64 x 32 of 1", &ones_but(f32::INFINITY))?]),
    || Ok(vec![of_sample("negative values in a file", "one sample of -1e6", &ones_but(-1e6))?]),
    || Ok(half_floats()?.into()),
    || Ok(vec![folded_lens()]),
    || Ok(vec![wide_lens()?]),
];
