//! How far a list of lights is from its map: the slow, plain measures of METHODS section 9.
//!
//! Both sides of a comparison are [`Emitters`], directional lights of luminous irradiance: every map pixel is
//! one, at the pixel's centre. All sums are f64. The cheap estimate for every frame is in [`super::error`].

mod soft;

pub use soft::soft_ground_cells;

use super::Light;
use crate::image::PolarMap;
use crate::math::fibonacci_sphere;
use glam::DVec3;

/// Normals over which irradiance and glossy errors are taken.
const NORMAL_COUNT: usize = 300;
/// Exponent of the glossy lobe.
const GLOSSY_EXPONENT: i32 = 20;
/// Half the side of the square of ground around the sphere.
pub const GROUND_HALF_SIDE: f64 = 1.5;
/// Radius of the sphere that rests on the ground at the origin.
pub const SPHERE_RADIUS: f64 = 0.5;
/// Emitters handled side by side, so that the compiler can use vector registers in sums whose order it must
/// keep.
const LANES: usize = 8;

/// Directional lights of luminous irradiance, one array per coordinate.
#[derive(Clone, Debug, Default)]
pub struct Emitters {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    irradiance: Vec<f64>,
}

impl Emitters {
    /// One emitter per map pixel.
    pub fn from_map(map: &PolarMap) -> Self {
        let mut emitters = Self::default();
        for row in 0..map.shape.rows() {
            let solid_angle = map.shape.pixel_solid_angle(row);
            for column in 0..map.shape.columns() {
                let luminance = f64::from(map.luminance(row, column));
                emitters.push(map.shape.pixel_direction(row, column), luminance * solid_angle);
            }
        }
        emitters.pad()
    }

    /// One emitter per light.
    pub fn from_lights(lights: &[Light]) -> Self {
        let mut emitters = Self::default();
        for light in lights {
            let [x, y, z] = light.direction.map(f64::from);
            emitters.push(DVec3::new(x, y, z), f64::from(light.luminance()));
        }
        emitters.pad()
    }

    fn push(&mut self, direction: DVec3, irradiance: f64) {
        self.x.push(direction.x);
        self.y.push(direction.y);
        self.z.push(direction.z);
        self.irradiance.push(irradiance);
    }

    /// Pads to whole groups of lanes with emitters without power.
    fn pad(mut self) -> Self {
        while !self.x.len().is_multiple_of(LANES) {
            self.push(DVec3::Y, 0.0);
        }
        self
    }

    /// Sum over emitters of `irradiance * weight(direction)`, in f64 lanes.
    #[inline(always)]
    fn sum(&self, weight: impl Fn(f64, f64, f64) -> f64) -> f64 {
        let mut lanes = [0.0; LANES];
        let groups = (self.x.chunks_exact(LANES).zip(self.y.chunks_exact(LANES)))
            .zip(self.z.chunks_exact(LANES).zip(self.irradiance.chunks_exact(LANES)));
        for ((x, y), (z, irradiance)) in groups {
            for lane in 0..LANES {
                lanes[lane] += irradiance[lane] * weight(x[lane], y[lane], z[lane]);
            }
        }
        lanes.iter().sum()
    }

    /// Irradiance on a surface with unit normal `n`.
    pub fn irradiance(&self, n: DVec3) -> f64 {
        self.sum(|x, y, z| (x * n.x + y * n.y + z * n.z).max(0.0))
    }

    /// Response of the normalised lobe `(e + 1) / 2 pi cos^e` about unit direction `n`, e = 20.
    pub fn glossy(&self, n: DVec3) -> f64 {
        let norm = f64::from(GLOSSY_EXPONENT + 1) / std::f64::consts::TAU;
        norm * self.sum(|x, y, z| (x * n.x + y * n.y + z * n.z).max(0.0).powi(GLOSSY_EXPONENT))
    }

    /// Irradiance at a point (x, 0, z) of the ground (normal +Y) beside a sphere of radius 0.5 that rests on
    /// it at the origin; a light whose ray meets the sphere is hidden.
    fn ground_irradiance(&self, point_x: f64, point_z: f64) -> f64 {
        // A ray from p along d meets the sphere where d.(c - p) > sqrt(|c - p|^2 - r^2), and |c - p|^2 - r^2
        // is the squared distance of p from the contact point because the sphere touches the ground.
        let tangent_length = point_x.hypot(point_z);
        self.sum(|x, y, z| {
            let along = SPHERE_RADIUS * y - point_x * x - point_z * z;
            if along > tangent_length { 0.0 } else { y.max(0.0) }
        })
    }

    /// [`Self::irradiance`] at `count` spherical-Fibonacci normals.
    pub fn irradiances(&self, count: usize) -> Vec<f64> {
        fibonacci_sphere(count).map(|n| self.irradiance(n)).collect()
    }

    /// Ground irradiance averaged over each of `cells` x `cells` square cells of [-1.5, 1.5]^2, by `points` x
    /// `points` points a cell (after Gibson and Murta 2000).
    pub fn ground_cells(&self, cells: usize, points: usize) -> Vec<f64> {
        ground_points(cells, points, |x, z| self.ground_irradiance(x, z))
    }
}

