//! Transforms of texture coordinates.

use super::test_scenes::*;
use super::{DirectionalOptions, Options, Renderer};
use crate::gpu::Gpu;
use crate::scene::{Material, Scene, Texture, Wrap};
use glam::{Affine2, Vec2};

/// The ground with a texture of 4 x 4 colours, of which some are holes, as base colour and emission.
fn tiled(base_colour_uv: Affine2, emissive_uv: Affine2) -> Scene {
    let texel = |i: u8| [40 + 13 * i, 255 - 9 * i, 120, if i.is_multiple_of(5) { 0 } else { 255 }];
    let texture = Texture {
        width: 4,
        height: 4,
        rgba8: (0..16).flat_map(texel).collect(),
        is_srgb: true,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
    };
    let material = Material {
        base_colour_texture: Some(0),
        base_colour_uv,
        emissive: [0.1; 3],
        emissive_texture: Some(0),
        emissive_uv,
        alpha_cutoff: Some(0.5),
        ..Material::lambert([0.8; 3])
    };
    let mut scene = scene(
        vec![(ground(2.0, 0.5, 0), true), (ground(8.0, -1.0, 1), false)],
        vec![material, Material::lambert([0.5; 3])],
    );
    scene.textures.push(texture);
    scene
}

fn drawn(scene: Scene) -> Option<Vec<[f32; 4]>> {
    let options = Options {
        width_px: 96,
        height_px: 72,
        directional: DirectionalOptions { lights: 8, shadow_maps: 8, ..DirectionalOptions::default() },
        ..Options::default()
    };
    let mut renderer = Renderer::new(Gpu::for_test()?, scene, &options).unwrap();
    renderer.draw(&sky(200), &camera(), 1).unwrap();
    let mut pixels = Vec::new();
    renderer.read_radiance(&mut pixels).unwrap();
    Some(pixels)
}

#[test]
fn a_transform_in_the_material_is_one_of_the_mesh_s_coordinates() {
    let transform = Affine2::from_scale_angle_translation(Vec2::new(2.0, 0.5), 0.4, Vec2::new(0.25, -0.5));
    let Some(picture) = drawn(tiled(transform, transform)) else { return };
    let mut baked = tiled(Affine2::IDENTITY, Affine2::IDENTITY);
    for vertex in &mut baked.meshes[0].vertices {
        vertex.uv = transform.transform_point2(vertex.uv.into()).to_array();
    }
    let differences = |a: &[[f32; 4]], b: &[[f32; 4]]| {
        a.iter().zip(b).filter(|(a, b)| (0..3).any(|i| (a[i] - b[i]).abs() > 1e-2)).count()
    };
    // Rounding moves the edge of a hole by a pixel here and there.
    let baked = drawn(baked).unwrap();
    assert!(differences(&picture, &baked) < 20, "{}", differences(&picture, &baked));
    // Each texture has its own.
    for other in [tiled(transform, Affine2::IDENTITY), tiled(Affine2::IDENTITY, transform)] {
        assert!(differences(&picture, &drawn(other).unwrap()) > 200);
    }
}
