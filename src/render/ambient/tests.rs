use super::*;
use crate::gpu::layout::{assert_layout, assert_valid, members};
use crate::render::test_scenes::{light, scene, sky};
use crate::render::{Lightings, Options, Renderer};
use crate::scene::{Bounds, Camera, Material, Mesh, Vertex};
use glam::UVec2;
use lightcast_core::math::fibonacci_sphere;
use std::f32::consts::PI;

#[test]
fn the_shader_is_valid_and_its_struct_lies_as_it_is_written() {
    let source = SOURCES.concat();
    assert_valid("ambient", &source);
    assert_layout(&source, "Ground", size_of::<GroundUniform>(), members!(GroundUniform: radiance));
}

#[test]
fn the_twin_is_the_integral_over_the_lower_half_of_the_sphere() {
    let points = 40_000;
    let radiance = Vec3::new(0.3, 1.0, 2.0);
    for normal in fibonacci_sphere(40).map(|n| n.as_vec3()).chain([Vec3::Y, Vec3::NEG_Y, Vec3::X]) {
        let below = fibonacci_sphere(points).filter(|d| d.y < 0.0);
        let cosines: f64 = below.map(|d| d.dot(normal.as_dvec3()).max(0.0)).sum();
        let integral = radiance * (4.0 * cosines / points as f64) as f32;
        let found = twin::irradiance_over_pi(radiance, normal);
        assert!(found.abs_diff_eq(integral, 1e-3), "{normal}: {found} {integral}");
    }
}

#[test]
fn lights_from_below_do_not_light_the_ground() {
    let lights = [
        light(0, Vec3::new(0.0, 0.6, 0.8), 2.0),
        light(1, Vec3::new(0.6, -0.8, 0.0), 100.0),
        light(2, Vec3::X, 100.0),
    ];
    let found = ground_radiance(&lights, 0.25);
    assert!(found.abs_diff_eq(Vec3::splat(0.25 * 1.2 / PI), 1e-6), "{found}");
    assert_eq!(ground_radiance(&[], 0.25), Vec3::ZERO);
}

/// Adjacent squares that face +Z, each with its own shading normal.
fn squares(columns: u32, rows: u32, normal: impl Fn(u32) -> Vec3) -> Mesh {
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    for number in 0..columns * rows {
        let (left, low) = ((number % columns) as f32, (number / columns) as f32);
        let first = vertices.len() as u32;
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let normal = normal(number).to_array();
            vertices.push(Vertex {
                position: [left + x, low + y, 0.0],
                normal,
                uv: [0.0; 2],
                colour: [1.0; 4],
            });
        }
        indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
    }
    let bounds = Bounds { min: Vec3::ZERO, max: Vec3::new(columns as f32, rows as f32, 0.0) };
    Mesh { vertices, indices, material: 0, bounds }
}

#[test]
fn a_surface_of_any_normal_gets_what_the_closed_form_says() {
    let Some(gpu) = Gpu::for_test() else { return };
    let (columns, rows) = (32, 24);
    // Normals towards the camera, of every n.y, which is all that matters.
    let normals: Vec<Vec3> = fibonacci_sphere(2 * (columns * rows) as usize + 16)
        .map(|n| n.as_vec3())
        .filter(|n| n.z > 0.0)
        .take((columns * rows) as usize)
        .collect();
    assert_eq!(normals.len(), (columns * rows) as usize);
    let (lowest, highest) =
        normals.iter().fold((1.0f32, -1.0f32), |(low, high), n| (low.min(n.y), high.max(n.y)));
    assert!(lowest < -0.97 && highest > 0.97);
    let albedos = [0.75, 0.5, 0.25];
    let squares = scene(
        vec![(squares(columns, rows, |number| normals[number as usize]), true)],
        vec![Material::lambert(albedos)],
    );
    // Four pixels per square.
    let options = Options {
        width_px: 2 * columns,
        height_px: 2 * rows,
        lighting: Lightings { directional: false, ambient: true },
        ground_albedo: 0.3,
        ..Options::default()
    };
    let mut renderer = Renderer::new(gpu, squares, &options).unwrap();
    let (middle, distance) = (0.5 * Vec3::new(columns as f32, rows as f32, 0.0), 40.0);
    let camera = Camera {
        eye: middle + distance * Vec3::Z,
        target: middle,
        up: Vec3::Y,
        vertical_fov_rad: 2.0 * (0.5 * rows as f32 / distance).atan(),
        near: 0.1,
    };
    let lights = sky(500);
    renderer.draw(&lights, &camera, 1).unwrap();
    let mut pixels = Vec::new();
    renderer.read_radiance(&mut pixels).unwrap();
    let up: Vec3 = lights.iter().map(|l| Vec3::from(l.irradiance) * l.direction[1].max(0.0)).sum();
    let mut worst = 0.0f32;
    for (index, pixel) in (0..).zip(&pixels) {
        let place = UVec2::new(index % options.width_px, index / options.width_px) / 2;
        let normal = normals[((rows - 1 - place.y) * columns + place.x) as usize];
        for channel in 0..3 {
            let irradiance = pixel[channel] * PI / albedos[channel] / (0.3 * up[channel]);
            worst = worst.max((irradiance - 0.5 * (1.0 - normal.y)).abs());
        }
    }
    println!("{} normals: within {worst:.1e} of the closed form", normals.len());
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn lightings_add_up() {
    let options = Options { width_px: 64, height_px: 48, ground_albedo: 0.4, ..Options::default() };
    let drawn = |directional, ambient| {
        let gpu = Gpu::for_test()?;
        let options = Options { lighting: Lightings { directional, ambient }, ..options };
        let scene = crate::render::test_scenes::sphere_on_ground(Material::lambert([0.7; 3]));
        let mut renderer = Renderer::new(gpu, scene, &options).unwrap();
        renderer.draw(&sky(50), &crate::render::test_scenes::camera(), 2).unwrap();
        let mut pixels = Vec::new();
        renderer.read_radiance(&mut pixels).unwrap();
        Some(pixels)
    };
    let Some(both) = drawn(true, true) else { return };
    let [directional, ambient, neither] = [(true, false), (false, true), (false, false)]
        .map(|(directional, ambient)| drawn(directional, ambient).expect("there was a device above"));
    for (index, both) in both.iter().enumerate() {
        for channel in 0..3 {
            let sum = directional[index][channel] + ambient[index][channel];
            assert!((both[channel] - sum).abs() <= 1e-6 * sum.max(1.0), "{both:?} {sum}");
            assert_eq!(neither[index][channel], 0.0);
        }
        assert_eq!([both[3], directional[index][3], ambient[index][3]], [neither[index][3]; 3]);
    }
    assert!(ambient.iter().any(|pixel| pixel[1] > 1e-2));
}
