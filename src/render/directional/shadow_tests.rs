//! Hard shadows against exact ones: no acne, no light leaks, no unnecessary blur.

use super::exact_shadow::Sheets;
use super::shade_twin::{Lookup, terminator};
use crate::gpu::Gpu;
use crate::render::test_scenes::*;
use crate::render::{DirectionalOptions, Options, Renderer};
use crate::scene::{Camera, Material, Texture, Wrap};
use glam::{DVec2, UVec2, Vec3};
use std::f32::consts::PI;

const SIZE: [u32; 2] = [128, 96];

const HARD: Options = Options {
    width_px: SIZE[0],
    height_px: SIZE[1],
    directional: DirectionalOptions {
        lights: 2,
        shadow_maps: 1,
        shadow_map_px: 256,
        soft_samples: 1,
        culling: false,
        cone_rad: 0.0,
        region_lights: 0,
        ..OPTIONS.directional
    },
    ..OPTIONS
};

/// Pixels that face a light and whose relevant texels all agree, by exact visibility.
#[derive(Debug, Default)]
struct Compared {
    lit: usize,
    dark: usize,
    /// Numbers of lit pixels that are shadowed, and of dark pixels that are lit, by more than a hundredth.
    acne: usize,
    leaks: usize,
    /// Light that lit pixels lose, and that dark pixels receive, relative to the total that lit pixels should
    /// have.
    lost: f64,
    leaked: f64,
}

/// Draws a Lambertian scene under one light and compares every pixel with exact visibility, except those
/// nearer than `margin` texels, as seen from the light, to the border of a shadow.
fn compared(renderer: &mut Renderer, camera: &Camera, direction: Vec3, margin: f64) -> Compared {
    let light = light(0, direction, PI);
    let direction = Vec3::from(light.direction);
    renderer.draw(&[light], camera, 1).unwrap();
    let (frame, lighting) = renderer.read_back();
    let sheets = Sheets::new(renderer.scene(), direction);
    let mut compared = Compared::default();
    let mut should = f64::MIN_POSITIVE;
    for (index, found) in (0..).zip(&frame.radiance) {
        let pixel = UVec2::new(index % SIZE[0], index / SIZE[0]);
        let Some(position) = frame.position(pixel) else { continue };
        let s = frame.surface(pixel);
        let (n_l, face_l) = (s.normal.dot(direction), s.face.dot(direction));
        // At such grazing angles the light is invisible in the picture, and half floats are too imprecise for
        // it.
        if n_l <= 1e-2 || face_l <= 1e-2 {
            continue;
        }
        let at = Lookup::new(&lighting.space, 0, &sheets.basis, position, s.face, s.bend);
        let n = (sheets.basis.transpose() * s.face).as_dvec3();
        let receiver = at.receiver.as_dvec3();
        let Some(exact) = sheets.is_lit(receiver.truncate(), receiver.z) else { continue };
        let is_settled = (-2..=2).all(|row| {
            (-2..=2).all(|column| {
                let off = 0.5 * margin * DVec2::new(f64::from(column), f64::from(row)) / at.texels.as_dvec2();
                let plane = receiver.z - n.truncate().dot(off) / n.z;
                sheets.is_lit(receiver.truncate() + off, plane).is_none_or(|lit| lit == exact)
            })
        });
        if !is_settled {
            continue;
        }
        let softened = terminator(n_l, face_l, s.face.dot(s.normal));
        let lit = found[1] / (s.diffuse.y * n_l * softened);
        let weight = f64::from(n_l * softened);
        *(if exact { &mut compared.lit } else { &mut compared.dark }) += 1;
        compared.acne += usize::from(exact && lit < 0.99);
        compared.leaks += usize::from(!exact && lit > 0.01);
        let (exact, lit) = (f64::from(u8::from(exact)), f64::from(lit));
        should += exact * weight;
        compared.lost += (exact - lit).max(0.0) * weight;
        compared.leaked += (lit - exact).max(0.0) * weight;
    }
    compared.lost /= should;
    compared.leaked /= should;
    compared
}

/// Fractions of the light that lit pixels may lose, and that dark ones may receive. Measured: 0.0073, at
/// walls nearly parallel to the light, and 0.0043, in a bowl of coarse triangles.
const LOST: f64 = 0.01;
const LEAKED: f64 = 0.005;

fn lambert() -> Vec<Material> {
    vec![Material::lambert([0.8; 3])]
}

/// A direction at `degrees` from the zenith.
fn towards(degrees: f32, azimuth: f32) -> Vec3 {
    let theta = degrees.to_radians();
    Vec3::new(theta.sin() * azimuth.cos(), theta.cos(), theta.sin() * azimuth.sin())
}

fn close_up(eye: Vec3, target: Vec3, vertical_fov_rad: f32) -> Camera {
    Camera { eye, target, up: Vec3::Y, vertical_fov_rad, near: 0.05 }
}

