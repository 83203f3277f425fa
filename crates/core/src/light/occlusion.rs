//! The error of a list beside objects that hide part of the light, by which the number of lights is chosen.
//!
//! It compares, for each of the 300 normals of METHODS section 9, the light in front of the plane through the
//! point, which is what a wall leaves of it. The plane's edge is soft by [`EDGE_HALF_WIDTH_RAD`] to either
//! side, like edges that one sees, and lights are as wide as their spread. So an even sky, which casts no
//! shadow edges, needs few lights, while lamps, each with shadows of its own, need about one for each or for
//! a close pair. The error of irradiance ([`super::error`]) cannot tell them apart: it treats lights as
//! directions, and is largest for an even sky, part of which is cut off by every surface's horizon.

use super::Light;
use super::error::{Contribution, LANES, NORMAL_COUNT, NormalSphere, relative_rms, sum_terms};
use glam::{DVec3, Vec3};
use multiversion::multiversion;

/// Half the angle over which a plane's edge goes from dark to light.
const EDGE_HALF_WIDTH_RAD: f32 = 3.0 * std::f32::consts::PI / 180.0;

/// Error of lists; holds only scratch memory.
#[derive(Clone, Debug)]
pub(super) struct OcclusionError {
    normals: NormalSphere,
    extents: Vec<Extent>,
    of_map: Vec<f32>,
    of_lights: Vec<f32>,
}

/// Flux spread evenly over some angle to either side of a direction, across the edge of a plane.
#[derive(Clone, Copy, Debug)]
struct Extent {
    /// The direction, divided by the whole angle.
    steep: [f32; 3],
    flux: f32,
}

impl Extent {
    fn new(direction: Vec3, half_width_rad: f32, flux: f32) -> Self {
        let steep = direction / (2.0 * half_width_rad.hypot(EDGE_HALF_WIDTH_RAD));
        Self { steep: steep.to_array(), flux }
    }

    /// A block of a map, whose vector is shorter than its flux by less than a thousandth.
    fn of_block(block: &Contribution) -> Option<Self> {
        // Squares of the largest and the smallest fluxes are beyond the range of f32.
        let vector = DVec3::from(block.vector.map(f64::from));
        let (direction, flux) = (vector.try_normalize()?, vector.length());
        let half_width_rad = (f64::from(block.half_width) / flux) as f32;
        Some(Self::new(direction.as_vec3(), half_width_rad, flux as f32))
    }

    /// A disc of the light's spread, replaced by the even extent with the disc's variance along one axis,
    /// half that along both.
    fn of_light(light: &Light) -> Option<Self> {
        let flux = light.luminance();
        let half_width_rad = 1.5f32.sqrt() * light.spread_rad;
        (flux > 0.0).then(|| Self::new(Vec3::from(light.direction), half_width_rad, flux))
    }
}

impl OcclusionError {
    pub(super) fn new() -> Self {
        Self { normals: NormalSphere::new(), extents: Vec::new(), of_map: Vec::new(), of_lights: Vec::new() }
    }

    /// RMS over the planes of the flux of the lights in front of them minus that of the blocks of the map,
    /// relative to the mean; 0 where both are dark. Never above `f32::MAX`.
    pub(super) fn relative_error(&mut self, lights: &[Light], blocks: &[Contribution]) -> f32 {
        self.extents.clear();
        self.extents.extend(blocks.iter().filter_map(Extent::of_block));
        sums(&self.normals, &self.extents, &mut self.of_map);
        self.extents.clear();
        self.extents.extend(lights.iter().filter_map(Extent::of_light));
        sums(&self.normals, &self.extents, &mut self.of_lights);
        relative_rms(&self.of_lights, &self.of_map)
    }
}