/// Means of `value` over each of `cells` x `cells` square cells of the ground, taken at `points` x `points`
/// points (x, z) of a cell.
fn ground_points(cells: usize, points: usize, value: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let steps = cells * points;
    let coordinate = |i: usize| GROUND_HALF_SIDE * ((2 * i + 1) as f64 / steps as f64 - 1.0);
    let mut means = vec![0.0; cells * cells];
    for j in 0..steps {
        for i in 0..steps {
            means[(j / points) * cells + i / points] += value(coordinate(i), coordinate(j));
        }
    }
    let points_per_cell = (points * points) as f64;
    means.iter_mut().for_each(|mean| *mean /= points_per_cell);
    means
}

/// RMS of `values - reference` relative to the mean of `reference`; 0 where both are dark throughout.
pub fn relative_rms(values: &[f64], reference: &[f64]) -> f64 {
    let count = reference.len() as f64;
    let squares: f64 = values.iter().zip(reference).map(|(v, r)| (v - r).powi(2)).sum();
    let mean = reference.iter().sum::<f64>() / count;
    if squares == 0.0 { 0.0 } else { (squares / count).sqrt() / mean }
}

/// Irradiance, shadow and glossy error of lights against their map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Over 300 normals.
    pub irradiance: f64,
    /// Over 20 x 20 cells of ground beside a sphere.
    pub shadow: f64,
    /// Over 300 directions with a cos^20 lobe.
    pub glossy: f64,
}

/// The values of a map at the points where errors are measured: computed once, for comparison with many
/// lists.
pub struct Reference {
    irradiance: Vec<f64>,
    shadow: Vec<f64>,
    glossy: Vec<f64>,
}

impl Reference {
    /// Evaluates the map; about half a second for 32,400 pixels.
    pub fn new(map: &PolarMap) -> Self {
        Self::of(&Emitters::from_map(map))
    }

    fn of(emitters: &Emitters) -> Self {
        Self {
            irradiance: emitters.irradiances(NORMAL_COUNT),
            shadow: emitters.ground_cells(20, 4),
            glossy: fibonacci_sphere(NORMAL_COUNT).map(|n| emitters.glossy(n)).collect(),
        }
    }

    /// The three errors of a list of lights.
    pub fn errors(&self, lights: &[Light]) -> Errors {
        let values = Self::of(&Emitters::from_lights(lights));
        Errors {
            irradiance: relative_rms(&values.irradiance, &self.irradiance),
            shadow: relative_rms(&values.shadow, &self.shadow),
            glossy: relative_rms(&values.glossy, &self.glossy),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::PolarShape;
    use std::f64::consts::PI;

    fn overhead() -> Emitters {
        let light = Light { id: 0, direction: [0.0, 1.0, 0.0], irradiance: [2.0; 3], spread_rad: 0.0 };
        Emitters::from_lights(&[light])
    }

    #[test]
    fn constant_sphere_has_closed_forms() {
        let map = PolarMap::from_fn(PolarShape::sphere(720, 360), |_, _| [1.0; 3]);
        let emitters = Emitters::from_map(&map);
        for normal in fibonacci_sphere(7) {
            assert!((emitters.irradiance(normal) / PI - 1.0).abs() < 1e-4);
            assert!((emitters.glossy(normal) - 1.0).abs() < 1e-4);
        }
        // Far from the sphere the ground sees almost the whole sky; at the contact point it sees none of it.
        assert!((emitters.ground_irradiance(1e4, 0.0) / PI - 1.0).abs() < 1e-4);
        assert!(emitters.ground_irradiance(0.0, 0.0) < 1e-9);
        // Form factor of a sphere of radius r whose centre is at height h = r and distance d: r^2 h / d^3.
        let blocked = 1.0 - emitters.ground_irradiance(1.0, 0.0) / PI;
        let distance = 1.25f64.sqrt();
        assert!((blocked - 0.125 / distance.powi(3)).abs() < 1e-3, "{blocked}");
    }

    #[test]
    fn light_overhead_throws_a_round_shadow() {
        let emitters = overhead();
        assert_eq!(emitters.ground_irradiance(0.49, 0.0), 0.0);
        assert!((emitters.ground_irradiance(0.51, 0.0) - 2.0).abs() < 1e-6);
        let cells = emitters.ground_cells(20, 4);
        let shadow_area = cells.iter().map(|cell| 1.0 - cell / 2.0).sum::<f64>() * 0.15 * 0.15;
        assert!((shadow_area - PI * 0.25).abs() < 0.01, "{shadow_area}");
    }

    #[test]
    fn errors_of_the_pixels_themselves_are_nothing_and_of_darkness_defined() {
        let shape = PolarShape::hemisphere(12, 4);
        let map = PolarMap::from_fn(shape, |row, column| [(row * 7 + column % 5) as f32; 3]);
        let lights: Vec<Light> = (0..shape.len())
            .map(|i| Light {
                id: i as u32,
                direction: shape.pixel_direction(i / 12, i % 12).as_vec3().to_array(),
                irradiance: map.pixels[i].map(|v| v * shape.pixel_solid_angle(i / 12) as f32),
                spread_rad: 0.0,
            })
            .collect();
        let errors = Reference::new(&map).errors(&lights);
        assert!(errors.irradiance < 1e-6 && errors.shadow < 1e-2 && errors.glossy < 1e-6, "{errors:?}");
        let dark = Reference::new(&PolarMap::black(shape)).errors(&[]);
        assert_eq!((dark.irradiance, dark.shadow, dark.glossy), (0.0, 0.0, 0.0));
    }

    #[test]
    fn relative_rms_is_relative_to_the_mean() {
        assert!((relative_rms(&[1.0, 3.0], &[2.0, 2.0]) - 0.5).abs() < 1e-15);
    }
}
