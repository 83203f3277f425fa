use super::{Canvas, ToneCurve};
use glam::{DVec3, Vec3};
use lightcast_core::image::PolarMap;
use lightcast_core::light::Light;
use lightcast_core::light::measure::{GROUND_HALF_SIDE, SPHERE_RADIUS};
use lightcast_core::math::zone_solid_angle;
use multiversion::multiversion;

/// Size of one of the two halves in pixels.
const WIDTH: usize = 320;
const HEIGHT: usize = 240;
/// Sub-samples of a pixel along each axis that determine which surfaces it shows.
const COVERAGE_STEPS: usize = 3;
/// Albedos (Lambert).
const SPHERE_ALBEDO: f32 = 0.75;
const GROUND_ALBEDO: f32 = 0.55;
/// Radiance of the backdrop as a fraction of the map's mean radiance.
const BACKDROP: f64 = 0.1;
/// Number of emitters (12 KiB) by which all patches are shaded before the next ones are loaded.
const STRETCH: usize = 512;
/// Emitters summed in parallel.
const LANES: usize = 16;

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
            let (row, column) = (i / map.shape.columns(), i % map.shape.columns());
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

    /// Emitters from `start` to at most `start + STRETCH`.
    fn stretch<'a>(&'a self, start: usize) -> Stretch<'a> {
        let range = start..(start + STRETCH).min(self.xyz[0].len());
        let lanes = |values: &'a Vec<f32>| -> &'a [[f32; LANES]] { values[range.clone()].as_chunks().0 };
        Stretch { xyz: self.xyz.each_ref().map(lanes), rgb: self.rgb.each_ref().map(lanes) }
    }
}

/// Emitters that fit into the first-level cache together with the patches that they light.
struct Stretch<'a> {
    xyz: [&'a [[f32; LANES]]; 3],
    rgb: [&'a [[f32; LANES]]; 3],
}

impl Stretch<'_> {
    /// Sum of irradiance times `weight(x, y, z)`.
    #[inline(always)]
    fn sum(&self, weight: impl Fn(f32, f32, f32) -> f32) -> [f32; 3] {
        let ([x, y, z], [r, g, b]) = (self.xyz, self.rgb);
        let mut sums = [[0.0f32; LANES]; 3];
        for (((x, y), z), ((r, g), b)) in x.iter().zip(y).zip(z).zip(r.iter().zip(g).zip(b)) {
            let mut weights = [0.0; LANES];
            for lane in 0..LANES {
                weights[lane] = weight(x[lane], y[lane], z[lane]);
            }
            for (sum, irradiance) in sums.iter_mut().zip([r, g, b]) {
                for lane in 0..LANES {
                    sum[lane] += weights[lane] * irradiance[lane];
                }
            }
        }
        sums.map(|lanes| lanes.iter().sum())
    }
}

/// A surface that a pixel shows.
#[derive(Clone, Copy)]
enum Surface {
    Sphere { normal: Vec3 },
    Ground { at: Vec3 },
}

/// A surface, the pixel that shows it and the fraction of the pixel that it covers.
struct Patch {
    pixel: usize,
    share: f32,
    surface: Surface,
}

/// Adds the light of a stretch of emitters to the pixels of all patches. On the ground, lights are occluded
/// as in [`lightcast_core::light::measure`].
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
fn add_light(stretch: &Stretch, patches: &[Patch], pixels: &mut [[f32; 3]]) {
    for patch in patches {
        let (irradiance, albedo) = match patch.surface {
            Surface::Sphere { normal: n } => {
                (stretch.sum(|x, y, z| f32::max(x * n.x + y * n.y + z * n.z, 0.0)), SPHERE_ALBEDO)
            }
            Surface::Ground { at } => {
                let tangent_length = (at.x * at.x + at.z * at.z).sqrt();
                let weight = |x: f32, y: f32, z: f32| {
                    let along = SPHERE_RADIUS as f32 * y - at.x * x - at.z * z;
                    if along > tangent_length { 0.0 } else { y }
                };
                (stretch.sum(weight), GROUND_ALBEDO)
            }
        };
        for (value, irradiance) in pixels[patch.pixel].iter_mut().zip(irradiance) {
            *value += irradiance * patch.share * albedo / std::f32::consts::PI;
        }
    }
}

