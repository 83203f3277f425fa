use super::test_scenes::*;
use super::{DirectionalOptions, Options, Renderer};
use crate::gpu::Gpu;
use crate::scene::{Camera, Material, Scene, Shading};
use glam::{Quat, Vec3};
use lightcast_core::light::Light;

const SMALL: Options = Options {
    width_px: 160,
    height_px: 120,
    directional: DirectionalOptions {
        shadow_maps: 72,
        shadow_map_px: 256,
        count_lights: true,
        ..OPTIONS.directional
    },
    ..OPTIONS
};

fn renderer(scene: Scene, options: &Options) -> Option<Renderer> {
    Gpu::for_test().map(|gpu| Renderer::new(gpu, scene, options).unwrap())
}

/// Radiance of the pixels that are fully covered by a surface.
fn surfaces(renderer: &Renderer) -> Vec<[f32; 4]> {
    let mut pixels = Vec::new();
    renderer.read_radiance(&mut pixels).unwrap();
    assert!(pixels.iter().flatten().all(|v| v.is_finite()));
    pixels.retain(|pixel| pixel[3] == 1.0);
    pixels
}

fn mean_green(pixels: &[[f32; 4]]) -> f64 {
    pixels.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / pixels.len() as f64
}

#[test]
fn a_white_furnace_is_white() {
    for (name, material) in [
        ("Lambert", Material::lambert([1.0; 3])),
        ("metal, smooth", metal(0.0)),
        ("metal, 0.1", metal(0.1)),
        ("metal, 0.25", metal(0.25)),
        ("metal, 0.5", metal(0.5)),
        ("metal, rough", metal(1.0)),
    ] {
        let Some(mut renderer) = renderer(scene(vec![(sphere(48, 0), true)], vec![material]), &SMALL) else {
            return;
        };
        for count in [72, 1000, 2000] {
            renderer.draw(&furnace(count), &camera(), 1).unwrap();
            let mean = mean_green(&surfaces(&renderer));
            println!("{name}, {count} lights: {mean:.4}");
            assert!((mean - 1.0).abs() < 0.05, "{name}, {count} lights: {mean}");
        }
    }
}

#[test]
fn phongs_lobe_reflects_all_at_normal_incidence() {
    let small = Options { width_px: 8, height_px: 8, ..SMALL };
    let above = Camera { eye: Vec3::new(0.0, 20.0, 0.0), up: Vec3::Z, vertical_fov_rad: 0.02, ..camera() };
    for exponent in [0.0, 5.0, 50.0, 500.0] {
        let material = Material::new(Shading::Phong { specular: [1.0; 3], exponent }, [0.0; 3]);
        let Some(mut renderer) = renderer(scene(vec![(ground(8.0, -1.0, 0), false)], vec![material]), &small)
        else {
            return;
        };
        // Rotated lights are different sets of lights: the mean over many sets shows systematic errors, not
        // the positions of lights.
        let mut sum = 0.0;
        for turn in 0..64 {
            let mut lights = furnace(2000);
            let rotation = Quat::from_euler(glam::EulerRot::XYZ, 0.7 * turn as f32, 0.3 * turn as f32, 0.0);
            lights.iter_mut().for_each(|light| {
                light.direction = (rotation * Vec3::from(light.direction)).normalize_or_zero().to_array();
            });
            renderer.draw(&lights, &above, 1).unwrap();
            sum += mean_green(&surfaces(&renderer)) / 64.0;
        }
        println!("exponent {exponent}: {sum:.4}");
        assert!((sum - 1.0).abs() < 0.05, "exponent {exponent}: {sum}");
    }
}

#[test]
fn a_lambertian_ground_under_one_light_is_what_lambert_says() {
    let Some(mut renderer) = renderer(sphere_on_ground(Material::lambert([0.8; 3])), &SMALL) else { return };
    let direction = Vec3::new(0.3, 0.8, -0.2).normalize_or_zero();
    renderer.draw(&[light(0, direction, 3.0)], &camera(), 1).unwrap();
    let mut pixels = Vec::new();
    renderer.read_radiance(&mut pixels).unwrap();
    // The bottom left pixel shows unshadowed ground.
    let found = pixels[(SMALL.height_px as usize - 1) * SMALL.width_px as usize][0];
    let expected = 0.5 / std::f32::consts::PI * 3.0 * direction.y;
    assert!((found / expected - 1.0).abs() < 2e-3, "{found} {expected}");
    assert_eq!(pixels[0], [0.0; 4], "the sky shows nothing");
}

#[test]
fn released_shadow_maps_go_to_the_lights_of_most_power() {
    let options = Options {
        width_px: 64,
        height_px: 48,
        directional: DirectionalOptions { shadow_maps: 1, ..SMALL.directional },
        ..SMALL
    };
    let Some(mut renderer) = renderer(sphere_on_ground(Material::lambert([0.5; 3])), &options) else {
        return;
    };
    let (east, west) = (Vec3::new(0.6, 0.8, 0.0), Vec3::new(-0.6, 0.8, 0.0));
    let lights = |of_west: f32| [light(0, east, 1.0), light(1, west, of_west)];
    let mut drawn = |lights: &[Light], is_released: bool| {
        if is_released {
            renderer.release_shadow_maps();
        }
        renderer.draw(lights, &camera(), 1).unwrap();
        surfaces(&renderer)
    };
    let fresh = drawn(&lights(1.1), true);
    drawn(&lights(0.9), true);
    // A tenth brighter is not enough to take over the only shadow map.
    assert_ne!(drawn(&lights(1.1), false), fresh);
    assert_eq!(drawn(&lights(1.1), true), fresh);
}
