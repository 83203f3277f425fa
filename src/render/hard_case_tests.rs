//! Adversarial input.

use super::test_scenes::*;
use super::{DirectionalOptions, Options, Renderer};
use crate::error::Kind;
use crate::gpu::Gpu;
use crate::scene::{Camera, Material, Scene, Shading, Transform};
use glam::{Mat4, Quat, Vec3};
use lightcast_core::light::Light;

fn lambert() -> Material {
    Material::lambert([0.8; 3])
}

fn renderer(scene: Scene) -> Option<Renderer> {
    Gpu::for_test().map(|gpu| Renderer::new(gpu, scene, &OPTIONS).unwrap())
}

/// Draws, checks that all pixels are finite and none is negative, and returns them.
fn draw(renderer: &mut Renderer, lights: &[Light], camera: &Camera) -> Vec<[f32; 4]> {
    renderer.draw(lights, camera, 1).unwrap();
    let mut pixels = Vec::new();
    renderer.read_radiance(&mut pixels).unwrap();
    assert_eq!(pixels.len(), OPTIONS.pixels());
    assert!(pixels.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
    pixels
}

/// The bottom left pixel, which shows unshadowed ground.
fn open_ground(pixels: &[[f32; 4]]) -> [f32; 4] {
    pixels[((OPTIONS.height_px - 1) * OPTIONS.width_px) as usize]
}

#[test]
fn no_lights_and_lights_without_power_give_a_black_picture_of_the_surfaces() {
    let Some(mut renderer) = renderer(sphere_on_ground(metal(0.3))) else { return };
    let dark = |id| Light { irradiance: [0.0; 3], ..light(id, Vec3::new(0.1, 1.0, id as f32), 1.0) };
    let many: Vec<Light> = (0..200).map(dark).collect();
    // A frame with light comes first: nothing of it may remain.
    let before = draw(&mut renderer, &sky(100), &camera());
    for lights in [&[][..], &many[..1], &many] {
        let pixels = draw(&mut renderer, lights, &camera());
        for (pixel, before) in pixels.iter().zip(&before) {
            assert_eq!(*pixel, [0.0, 0.0, 0.0, before[3]]);
        }
        let mut picture = Vec::new();
        renderer.read_picture(0.0, &mut picture).unwrap();
    }
}

#[test]
fn a_light_of_1e8_beside_lights_of_a_thousandth() {
    let Some(mut renderer) = renderer(sphere_on_ground(lambert())) else { return };
    let direction = Vec3::new(0.3, 0.8, -0.2).normalize_or_zero();
    let mut lights = furnace(200);
    lights.iter_mut().for_each(|light| light.irradiance = [1e-3; 3]);
    lights[150] = light(150, direction, 1e8);
    let pixels = draw(&mut renderer, &lights, &camera());
    let expected = 0.5 / std::f32::consts::PI * 1e8 * direction.y;
    let found = open_ground(&pixels)[1];
    assert!((found / expected - 1.0).abs() < 5e-3, "{found} {expected}");
    // In the sun's shadow the weak lights are still visible: the ground just behind the sphere, seen from
    // above.
    let above = Camera { eye: Vec3::new(0.0, 12.0, 0.0), up: Vec3::Z, ..camera() };
    let dark = draw(&mut renderer, &lights, &above);
    let least =
        dark.iter().filter(|pixel| pixel[3] > 0.0).map(|pixel| pixel[1]).fold(f32::INFINITY, f32::min);
    assert!(least < 1.0 && least > 1e-4, "{least}");
    let mut picture = Vec::new();
    renderer.read_picture(0.0, &mut picture).unwrap();
}

#[test]
fn lights_along_the_view_and_along_the_axes() {
    for material in [lambert(), metal(0.0), metal(1.0)] {
        let Some(mut renderer) = renderer(sphere_on_ground(material)) else { return };
        let view = camera().eye - camera().target;
        let directions = [view, -view, Vec3::Y, Vec3::NEG_Y, Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z];
        for direction in directions {
            for spread_rad in [0.0, 0.3, std::f32::consts::FRAC_PI_2, 2.0] {
                let light = Light { spread_rad, ..light(0, direction, 1.0) };
                let pixels = draw(&mut renderer, &[light], &camera());
                let ground = open_ground(&pixels)[1];
                let height = Vec3::from(light.direction).y;
                if spread_rad == 0.0 {
                    let expected = 0.5 / std::f32::consts::PI * height.max(0.0);
                    assert!((ground - expected).abs() < 1e-3, "{direction}: {ground} {expected}");
                }
            }
        }
        // A camera that looks straight down, exactly along a light.
        let above = Camera { eye: Vec3::new(0.0, 9.0, 0.0), up: Vec3::Z, ..camera() };
        for direction in [Vec3::Y, Vec3::NEG_Y] {
            let pixels = draw(&mut renderer, &[light(0, direction, 1.0)], &above);
            assert_eq!(open_ground(&pixels)[1] > 0.1, direction.y > 0.0);
        }
    }
}

#[test]
fn scenes_of_nothing_of_flat_casters_and_of_flattened_meshes() {
    let dot = || moved(ground(0.0, 0.5, 0), Vec3::ZERO);
    let flattened = |scale: Vec3| {
        let mut scene = scene(vec![(sphere(16, 0), true), (ground(8.0, -1.0, 0), false)], vec![lambert()]);
        let mut root = scene.nodes[0];
        root.transform = Transform::Trs { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale };
        scene.nodes.push(root);
        scene.instances[0].node = 1;
        scene
    };
    let scenes = [
        ("nothing", Scene::default(), 0.0),
        ("ground alone", scene(vec![(ground(8.0, -1.0, 0), false)], vec![lambert()]), 0.0),
        ("flat caster", scene(vec![(ground(8.0, -1.0, 0), true)], vec![lambert()]), 0.0),
        ("a point", scene(vec![(dot(), true), (ground(8.0, -1.0, 0), false)], vec![lambert()]), 0.0),
        ("flat in y", flattened(Vec3::new(1.0, 0.0, 1.0)), 1.0),
        ("flat in x", flattened(Vec3::new(0.0, 1.0, 1.0)), 1.0),
        ("flat in all", flattened(Vec3::ZERO), 0.0),
    ];
    for (name, scene, shadows) in scenes {
        let is_empty = scene.instances.is_empty();
        let Some(mut renderer) = renderer(scene) else { return };
        // Directions include those along the flat casters, edge-on.
        for direction in [Vec3::new(0.8, 0.6, 0.0), Vec3::Y, Vec3::X, Vec3::NEG_Y, Vec3::new(0.0, 1e-4, 1.0)]
        {
            let pixels = draw(&mut renderer, &[light(0, direction, 1.0)], &camera());
            if is_empty {
                assert!(pixels.iter().all(|pixel| *pixel == [0.0; 4]), "{name}");
                continue;
            }
            let height = Vec3::from(light(0, direction, 1.0).direction).y;
            if height > 0.5 {
                let expected = 0.8 / std::f32::consts::PI * height;
                let ground = open_ground(&pixels)[1];
                assert!((ground / expected - 1.0).abs() < 5e-3, "{name}, {direction}: {ground} {expected}");
                let dark = pixels.iter().filter(|p| p[3] > 0.0 && p[1] < 0.5 * expected).count();
                if shadows == 0.0 {
                    assert_eq!(dark, 0, "{name}, {direction}");
                }
            }
        }
        let _ = renderer.default_camera();
    }
}

#[test]
fn tiny_and_huge_scenes_look_like_those_of_one_unit() {
    let Some(mut unit) = renderer(sphere_on_ground(lambert())) else { return };
    let lights = [light(0, Vec3::new(0.5, 0.7, 0.3), 1.0), light(1, Vec3::new(-0.9, 0.2, 0.3), 1.0)];
    let expected = draw(&mut unit, &lights, &camera());
    for size in [1e-3f32, 1e4] {
        let mut scaled = sphere_on_ground(lambert());
        scaled.nodes[0].transform = Transform::Matrix(Mat4::from_scale(Vec3::splat(size)));
        let Some(mut renderer) = renderer(scaled) else { return };
        let from = Camera { eye: size * camera().eye, near: size * camera().near, ..camera() };
        let found = draw(&mut renderer, &lights, &from);
        let differ =
            found.iter().zip(&expected).filter(|(a, b)| (0..4).any(|c| (a[c] - b[c]).abs() > 2e-3)).count();
        println!("size {size}: {differ} pixels differ");
        assert!(differ <= OPTIONS.pixels() / 200, "size {size}: {differ} pixels");
    }
}

#[test]
fn positions_that_are_no_numbers_draw_nothing_and_harm_nothing() {
    let mut scene = sphere_on_ground(lambert());
    for (index, value) in [(0, f32::NAN), (700, f32::INFINITY), (900, f32::NEG_INFINITY)] {
        scene.meshes[0].vertices[index].position[1] = value;
    }
    let Some(mut renderer) = renderer(scene) else { return };
    let pixels = draw(&mut renderer, &[light(0, Vec3::new(0.3, 0.8, -0.2), 1.0)], &camera());
    assert!(open_ground(&pixels)[1] > 0.1);
}

#[test]
fn a_lost_device_says_so() {
    let Some(mut renderer) = renderer(sphere_on_ground(lambert())) else { return };
    renderer.draw(&sky(10), &camera(), 1).unwrap();
    renderer.gpu().device.destroy();
    let _ = renderer.gpu().device.poll(wgpu::PollType::wait_indefinitely());
    let drawn = renderer.draw(&sky(10), &camera(), 1).unwrap_err();
    let reference = renderer.draw_reference(&sky(10), &camera(), 1, |_| true).unwrap_err();
    let radiance = renderer.read_radiance(&mut Vec::new()).unwrap_err();
    let picture = renderer.read_picture(0.0, &mut Vec::new()).unwrap_err();
    for error in [drawn, reference, radiance, picture] {
        assert_eq!(error.kind(), Kind::Failed);
        assert!(error.to_string().contains("lost"), "{error}");
    }
}

#[test]
fn options_out_of_range_are_refused() {
    let default = OPTIONS.directional;
    let with = |directional| Options { directional, ..OPTIONS };
    let wrong = [
        Options { width_px: 0, ..OPTIONS },
        Options { height_px: 100_000, ..OPTIONS },
        with(DirectionalOptions { lights: 0, ..default }),
        with(DirectionalOptions { lights: usize::MAX, ..default }),
        with(DirectionalOptions { shadow_maps: usize::MAX, ..default }),
        with(DirectionalOptions { shadow_map_px: 0, ..default }),
        with(DirectionalOptions { shadow_map_px: u32::MAX, ..default }),
        with(DirectionalOptions { shadow_maps: 4096, shadow_map_px: 4096, ..default }),
        with(DirectionalOptions { cone_rad: f64::NAN, ..default }),
        with(DirectionalOptions { cone_rad: -0.1, ..default }),
        with(DirectionalOptions { cone_rad: 4.0, ..default }),
        with(DirectionalOptions { soft_samples: 0, ..default }),
        with(DirectionalOptions { soft_samples: u32::MAX, ..default }),
        with(DirectionalOptions { clusters: Some(0), ..default }),
    ];
    for options in wrong {
        let made = Renderer::new(Gpu::noop(), sphere_on_ground(lambert()), &options);
        let error = made.err().unwrap_or_else(|| panic!("accepted: {options:?}"));
        assert_eq!(error.kind(), Kind::Usage, "{error}");
    }
}

#[test]
fn a_million_triangles() {
    let Some(gpu) = Gpu::for_test() else { return };
    let scene = scene(vec![(sphere(500, 0), true), (ground(8.0, -1.0, 0), false)], vec![lambert()]);
    assert!(scene.meshes[0].indices.len() >= 3 * 990_000);
    let mut renderer = Renderer::new(gpu, scene, &OPTIONS).unwrap();
    let direction = Vec3::new(0.3, 0.8, -0.2);
    let found = draw(&mut renderer, &[light(0, direction, 1.0)], &camera());
    // A coarser sphere looks nearly the same.
    let Some(gpu) = Gpu::for_test() else { return };
    let mut renderer = Renderer::new(gpu, sphere_on_ground(lambert()), &OPTIONS).unwrap();
    let expected = draw(&mut renderer, &[light(0, direction, 1.0)], &camera());
    let middle = ((OPTIONS.height_px / 2) * OPTIONS.width_px + OPTIONS.width_px / 2) as usize;
    assert!((found[middle][1] / expected[middle][1] - 1.0).abs() < 0.02, "{:?}", found[middle]);
}

#[test]
fn a_camera_that_looks_straight_down_sees_what_is_below() {
    let Some(mut renderer) = renderer(sphere_on_ground(lambert())) else { return };
    for up in [Vec3::Y, Vec3::NEG_Y, Vec3::ZERO] {
        let above = Camera { eye: Vec3::new(0.0, 8.0, 0.0), target: Vec3::ZERO, up, ..camera() };
        let pixels = draw(&mut renderer, &[light(0, Vec3::new(0.1, 1.0, 0.1), 1.0)], &above);
        let middle = pixels[((OPTIONS.height_px / 2) * OPTIONS.width_px + OPTIONS.width_px / 2) as usize];
        assert!(middle[3] == 1.0 && middle[1] > 0.1, "{up}: {middle:?}");
    }
}

#[test]
fn a_wide_lobe_and_a_wide_light_reach_no_pixel_behind_them() {
    let mut phong = Material::new(Shading::Phong { specular: [0.5; 3], exponent: 0.0 }, [0.0; 3]);
    phong.emissive = [1e5, 0.0, 0.0];
    let Some(mut renderer) = renderer(sphere_on_ground(phong)) else { return };
    let low = Light { spread_rad: 0.3, ..light(0, Vec3::new(0.0, 0.3, -1.0), 1.0) };
    let pixels = draw(&mut renderer, &[low], &camera());
    let glow = pixels.iter().map(|pixel| pixel[0]).fold(0.0, f32::max);
    assert!((glow - 65504.0).abs() < 1.0, "halves hold no more: {glow}");
    assert!(pixels.iter().any(|pixel| pixel[3] == 1.0 && pixel[1] == 0.0));
    assert!(pixels.iter().any(|pixel| pixel[1] > 0.01));
}

#[test]
fn a_scene_far_from_the_origin_looks_like_one_at_it() {
    let Some(mut near) = renderer(sphere_on_ground(lambert())) else { return };
    let lights = [light(0, Vec3::new(0.5, 0.7, 0.3), 1.0)];
    let expected = draw(&mut near, &lights, &camera());
    // Floats have a resolution of only 1/1024 there.
    let away = Vec3::new(8192.0, 0.0, -8192.0);
    let mut scene = sphere_on_ground(lambert());
    scene.nodes[0].transform = Transform::Matrix(Mat4::from_translation(away));
    let Some(mut far) = renderer(scene) else { return };
    let from = Camera { eye: camera().eye + away, target: camera().target + away, ..camera() };
    let found = draw(&mut far, &lights, &from);
    let differ =
        found.iter().zip(&expected).filter(|(a, b)| (0..4).any(|c| (a[c] - b[c]).abs() > 0.02)).count();
    assert!(differ <= OPTIONS.pixels() / 50, "{differ} pixels");
}

#[test]
fn a_roof_in_the_plane_of_the_box_s_top_casts_its_shadow() {
    // Some of these heights are rounded up and some down.
    for y in [0.3, 0.7, 0.9, 1.1, 1.3] {
        let roof = moved(ground(1.0, 0.0, 0), Vec3::new(0.0, y, 0.0));
        let post = cuboid(Vec3::new(0.8, -1.0, 0.8), Vec3::new(0.9, y, 0.9), 0);
        let meshes = vec![(roof, true), (post, true), (ground(4.0, -1.0, 0), false)];
        let Some(mut renderer) = renderer(scene(meshes, vec![lambert()])) else { return };
        let from = Camera { eye: Vec3::new(0.0, 0.0, 5.0), target: Vec3::new(0.0, -1.0, 0.0), ..camera() };
        let pixels = draw(&mut renderer, &[light(0, Vec3::Y, 1.0)], &from);
        let below = pixels[((OPTIONS.height_px / 2) * OPTIONS.width_px + OPTIONS.width_px / 2) as usize];
        assert!(below[3] == 1.0 && below[1] < 1e-3, "{y}: {below:?}");
    }
}

#[test]
fn the_widest_light_has_the_softest_shadow() {
    let Some(mut renderer) = renderer(sphere_on_ground(lambert())) else { return };
    let mut shadow = |spread_rad| {
        let light = Light { spread_rad, ..light(0, Vec3::Y, 1.0) };
        let pixels = draw(&mut renderer, &[light], &camera());
        pixels.iter().filter(|pixel| pixel[3] == 1.0 && pixel[1] == 0.0).count()
    };
    let hard = shadow(0.0);
    for spread_rad in [1.5, std::f32::consts::FRAC_PI_2, 2.0, std::f32::consts::PI] {
        assert_eq!(shadow(spread_rad), shadow(1.5), "{spread_rad}");
        assert!(shadow(spread_rad) < hard, "{spread_rad}");
    }
}

#[test]
fn the_strongest_lights_of_a_file_give_numbers() {
    let Some(mut renderer) = renderer(sphere_on_ground(metal(0.3))) else { return };
    let lights: Vec<Light> = sky(300).into_iter().map(|l| Light { irradiance: [1e30; 3], ..l }).collect();
    draw(&mut renderer, &lights, &camera());
    let mut picture = Vec::new();
    renderer.read_picture(0.0, &mut picture).unwrap();
    assert!(picture.iter().any(|pixel| pixel[..3].iter().any(|&code| code > 100)));
}
