//! Background, exposure and alpha of whole pictures.

use super::background::twin::panorama_at;
use super::{Background, Exposure, Look, Tone};
use crate::gpu::Gpu;
use crate::render::test_scenes::{camera, metal, scene, sky, sphere, sphere_on_ground};
use crate::render::{Options, Renderer};
use crate::scene::{Camera, Material, Scene};
use glam::{UVec2, Vec3};
use lightcast_core::image::{PolarMap, PolarShape};

/// Odd, so that a ray through the middle meets a pole.
const SIZE: [u32; 2] = [65, 49];

fn renderer(scene: Scene) -> Option<Renderer> {
    let options = Options { width_px: SIZE[0], height_px: SIZE[1], ..Options::default() };
    Gpu::for_test().map(|gpu| Renderer::new(gpu, scene, &options).unwrap())
}

fn radiance(renderer: &mut Renderer, look: Look, camera: &Camera, samples: u32) -> Vec<[f32; 4]> {
    renderer.set_look(&look).unwrap();
    renderer.draw(&sky(60), camera, samples).unwrap();
    let mut pixels = Vec::new();
    renderer.read_radiance(&mut pixels).unwrap();
    pixels
}

fn with_background(background: Background) -> Look {
    Look { background, ..Look::default() }
}

#[test]
fn a_panorama_is_seen_along_the_view_rays() {
    let Some(mut renderer) = renderer(Scene::default()) else { return };
    let colours = |row: usize, column: usize| [row as f32, column as f32, ((row * column) % 7) as f32];
    for shape in [PolarShape::sphere(36, 18), PolarShape::hemisphere(40, 10)] {
        let map = PolarMap::from_fn(shape, colours);
        // Views across the seam at +X, towards both poles, and sideways.
        for (target, up) in [
            (Vec3::X, Vec3::Y),
            (Vec3::Y, Vec3::Z),
            (Vec3::NEG_Y, Vec3::Z),
            (Vec3::new(-0.4, 0.1, 0.7), Vec3::Y),
        ] {
            let camera = Camera { eye: Vec3::ZERO, target, up, vertical_fov_rad: 1.2, near: 0.1 };
            let look = with_background(Background::Panorama(map.clone()));
            let pixels = radiance(&mut renderer, look, &camera, 1);
            let seen = renderer.read_back().0;
            for (index, pixel) in (0..).zip(&pixels) {
                let at = UVec2::new(index % SIZE[0], index / SIZE[0]);
                let ray = seen.offset_from_eye(at, 1.0).normalize_or_zero();
                // The ray is computed from the camera, independently of the renderer's matrices.
                let right = camera.view_from_world().transpose();
                let (x, y) = (
                    (2.0 * (at.x as f32 + 0.5) / SIZE[0] as f32 - 1.0) * SIZE[0] as f32 / SIZE[1] as f32,
                    1.0 - 2.0 * (at.y as f32 + 0.5) / SIZE[1] as f32,
                );
                let expected = right * Vec3::new(x * 0.6f32.tan(), y * 0.6f32.tan(), -1.0);
                assert!(ray.abs_diff_eq(expected.normalize_or_zero(), 1e-5), "{at}: {ray} {expected}");
                let near_rim = (ray.y.acos() - shape.theta_max_rad() as f32).abs() < 1e-4;
                let expected = panorama_at(&map, ray);
                let found = Vec3::from_slice(pixel);
                assert!(near_rim || found.abs_diff_eq(expected, 2e-3), "{at} {ray}: {found} {expected}");
                assert_eq!(pixel[3], 1.0);
            }
        }
    }
}

#[test]
fn the_middle_of_a_panoramas_pixel_is_seen_where_the_map_says_it_lies() {
    let shape = PolarShape::sphere(36, 18);
    let map = PolarMap::from_fn(shape, |row, column| [row as f32, column as f32, 1.0]);
    for (row, column) in [(0, 0), (3, 35), (9, 17), (17, 20)] {
        let direction = shape.pixel_direction(row, column).as_vec3();
        let found = panorama_at(&map, direction);
        assert!(found.abs_diff_eq(Vec3::new(row as f32, column as f32, 1.0), 1e-3), "{found}");
    }
}

