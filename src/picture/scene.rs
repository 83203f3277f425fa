use super::{Canvas, ToneCurve};
use crate::image::PolarMap;
use crate::light::Light;
use crate::light::measure::{GROUND_HALF_SIDE, SPHERE_RADIUS};
use crate::math::zone_solid_angle;
use glam::{DVec3, Vec3};

/// Size of one of the two halves in pixels.
const WIDTH: usize = 320;
const HEIGHT: usize = 240;
/// Sub-samples of a pixel along each axis that decide which surfaces it shows.
const COVERAGE_STEPS: usize = 3;
/// Albedos (Lambert).
const SPHERE_ALBEDO: f32 = 0.75;
const GROUND_ALBEDO: f32 = 0.55;
/// Radiance of the backdrop in parts of the map's mean radiance.
const BACKDROP: f64 = 0.1;
/// Emitters summed side by side.
const LANES: usize = 8;

/// Directional lights of RGB irradiance above the horizon, one array per coordinate.
struct Emitters {
    xyz: [Vec<f32>; 3],
    rgb: [Vec<f32>; 3],
}

impl Emitters {
    fn new(emitters: impl Iterator<Item = (Vec3, [f32; 3])>) -> Self {
        let mut all = Self { xyz: Default::default(), rgb: Default::default() };
        // The ground hides what is below the horizon from everything that stands on it.
        for (direction, irradiance) in emitters.filter(|(direction, _)| direction.y > 0.0) {
            all.push(direction, irradiance);
        }
        while !all.xyz[0].len().is_multiple_of(LANES) {
            all.push(Vec3::Y, [0.0; 3]);
        }
        all
    }

    fn of_map(map: &PolarMap) -> Self {
        let pixels = map.pixels.iter().enumerate().map(|(i, pixel)| {
            let (row, column) = (i / map.shape.columns, i % map.shape.columns);
            let solid_angle = map.shape.pixel_solid_angle(row) as f32;
            (map.shape.pixel_direction(row, column).as_vec3(), pixel.map(|radiance| radiance * solid_angle))
        });
        Self::new(pixels)
    }

    fn of_lights(lights: &[Light]) -> Self {
        Self::new(lights.iter().map(|light| (light.direction.into(), light.irradiance)))
    }

    fn push(&mut self, direction: Vec3, irradiance: [f32; 3]) {
        for axis in 0..3 {
            self.xyz[axis].push(direction[axis]);
            self.rgb[axis].push(irradiance[axis]);
        }
    }

    /// Sum of irradiance times `weight(x, y, z)`.
    #[inline(always)]
    fn sum(&self, weight: impl Fn(f32, f32, f32) -> f32) -> [f32; 3] {
        let [x, y, z] = &self.xyz;
        let [r, g, b] = &self.rgb;
        let mut sums = [[0.0f32; LANES]; 3];
        for start in (0..x.len()).step_by(LANES) {
            let lanes = start..start + LANES;
            let (x, y, z) = (&x[lanes.clone()], &y[lanes.clone()], &z[lanes.clone()]);
            let (r, g, b) = (&r[lanes.clone()], &g[lanes.clone()], &b[lanes]);
            for lane in 0..LANES {
                let weight = weight(x[lane], y[lane], z[lane]);
                sums[0][lane] += weight * r[lane];
                sums[1][lane] += weight * g[lane];
                sums[2][lane] += weight * b[lane];
            }
        }
        sums.map(|lanes| lanes.iter().sum())
    }

    /// Radiance of the sphere where its normal is `n`.
    fn sphere(&self, n: Vec3) -> [f32; 3] {
        let irradiance = self.sum(|x, y, z| (x * n.x + y * n.y + z * n.z).max(0.0));
        irradiance.map(|e| e * SPHERE_ALBEDO / std::f32::consts::PI)
    }

    /// Radiance of the ground at (x, 0, z); a light is hidden as in [`crate::light::measure`].
    fn ground(&self, at: Vec3) -> [f32; 3] {
        let tangent_length = at.x.hypot(at.z);
        let irradiance = self.sum(|x, y, z| {
            let along = SPHERE_RADIUS as f32 * y - at.x * x - at.z * z;
            if along > tangent_length { 0.0 } else { y }
        });
        irradiance.map(|e| e * GROUND_ALBEDO / std::f32::consts::PI)
    }
}

/// What a view ray meets.
enum Hit {
    Sphere { normal: DVec3 },
    Ground { at: DVec3 },
    Backdrop,
}

/// A pinhole camera that looks at the scene from above.
struct Camera {
    eye: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
}

impl Camera {
    fn new() -> Self {
        let eye = DVec3::new(0.0, 2.0, 3.6);
        let forward = (DVec3::new(0.0, 0.22, 0.0) - eye).normalize_or(DVec3::NEG_Z);
        let right = forward.cross(DVec3::Y).normalize_or(DVec3::X);
        Self { eye, right, up: right.cross(forward), forward }
    }

