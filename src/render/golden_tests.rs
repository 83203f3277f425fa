//! Reference pictures in `tests/golden/`: output of the renderer that was last inspected by a person.
//!
//! On lavapipe, with which the pictures were drawn, codes may differ by 0.1 in the mean and by 12 at most:
//! other versions of it round differently, and a shadow-map comparison with a different result changes a
//! pixel by a few codes. On other adapters the edges of triangles are rasterised slightly differently: there
//! only the mean is checked, to 1 code.
//!
//! `LIGHTCAST_RENEW_GOLDEN=1 cargo test golden` redraws them. Inspect them before committing.

use super::test_scenes::*;
use super::{DirectionalOptions, Options, Renderer};
use crate::files::write_png8;
use crate::gpu::Gpu;
use crate::scene::{Material, Roles, Scene, Shading};
use glam::Vec3;
use lightcast_core::light::Light;
use std::path::Path;

const SIZE: [u32; 2] = [96, 72];
const MOST_MEAN: f64 = 0.1;
const MOST: u8 = 12;
const MOST_MEAN_ELSEWHERE: f64 = 1.0;

fn check(name: &str, scene: Scene, lights: &[Light], options: &Options) {
    let Some(gpu) = Gpu::for_test() else { return };
    let is_lavapipe = gpu.info.name.contains("llvmpipe");
    let options = Options { width_px: SIZE[0], height_px: SIZE[1], ..*options };
    let mut renderer = Renderer::new(gpu, scene, &options).unwrap();
    renderer.draw(lights, &camera(), 4).unwrap();
    let mut pixels = Vec::new();
    renderer.read_picture(0.0, &mut pixels).unwrap();
    let found: Vec<u8> = pixels.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name).with_extension("png");
    if std::env::var_os("LIGHTCAST_RENEW_GOLDEN").is_some() {
        write_png8(&path, SIZE[0] as usize, SIZE[1] as usize, &found).unwrap();
        return;
    }
    let golden = image::open(&path).unwrap().into_rgb8();
    assert_eq!(golden.dimensions(), (SIZE[0], SIZE[1]), "{name}");
    let differences = || golden.as_raw().iter().zip(&found).map(|(a, b)| a.abs_diff(*b));
    let mean = differences().map(f64::from).sum::<f64>() / found.len() as f64;
    let most = differences().max().unwrap();
    println!("{name}: differs by {mean:.4} codes in the mean, {most} at most");
    if is_lavapipe {
        assert!(mean <= MOST_MEAN && most <= MOST, "{name}: {mean} {most}");
    } else {
        assert!(mean <= MOST_MEAN_ELSEWHERE, "{name}: {mean} {most}");
    }
}

#[test]
fn lambert_under_a_sky() {
    let scene = sphere_on_ground(Material::lambert([0.8, 0.4, 0.2]));
    check("lambert", scene, &sky(300), &Options::default());
}

#[test]
fn metal_under_many_lights() {
    let gold = Material { base_colour: [1.0, 0.76, 0.34, 1.0], ..metal(0.3) };
    check("metal", sphere_on_ground(gold), &sky(1000), &Options::default());
}

#[test]
fn phong_torus_under_three_hard_lights() {
    let phong = Shading::Phong { specular: [0.3; 3], exponent: 60.0 };
    let meshes = vec![(torus(48, 0.4, 0), true), (ground(8.0, -1.0, 1), false)];
    let scene = scene(meshes, vec![Material::new(phong, [0.2, 0.3, 0.6]), Material::lambert([0.5; 3])]);
    let mut lights = [
        light(0, Vec3::new(-0.5, 0.8, 0.3), 2.0),
        light(1, Vec3::new(0.7, 0.4, 0.3), 1.0),
        light(2, Vec3::new(0.1, 0.3, -0.9), 1.0),
    ];
    lights[1].irradiance = [1.0, 0.7, 0.4];
    let options = Options {
        directional: DirectionalOptions {
            soft_samples: 1,
            culling: false,
            shadow_map_px: 512,
            ..DirectionalOptions::default()
        },
        ..Options::default()
    };
    check("phong", scene, &lights, &options);
}

/// A torus in front of a sphere, both on the ground, the torus with these roles.
fn torus_with(roles: Roles) -> Scene {
    let meshes = vec![
        (moved(torus(48, 0.35, 0), Vec3::new(-0.9, -0.6, 0.9)), true),
        (sphere(48, 1), true),
        (ground(8.0, -1.0, 2), false),
    ];
    let materials = [[0.8, 0.3, 0.2], [0.3, 0.5, 0.8], [0.5; 3]].map(Material::lambert).to_vec();
    let mut scene = scene(meshes, materials);
    scene.instances[0].roles = roles;
    scene
}

#[test]
fn a_torus_that_is_held_out() {
    check("held_out", torus_with(Roles::HELD_OUT), &sky(300), &Options::default());
}

#[test]
fn a_torus_that_is_unseen() {
    check("unseen", torus_with(Roles::NONE), &sky(300), &Options::default());
}

#[test]
fn a_torus_that_casts_no_shadow() {
    check("no_shadow", torus_with(Roles::NO_SHADOW), &sky(300), &Options::default());
}

#[test]
fn a_torus_over_the_light_of_a_ground() {
    let options = Options { ground_albedo: 0.5, ..Options::default() };
    let phong = Shading::Phong { specular: [0.2; 3], exponent: 40.0 };
    let meshes = vec![(torus(48, 0.4, 0), true)];
    let scene = scene(meshes, vec![Material::new(phong, [0.7, 0.6, 0.5])]);
    let from_above: Vec<Light> = sky(300).into_iter().filter(|light| light.direction[1] > 0.0).collect();
    check("ambient", scene, &from_above, &options);
}