#[test]
fn a_background_is_seen_where_there_is_no_surface_and_nowhere_else() {
    let Some(mut renderer) = renderer(scene(vec![(sphere(32, 0), true)], vec![metal(0.4)])) else { return };
    let colour = [0.25, 0.5, 2.0];
    for samples in [1, 4] {
        let alone = radiance(&mut renderer, Look::default(), &camera(), samples);
        let before = radiance(&mut renderer, with_background(Background::Colour(colour)), &camera(), samples);
        let shares = [0.0, 1.0].map(|share| alone.iter().filter(|pixel| pixel[3] == share).count());
        assert!(shares[0] > 2000 && shares[1] > 250, "{shares:?}");
        for (alone, before) in alone.iter().zip(&before) {
            for channel in 0..3 {
                let expected = alone[channel] + (1.0 - alone[3]) * colour[channel];
                assert!((before[channel] - expected).abs() < 1e-5, "{alone:?} {before:?}");
            }
            assert!((before[3] - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn a_transparent_picture_laid_over_a_colour_is_the_picture_before_that_colour() {
    let sphere = scene(vec![(sphere(32, 0), true)], vec![Material::lambert([0.7; 3])]);
    let Some(mut renderer) = renderer(sphere) else { return };
    let look = |background| Look { background, exposure: Exposure::Stops(0.0), tone: Tone::None };
    let mut drawn = |background| {
        renderer.set_look(&look(background)).unwrap();
        renderer.draw(&sky(60), &camera(), 4).unwrap();
        let mut pixels = Vec::new();
        renderer.read_picture(0.0, &mut pixels).unwrap();
        pixels
    };
    let grey = 0.4;
    let (transparent, before) = (drawn(Background::Transparent), drawn(Background::Colour([grey; 3])));
    let mut partial = 0;
    for (over, before) in transparent.iter().zip(&before) {
        let alpha = f32::from(over[3]) / 255.0;
        partial += usize::from(over[3] > 0 && over[3] < 255);
        for channel in 0..3 {
            let laid = alpha * f32::from(over[channel]) + (1.0 - alpha) * grey * 255.0;
            // Colour and alpha are each rounded; surfaces brighter than white clip.
            let difference = (laid - f32::from(before[channel])).abs();
            assert!(difference <= 2.0 || over[channel] == 255, "{over:?} {before:?}");
        }
        assert_eq!(before[3], 255);
    }
    assert!(partial > 20, "{partial} pixels at edges");
}

#[test]
fn a_stop_doubles_and_the_exposure_that_is_given_does_not_follow_the_picture() {
    let Some(mut renderer) = renderer(sphere_on_ground(Material::lambert([0.5; 3]))) else { return };
    let mut mean = |stops, lights: u32| {
        let look =
            Look { background: Background::Transparent, exposure: Exposure::Stops(stops), tone: Tone::None };
        renderer.set_look(&look).unwrap();
        renderer.draw(&sky(lights), &camera(), 1).unwrap();
        let mut pixels = Vec::new();
        renderer.read_picture(0.0, &mut pixels).unwrap();
        pixels.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / pixels.len() as f64
    };
    let (dark, bright) = (mean(-3.0, 60), mean(-2.0, 60));
    assert!((bright / dark - 2.0).abs() < 0.05, "{dark} {bright}");
    // Without the lights of the sky the sun alone is darker, and remains so.
    assert!(mean(-2.0, 1) < 0.9 * bright);
}

#[test]
fn looks_that_cannot_be_shown_are_refused() {
    let mut renderer = Renderer::new(Gpu::noop(), Scene::default(), &Options::default()).unwrap();
    for look in [
        Look { exposure: Exposure::Stops(f32::NAN), ..Look::default() },
        Look { exposure: Exposure::Stops(65.0), ..Look::default() },
        with_background(Background::Colour([0.0, -1.0, 0.0])),
        with_background(Background::Colour([f32::INFINITY, 0.0, 0.0])),
        with_background(Background::Panorama(PolarMap::black(PolarShape::sphere(16_384, 1)))),
    ] {
        assert!(renderer.set_look(&look).is_err(), "{:?}", look.exposure);
    }
    renderer.set_look(&with_background(Background::Transparent)).unwrap();
    renderer.draw(&[], &camera(), 1).unwrap();
    renderer.resize(33, 20).unwrap();
    assert!(renderer.is_transparent());
    renderer.gpu().check().unwrap();
}