    /// The surface seen at a picture position in pixels.
    fn trace(&self, x: f64, y: f64) -> Hit {
        let half_height_tan = 0.34;
        let right = (2.0 * x - WIDTH as f64) / HEIGHT as f64 * half_height_tan;
        let up = (1.0 - 2.0 * y / HEIGHT as f64) * half_height_tan;
        let ray = (self.forward + right * self.right + up * self.up).normalize_or(self.forward);
        let to_centre = DVec3::new(0.0, SPHERE_RADIUS, 0.0) - self.eye;
        let along = to_centre.dot(ray);
        let discriminant = along * along - to_centre.length_squared() + SPHERE_RADIUS * SPHERE_RADIUS;
        if discriminant > 0.0 {
            let normal = (ray * (along - discriminant.sqrt()) - to_centre) / SPHERE_RADIUS;
            return Hit::Sphere { normal };
        }
        let at = self.eye - ray * (self.eye.y / ray.y);
        let inside = ray.y < 0.0 && at.x.abs() < GROUND_HALF_SIDE && at.z.abs() < GROUND_HALF_SIDE;
        if inside { Hit::Ground { at } } else { Hit::Backdrop }
    }
}

/// The scene of METHODS section 9 twice: on the left shaded by the lights, on the right by every pixel of the map.
/// Both halves share one tone curve and a dim backdrop of the map's mean colour: the camera sees no sky.
pub fn draw_scene(map: &PolarMap, lights: &[Light]) -> Canvas {
    let camera = Camera::new();
    let power = map.power();
    let extent = zone_solid_angle(0.0, map.shape.theta_max_rad, 1.0);
    let backdrop = power.map(|power| (BACKDROP * power / extent) as f32);
    let halves = [Emitters::of_lights(lights), Emitters::of_map(map)].map(|emitters| {
        let pixels = (0..WIDTH * HEIGHT).map(|i| shade(&camera, &emitters, backdrop, i % WIDTH, i / WIDTH));
        pixels.collect::<Vec<[f32; 3]>>()
    });
    let tone = ToneCurve::for_pixels(&halves[1]);
    Canvas::from_fn(2 * WIDTH, HEIGHT, |x, y| tone.apply(halves[x / WIDTH][y * WIDTH + x % WIDTH]))
}

/// Radiance of one pixel: every surface that it shows is shaded once, at its mean position, and counts by its share.
fn shade(camera: &Camera, emitters: &Emitters, backdrop: [f32; 3], x: usize, y: usize) -> [f32; 3] {
    let (mut normal, mut normals) = (DVec3::ZERO, 0);
    let (mut at, mut ats) = (DVec3::ZERO, 0);
    for i in 0..COVERAGE_STEPS * COVERAGE_STEPS {
        let offset = |i: usize| (i as f64 + 0.5) / COVERAGE_STEPS as f64;
        match camera.trace(x as f64 + offset(i % COVERAGE_STEPS), y as f64 + offset(i / COVERAGE_STEPS)) {
            Hit::Sphere { normal: n } => (normal, normals) = (normal + n, normals + 1),
            Hit::Ground { at: p } => (at, ats) = (at + p, ats + 1),
            Hit::Backdrop => {}
        }
    }
    let share = 1.0 / (COVERAGE_STEPS * COVERAGE_STEPS) as f32;
    let mut pixel = backdrop.map(|value| value * (1.0 - (normals + ats) as f32 * share));
    let mut add = |radiance: [f32; 3], count: i32| {
        (0..3).for_each(|channel| pixel[channel] += radiance[channel] * count as f32 * share);
    };
    if normals > 0 {
        add(emitters.sphere(normal.normalize_or(DVec3::Y).as_vec3()), normals);
    }
    if ats > 0 {
        add(emitters.ground((at / f64::from(ats)).as_vec3()), ats);
    }
    pixel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::PolarShape;

    #[test]
    fn a_light_for_every_pixel_gives_the_same_picture_as_the_map() {
        let shape = PolarShape::hemisphere(24, 6);
        let map = PolarMap::from_fn(shape, |row, column| [1.0 + row as f32, 2.0, 1.0 + (column % 7) as f32]);
        let lights: Vec<Light> = (0..shape.len())
            .map(|i| Light {
                id: i as u32,
                direction: shape.pixel_direction(i / 24, i % 24).as_vec3().to_array(),
                irradiance: map.pixels[i].map(|value| value * shape.pixel_solid_angle(i / 24) as f32),
                spread_rad: 0.0,
            })
            .collect();
        let canvas = draw_scene(&map, &lights);
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                let (left, right) = (canvas.pixel(x, y), canvas.pixel(x + WIDTH, y));
                assert!(left.iter().zip(right).all(|(a, b)| a.abs_diff(b) <= 1), "{x} {y}");
            }
        }
    }

    #[test]
    fn the_sun_from_the_left_throws_its_shadow_to_the_right() {
        let sun = Light {
            id: 0,
            direction: Vec3::new(-0.8, 0.6, 0.0).to_array(),
            irradiance: [1.0; 3],
            spread_rad: 0.0,
        };
        let emitters = Emitters::of_lights(&[sun]);
        assert_eq!(emitters.ground(Vec3::new(0.67, 0.0, 0.0)), [0.0; 3]);
        let lit = emitters.ground(Vec3::new(-0.67, 0.0, 0.0));
        assert!((lit[0] - 0.6 * GROUND_ALBEDO / std::f32::consts::PI).abs() < 1e-6);
        assert_eq!(emitters.sphere(Vec3::X), [0.0; 3]);
    }
}