/// Flux in front of every plane.
fn sums(normals: &NormalSphere, extents: &[Extent], sums: &mut Vec<f32>) {
    sums.clear();
    for [x, y, z] in normals.groups() {
        sums.extend(sum(x, y, z, extents).map(|sum| sum as f32));
    }
    sums.truncate(NORMAL_COUNT);
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
fn sum(x: &[f32; LANES], y: &[f32; LANES], z: &[f32; LANES], extents: &[Extent]) -> [f64; LANES] {
    sum_terms(extents, |&Extent { steep, flux }, lane| {
        let along = x[lane] * steep[0] + y[lane] * steep[1] + z[lane] * steep[2];
        flux * (along + 0.5).clamp(0.0, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{PolarMap, PolarShape};
    use crate::light::{Extractor, LightList, MapIrradiance, Options, measure};
    use crate::math::fibonacci_sphere;
    use crate::test_data::real_maps;

    const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);

    fn light(direction: DVec3, flux: f32, spread_rad: f32) -> Light {
        Light { id: 0, direction: direction.as_vec3().to_array(), irradiance: [flux; 3], spread_rad }
    }

    /// The same in f64, pixel by pixel, light by light.
    fn slow(map: &PolarMap, lights: &[Light]) -> f64 {
        let in_front = |normal: DVec3, direction: DVec3, half_width: f64| {
            let edge = half_width.hypot(f64::from(EDGE_HALF_WIDTH_RAD));
            (normal.dot(direction) / (2.0 * edge) + 0.5).clamp(0.0, 1.0)
        };
        let (mut of_map, mut of_lights) = (Vec::new(), Vec::new());
        for normal in fibonacci_sphere(NORMAL_COUNT) {
            let mut sum = 0.0;
            for row in 0..map.shape.rows() {
                for column in 0..map.shape.columns() {
                    let flux = f64::from(map.luminance(row, column)) * map.shape.pixel_solid_angle(row);
                    sum += flux * in_front(normal, map.shape.pixel_direction(row, column), 0.0);
                }
            }
            of_map.push(sum);
            let of_light = |light: &Light| {
                let half_width = 1.5f64.sqrt() * f64::from(light.spread_rad);
                let direction = DVec3::from(light.direction.map(f64::from));
                f64::from(light.luminance()) * in_front(normal, direction, half_width)
            };
            of_lights.push(lights.iter().map(of_light).sum());
        }
        measure::relative_rms(&of_lights, &of_map)
    }

    fn quick(map: &PolarMap, lights: &[Light]) -> f64 {
        let mut irradiance = MapIrradiance::new(map.shape);
        irradiance.reference(map, &mut Vec::new());
        OcclusionError::new().relative_error(lights, irradiance.blocks()).into()
    }

    #[test]
    fn error_is_that_of_the_slow_sum_over_pixels() {
        let mut worst: f64 = 0.0;
        for (name, map) in real_maps(SHAPE) {
            for count in [8, 64, 256] {
                let options = Options { count, ..Options::default() };
                let mut list = LightList::default();
                let mut extractor = Extractor::new(SHAPE, &options).unwrap();
                for _ in 0..9 {
                    extractor.extract(&map, &mut list);
                }
                let (quick, slow) = (quick(&map, &list.lights), slow(&map, &list.lights));
                println!("{name:32} {count:4} lights: {quick:.5}, pixel by pixel {slow:.5}");
                worst = worst.max((quick - slow).abs() / slow.max(1e-3));
            }
        }
        assert!(worst < 0.1, "{worst}");
    }

    #[test]
    fn a_disc_and_two_lights_on_it_differ_and_a_light_differs_not_from_itself() {
        let towards = crate::math::direction(0.6, 2.0);
        let map = PolarMap::from_fn(SHAPE, |row, column| {
            let is_lamp = SHAPE.pixel_direction(row, column).dot(towards) > 0.1f64.cos();
            [f32::from(u8::from(is_lamp)); 3]
        });
        let flux = map.power()[1] as f32;
        let (disc, edge) = (light(towards, flux, 0.1 / 2f32.sqrt()), light(towards, flux, 0.0));
        let aside = crate::math::direction(0.75, 2.0);
        let errors = [disc, edge, light(aside, flux, 0.07)].map(|light| quick(&map, &[light]));
        // Planes cross the lamp's disc and the even extent that stands for it a little differently.
        assert!(errors[0] < 0.02 && errors[1] > 2.0 * errors[0] && errors[2] > 5.0 * errors[0], "{errors:?}");
        for lights in [&[disc][..], &[edge], &[light(aside, flux, 0.07)]] {
            let (quick, slow) = (quick(&map, lights), slow(&map, lights));
            assert!((quick - slow).abs() < 0.1 * slow + 1e-4, "{quick} {slow}");
        }
    }

    #[test]
    fn darkness_and_the_largest_values_have_a_defined_error() {
        let black = PolarMap::black(SHAPE);
        assert_eq!(quick(&black, &[]), 0.0);
        assert_eq!(quick(&black, &[light(DVec3::Y, 0.0, 0.1)]), 0.0);
        assert!(quick(&black, &[light(DVec3::Y, 1.0, 0.1)]) >= 1.0);
        let even = PolarMap::from_fn(SHAPE, |_, _| [1.0; 3]);
        assert!(quick(&even, &[]) >= 1.0, "no light at all misses everything");
        for value in [f32::MAX, 1e30, 1e-30, 1e-40] {
            let map = PolarMap::from_fn(SHAPE, |_, _| [value; 3]);
            let error = quick(&map, &[light(DVec3::Y, value, 0.1)]);
            assert!(error >= 0.0 && error.is_finite(), "{value:e}: {error}");
        }
        // Errors are relative, however bright it is.
        let error_at = |scale: f32| {
            let map = PolarMap::from_fn(SHAPE, |row, _| [scale * row as f32; 3]);
            quick(&map, &[light(DVec3::Y, scale * 300.0, 0.5)])
        };
        for scale in [1e-30, 1e25] {
            assert!((error_at(scale) / error_at(1.0) - 1.0).abs() < 1e-3, "{scale:e}");
        }
    }
}
