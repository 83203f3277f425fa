//! Hard maps: power, direction, NaN and infinity.

use super::super::plain_paper;
use super::{Bound, Case, Row, row};
use crate::error::Result;
use glam::DVec3;
use lightcast_core::image::{PolarMap, PolarShape, luminance_f64};
use lightcast_core::light::{Extractor, Light, LightList, Options};
use lightcast_core::math::{angle_between, direction};
use lightcast_core::sampling::sample_points;
use std::f64::consts::TAU;

const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);
const COUNT: usize = 64;
const DARK: [f32; 3] = [1e-3, 2e-3, 4e-3];
const SUN: [f32; 3] = [1e6, 9e5, 8e5];
/// Irradiances are stored in f32, as radiances are.
const POWER: Bound = Bound::Relative(1e-6);
const NONE: Bound = Bound::Absolute(0.0);

/// Our lights and the naive lights of a map.
fn both(map: &PolarMap) -> Result<[Vec<Light>; 2]> {
    let options = Options { count: COUNT, ..Options::default() };
    let mut list = LightList::default();
    Extractor::new(map.shape, &options)?.extract(map, &mut list);
    let plain = plain_paper::lights(map, &sample_points(COUNT, options.relaxation_steps));
    Ok([list.lights, plain])
}

/// Luminous power of lights.
pub(super) fn power(lights: &[Light]) -> f64 {
    lights.iter().map(|light| luminance_f64(light.irradiance.map(f64::from))).sum()
}

/// Luminous power of a map and its first moment, pixel by pixel in f64.
pub(super) fn reference(map: &PolarMap) -> (f64, DVec3) {
    let shape = map.shape;
    let theta_rad = |row: f64| shape.theta_max_rad() * row / shape.rows() as f64;
    let (mut power, mut moment) = (0.0, DVec3::ZERO);
    for (index, pixel) in map.pixels.iter().enumerate() {
        let (row, column) = ((index / shape.columns()) as f64, (index % shape.columns()) as f64);
        let step = TAU / shape.columns() as f64;
        let solid_angle = (theta_rad(row).cos() - theta_rad(row + 1.0).cos()) * step;
        let flux = luminance_f64(pixel.map(f64::from)) * solid_angle;
        power += flux;
        moment += direction(theta_rad(row + 0.5), (column + 0.5) * step) * flux;
    }
    (power, moment)
}

/// Sum of the lights' luminous irradiances as vectors.
fn vector(lights: &[Light]) -> DVec3 {
    let of = |light: &Light| {
        DVec3::from(light.direction.map(f64::from)) * luminance_f64(light.irradiance.map(f64::from))
    };
    lights.iter().map(of).sum()
}

fn count_of_no_numbers(lights: &[Light]) -> f64 {
    let numbers = lights.iter().flat_map(|light| light.direction.into_iter().chain(light.irradiance));
    numbers.filter(|number| !number.is_finite()).count() as f64
}

fn without_numbers(case: &'static str, input: &'static str, map: &PolarMap) -> Result<Row> {
    let [ours, plain] = both(map)?.map(|lights| count_of_no_numbers(&lights));
    Ok(row([case, input, "NaN or infinity in 64 lights"], plain, ours, 0.0, NONE))
}

fn of_power(case: &'static str, input: &'static str, map: &PolarMap) -> Result<Row> {
    let [ours, plain] = both(map)?.map(|lights| power(&lights));
    Ok(row([case, input, "luminous power of the lights"], plain, ours, reference(map).0, POWER))
}

/// Angle between the mean directions of the lights and of the map. Half a pixel is 0.5 degrees.
fn of_direction(case: &'static str, input: &'static str, map: &PolarMap) -> Result<Row> {
    let truth = reference(map).1;
    let [ours, plain] = both(map)?.map(|lights| angle_between(vector(&lights), truth).to_degrees());
    let names = [case, input, "mean direction, degrees from the true"];
    Ok(row(names, plain, ours, 0.0, Bound::Absolute(1e-3)))
}

fn with_sun(spots: &[(usize, usize)]) -> PolarMap {
    PolarMap::from_fn(SHAPE, |row, column| if spots.contains(&(row, column)) { SUN } else { DARK })
}

/// A map of 8192 x 2048 pixels of 1 with one of 1e8: its power in closed form.
fn large() -> Row {
    let shape = PolarShape::hemisphere(8192, 2048);
    let (sun_row, sun_column) = (1100, 4);
    let map =
        PolarMap::from_fn(
            shape,
            |row, column| {
                if (row, column) == (sun_row, sun_column) { [1e8; 3] } else { [1.0; 3] }
            },
        );
    let solid_angle = (shape.theta_edge_rad(sun_row).cos() - shape.theta_edge_rad(sun_row + 1).cos()) * TAU
        / shape.columns() as f64;
    row(
        [
            "power summed in f32 against f64",
            "8192 x 2048 pixels of 1, one of 1e8",
            "luminous power of the map",
        ],
        f64::from(plain_paper::power(&map)),
        luminance_f64(map.power()),
        TAU + (1e8 - 1.0) * solid_angle,
        Bound::Relative(1e-9),
    )
}

/// A pixel of 1e8 on a background of `dark`.
fn bright_pixel(dark: f32) -> PolarMap {
    PolarMap::from_fn(SHAPE, |row, column| [if (row, column) == (40, 200) { 1e8 } else { dark }; 3])
}

/// A map in which every other row is dark.
fn striped() -> Result<Vec<Row>> {
    let map = PolarMap::from_fn(SHAPE, |row, _| [(row % 2) as f32; 3]);
    let (case, input) = ("rows of zeros", "every other row is dark");
    Ok(vec![without_numbers(case, input, &map)?, of_power(case, input, &map)?])
}

fn bright() -> Result<Vec<Row>> {
    let case = "one pixel of 1e8";
    Ok(vec![
        of_power(case, "over 360 x 90 pixels of 0.001", &bright_pixel(1e-3))?,
        without_numbers(case, "over 360 x 90 pixels of 0", &bright_pixel(0.0))?,
    ])
}

fn suns() -> Result<Vec<Row>> {
    Ok(vec![
        of_direction("sun on the pole", "one pixel of 1e6 in the first row", &with_sun(&[(0, 70)]))?,
        of_direction("sun on phi = 0", "pixels of 1e6 on both sides", &with_sun(&[(40, 0), (40, 359)]))?,
        of_direction("sun on the rim", "one pixel of 1e6 in the last row", &with_sun(&[(89, 110)]))?,
        of_direction(
            "sun between two rows",
            "two pixels of 1e6, one above the other",
            &with_sun(&[(39, 110), (40, 110)]),
        )?,
    ])
}

fn even() -> Result<Vec<Row>> {
    let map = PolarMap::from_fn(SHAPE, |_, _| [1.0, 2.0, 0.5]);
    Ok(vec![of_power("constant map", "360 x 90 pixels of (1, 2, 0.5)", &map)?])
}

fn one_pixel() -> Result<Vec<Row>> {
    let map = PolarMap::from_fn(PolarShape::hemisphere(1, 1), |_, _| [3.0, 2.0, 1.0]);
    Ok(vec![of_power("1 x 1 map", "one pixel for the hemisphere", &map)?])
}

fn black() -> Result<Vec<Row>> {
    Ok(vec![without_numbers("all-black map", "360 x 90 pixels of 0", &PolarMap::black(SHAPE))?])
}

pub(super) const CASES: [Case; 7] = [black, bright, suns, even, striped, one_pixel, || Ok(vec![large()])];