#[test]
fn surfaces_do_not_shadow_themselves() {
    let plane = |half, y| (ground(half, y, 0), true);
    let scenes = [
        ("plane", scene(vec![plane(4.0, 0.0)], lambert())),
        ("sphere on plane", scene(vec![(sphere(24, 0), true), plane(4.0, -1.0)], lambert())),
        ("torus over plane", scene(vec![(torus(32, 0.4, 0), true), plane(4.0, -1.0)], lambert())),
        ("inside of a bowl", scene(vec![(bowl(), true)], lambert())),
    ];
    for (name, scene) in scenes {
        let Some(gpu) = Gpu::for_test() else { return };
        let mut renderer = Renderer::new(gpu, scene, &HARD).unwrap();
        for degrees in [5.0, 30.0, 60.0, 75.0, 85.0, 89.0] {
            let found = compared(&mut renderer, &camera(), towards(degrees, 0.4), 1.6);
            assert!(found.lit > 250, "{name}, {degrees} degrees: {found:?}");
            assert!(found.lost < LOST && found.leaked < LEAKED, "{name}, {degrees} degrees: {found:?}");
            assert!(name != "plane" || found.acne == 0, "{degrees} degrees: {found:?}");
        }
    }
}

/// The lower half of a sphere, seen from within.
fn bowl() -> crate::scene::Mesh {
    let mut mesh = sphere(24, 0);
    let vertices = std::mem::take(&mut mesh.vertices);
    let is_below = |index: &u32| vertices[*index as usize].position[1] < 0.01;
    let (kept, _) = mesh.indices.as_chunks::<3>();
    mesh.indices = kept.iter().filter(|corners| corners.iter().all(is_below)).flatten().copied().collect();
    mesh.vertices = vertices;
    mesh
}

#[test]
fn shadows_begin_where_things_stand() {
    let cube = cuboid(Vec3::new(-0.5, -1.0, -0.5), Vec3::new(0.5, 0.0, 0.5), 0);
    for (name, mesh, contact) in
        [("cube", cube, Vec3::new(-0.5, -1.0, 0.2)), ("sphere", sphere(48, 0), Vec3::new(0.0, -1.0, 0.0))]
    {
        for ground_casts in [false, true] {
            let Some(gpu) = Gpu::for_test() else { return };
            let scene = scene(vec![(mesh.clone(), true), (ground(4.0, -1.0, 0), ground_casts)], lambert());
            let mut renderer = Renderer::new(gpu, scene, &HARD).unwrap();
            for degrees in [20.0, 45.0, 70.0, 85.0] {
                let camera = close_up(Vec3::new(-2.0, -0.4, 1.5), contact, 0.25);
                let found = compared(&mut renderer, &camera, towards(degrees, 0.1), 1.6);
                let about = format!("{name}, ground casts {ground_casts}, {degrees} degrees: {found:?}");
                assert!(found.dark > 500, "{about}");
                assert!(found.lost < LOST && found.leaks == 0, "{about}");
                // The foot of a wall along the light is compared with texels of the ground if the ground
                // casts shadows.
                assert!(ground_casts || found.acne == 0, "{about}");
            }
        }
    }
}

#[test]
fn the_shadow_of_a_small_thing_on_a_huge_ground_is_sharp() {
    let cube = cuboid(Vec3::new(-0.5, -1.0, -0.5), Vec3::new(0.5, 0.0, 0.5), 0);
    let scene = scene(vec![(cube, true), (ground(1000.0, -1.0, 0), false)], lambert());
    let Some(gpu) = Gpu::for_test() else { return };
    let mut renderer = Renderer::new(gpu, scene, &HARD).unwrap();
    let camera =
        Camera { up: Vec3::Z, ..close_up(Vec3::new(-1.5, 3.0, 0.0), Vec3::new(-1.5, -1.0, 0.0), 0.2) };
    let found = compared(&mut renderer, &camera, towards(45.0, 0.0), 1.6);
    // The shadow's edge runs through the picture; few rows and columns are within two texels of it.
    assert!(found.lit > 3000 && found.dark > 3000 && found.acne + found.leaks == 0, "{found:?}");
    assert!(found.lit + found.dark > 95 * (SIZE[0] * SIZE[1]) as usize / 100, "{found:?}");
}