/// What a view ray hits.
enum Hit {
    Sphere { normal: DVec3 },
    Ground { at: DVec3 },
    Backdrop,
}

/// A pinhole camera that looks at the scene from above.
struct Pinhole {
    eye: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
}

impl Pinhole {
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

/// The scene of METHODS section 9 twice: on the left shaded by the lights, on the right by every pixel of the
/// map. Both halves share one tone curve and a dim backdrop of the map's mean colour: the camera sees no sky.
pub fn draw_scene(map: &PolarMap, lights: &[Light]) -> Canvas {
    let power = map.power();
    let extent = zone_solid_angle(0.0, map.shape.theta_max_rad(), 1.0);
    let backdrop = power.map(|power| (BACKDROP * power / extent) as f32);
    let (patches, backdrop_shares) = patches();
    let halves = [Emitters::of_lights(lights), Emitters::of_map(map)].map(|emitters| {
        let mut pixels: Vec<[f32; 3]> =
            backdrop_shares.iter().map(|share| backdrop.map(|value| value * share)).collect();
        for start in (0..emitters.xyz[0].len()).step_by(STRETCH) {
            add_light(&emitters.stretch(start), &patches, &mut pixels);
        }
        pixels
    });
    let tone = ToneCurve::for_pixels(&halves[1]);
    Canvas::from_fn(2 * WIDTH, HEIGHT, |x, y| tone.apply(halves[x / WIDTH][y * WIDTH + x % WIDTH]))
}

/// What the camera sees: patches of surface, and the fraction of each pixel that shows the backdrop. Every
/// surface in a pixel is one patch, at its mean position.
fn patches() -> (Vec<Patch>, Vec<f32>) {
    let camera = Pinhole::new();
    let (mut patches, mut backdrop_shares) = (Vec::new(), Vec::with_capacity(WIDTH * HEIGHT));
    for pixel in 0..WIDTH * HEIGHT {
        let (mut normal, mut normals) = (DVec3::ZERO, 0u8);
        let (mut at, mut ats) = (DVec3::ZERO, 0u8);
        for i in 0..COVERAGE_STEPS * COVERAGE_STEPS {
            let offset = |i: usize| (i as f64 + 0.5) / COVERAGE_STEPS as f64;
            let x = (pixel % WIDTH) as f64 + offset(i % COVERAGE_STEPS);
            let y = (pixel / WIDTH) as f64 + offset(i / COVERAGE_STEPS);
            match camera.trace(x, y) {
                Hit::Sphere { normal: n } => (normal, normals) = (normal + n, normals + 1),
                Hit::Ground { at: p } => (at, ats) = (at + p, ats + 1),
                Hit::Backdrop => {}
            }
        }
        let share = |count: u8| f32::from(count) / (COVERAGE_STEPS * COVERAGE_STEPS) as f32;
        if normals > 0 {
            let normal = normal.normalize_or(DVec3::Y).as_vec3();
            patches.push(Patch { pixel, share: share(normals), surface: Surface::Sphere { normal } });
        }
        if ats > 0 {
            let at = (at / f64::from(ats)).as_vec3();
            patches.push(Patch { pixel, share: share(ats), surface: Surface::Ground { at } });
        }
        backdrop_shares.push(1.0 - share(normals + ats));
    }
    (patches, backdrop_shares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::image::PolarShape;

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
        let shade = |surface| {
            let mut pixel = [[0.0; 3]];
            add_light(&emitters.stretch(0), &[Patch { pixel: 0, share: 1.0, surface }], &mut pixel);
            pixel[0]
        };
        assert_eq!(shade(Surface::Ground { at: Vec3::new(0.67, 0.0, 0.0) }), [0.0; 3]);
        let lit = shade(Surface::Ground { at: Vec3::new(-0.67, 0.0, 0.0) });
        assert!((lit[0] - 0.6 * GROUND_ALBEDO / std::f32::consts::PI).abs() < 1e-6);
        assert_eq!(shade(Surface::Sphere { normal: Vec3::X }), [0.0; 3]);
    }
}