#[test]
fn a_light_without_a_map_borrows_that_of_its_neighbour() {
    let Some(gpu) = Gpu::for_test() else { return };
    let mut renderer = Renderer::new(gpu, sphere_on_ground(Material::lambert([0.8; 3])), &HARD).unwrap();
    let strong = light(0, Vec3::new(0.6, 0.7, 0.2), 3.0);
    let weak = light(1, Vec3::new(0.4, 0.8, 0.3), 1.0);
    let mut draw = |lights: &[lightcast_core::light::Light]| {
        renderer.draw(lights, &camera(), 1).unwrap();
        renderer.read_back().0
    };
    let (alone, both) = (draw(&[strong]), draw(&[strong, weak]));
    let (mut dark, mut lit) = (0, 0);
    for index in 0..SIZE[0] * SIZE[1] {
        let pixel = UVec2::new(index % SIZE[0], index / SIZE[0]);
        let s = both.surface(pixel);
        let open = |light: &lightcast_core::light::Light| {
            let direction = Vec3::from(light.direction);
            let (n_l, face_l) = (s.normal.dot(direction), s.face.dot(direction));
            if n_l <= 0.0 || face_l <= 0.0 {
                return 0.0;
            }
            let softened = terminator(n_l, face_l, s.face.dot(s.normal));
            s.diffuse.y / PI * n_l * softened * light.irradiance[1]
        };
        if both.position(pixel).is_none() || open(&strong) < 1e-3 {
            continue;
        }
        let passes = alone.radiance[index as usize][1] / open(&strong);
        let expected = alone.radiance[index as usize][1] + passes * open(&weak);
        let found = both.radiance[index as usize][1];
        assert!((found - expected).abs() < 2e-3, "{pixel}: {found} {expected}");
        dark += usize::from(passes < 0.01 && open(&weak) > 0.1);
        lit += usize::from(passes > 0.99);
    }
    assert!(dark > 300 && lit > 3000, "{dark} {lit}");
}

/// A texture of two pixels, the left one first.
fn two_pixels(rgba8: [[u8; 4]; 2]) -> Texture {
    let rgba8 = rgba8.concat();
    let (wrap_u, wrap_v) = (Wrap::ClampToEdge, Wrap::ClampToEdge);
    Texture { width: 2, height: 1, rgba8, is_srgb: false, wrap_u, wrap_v }
}

#[test]
fn holes_of_a_material_let_light_through() {
    let Some(gpu) = Gpu::for_test() else { return };
    let plate =
        Material { base_colour_texture: Some(0), alpha_cutoff: Some(0.5), ..Material::lambert([0.8; 3]) };
    let materials = vec![Material::lambert([0.8; 3]), plate];
    let mut scene = scene(vec![(ground(1.0, 1.0, 1), true), (ground(4.0, -1.0, 0), false)], materials);
    // Alpha crosses 0.5 half-way between the centres of both pixels, at x = 0.5.
    scene.textures.push(two_pixels([[255; 4], [255, 255, 255, 0]]));
    let mut renderer = Renderer::new(gpu, scene, &HARD).unwrap();
    renderer.draw(&[light(0, Vec3::Y, 1.0)], &camera(), 1).unwrap();
    let (frame, _) = renderer.read_back();
    let (mut dark, mut lit) = (0, 0);
    for index in 0..SIZE[0] * SIZE[1] {
        let Some(at) = frame.position(UVec2::new(index % SIZE[0], index / SIZE[0])) else { continue };
        if at.y > -0.9 || at.z.abs() > 0.95 {
            assert!(at.y < -0.9 || at.x < 0.52, "the hole is seen through: {at}");
            continue;
        }
        let found = frame.radiance[index as usize][1];
        if (-0.95..0.47).contains(&at.x) {
            assert_eq!(found, 0.0, "{at}");
            dark += 1;
        } else if (0.53..0.95).contains(&at.x) {
            assert!(found > 0.25, "{at}: {found}");
            lit += 1;
        }
    }
    assert!(dark > 200 && lit > 100, "{dark} {lit}");
}

#[test]
fn a_normal_map_moves_no_shadow() {
    let Some(gpu) = Gpu::for_test() else { return };
    let mapped = Material { normal_texture: Some(0), ..Material::lambert([0.8; 3]) };
    let mut scene = scene(vec![(ground(4.0, -1.0, 0), true)], vec![mapped]);
    scene.textures.push(two_pixels([[200, 128, 220, 255]; 2]));
    let mut renderer = Renderer::new(gpu, scene, &HARD).unwrap();
    renderer.draw(&[light(0, Vec3::Y, 1.0)], &camera(), 1).unwrap();
    let (frame, _) = renderer.read_back();
    let pixels = (0..SIZE[0] * SIZE[1]).map(|index| UVec2::new(index % SIZE[0], index / SIZE[0]));
    let seen: Vec<UVec2> = pixels.filter(|&pixel| frame.position(pixel).is_some()).collect();
    assert!(seen.len() > 4000);
    for pixel in seen {
        let s = frame.surface(pixel);
        assert!(s.bend < 1e-3 && s.normal.dot(s.face) < 0.9, "{pixel}: {} {} {}", s.bend, s.normal, s.face);
    }
}
