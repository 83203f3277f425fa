//! Instances that are held out, invisible, cast no shadows or receive none.

use super::test_scenes::*;
use super::{DirectionalOptions, Options, Renderer};
use crate::gpu::Gpu;
use crate::scene::{Material, Roles, Scene};

const SIZE: [u32; 2] = [96, 72];

/// The sphere of [`sphere_on_ground`] and the ground, each with roles.
fn scene_with(sphere: Roles, ground: Roles) -> Scene {
    let mut scene = sphere_on_ground(Material { emissive: [0.1, 0.0, 0.0], ..metal(0.4) });
    (scene.instances[0].roles, scene.instances[1].roles) = (sphere, ground);
    scene
}

fn drawn(sphere: Roles, ground: Roles, samples: u32) -> Option<Vec<[f32; 4]>> {
    let options = Options {
        width_px: SIZE[0],
        height_px: SIZE[1],
        ground_albedo: 0.3,
        directional: DirectionalOptions { lights: 24, shadow_maps: 24, ..DirectionalOptions::default() },
        ..Options::default()
    };
    let mut renderer = Renderer::new(Gpu::for_test()?, scene_with(sphere, ground), &options).unwrap();
    renderer.draw(&sky(200), &camera(), samples).unwrap();
    let mut pixels = Vec::new();
    renderer.read_radiance(&mut pixels).unwrap();
    Some(pixels)
}

#[test]
fn object_and_ground_drawn_apart_add_up_to_the_picture_of_both() {
    // The object hides the ground behind it, as alpha indicates. With one sample a pixel shows one or the
    // other; with several the sum is exact except for the pixels at the object's edge, in which both are
    // visible.
    for samples in [1, 16] {
        let Some(both) = drawn(Roles::ALL, Roles::NO_SHADOW, samples) else { return };
        let object = drawn(Roles::ALL, Roles::NONE, samples).unwrap();
        let ground = drawn(Roles::HELD_OUT, Roles::NO_SHADOW, samples).unwrap();
        let (mut edge, mut covered) = (0, 0);
        for ((both, object), ground) in both.iter().zip(&object).zip(&ground) {
            let is_edge = object[3] > 1e-6 && object[3] < 1.0 - 1e-6;
            edge += usize::from(is_edge);
            covered += usize::from(object[3] > 0.5);
            for channel in 0..4 {
                let sum = object[channel] + (1.0 - object[3]) * ground[channel];
                let difference = (both[channel] - sum).abs();
                assert!(is_edge || difference <= 2e-6 * both[channel].max(1.0), "{both:?} {sum}");
            }
        }
        assert!((500..3000).contains(&covered) && edge < covered / 2, "{covered} {edge}");
        assert_eq!(edge > 0, samples > 1);
    }
}

#[test]
fn what_is_held_out_casts_what_it_casts_when_it_is_seen() {
    let Some(held_out) = drawn(Roles::HELD_OUT, Roles::NO_SHADOW, 1) else { return };
    let both = drawn(Roles::ALL, Roles::NO_SHADOW, 1).unwrap();
    let object = drawn(Roles::ALL, Roles::NONE, 1).unwrap();
    let open = drawn(Roles::NONE, Roles::NO_SHADOW, 1).unwrap();
    let mut shadowed = 0;
    for (index, pixel) in held_out.iter().enumerate() {
        if object[index][3] == 0.0 {
            assert_eq!(*pixel, both[index]);
        }
        shadowed += usize::from(pixel[1] < 0.7 * open[index][1]);
    }
    assert!(shadowed > 100, "{shadowed}");
    // There is no trace of the object itself, which emits red.
    assert!(held_out.iter().all(|[r, g, _, _]| *r <= 2.0 * g));
}

#[test]
fn without_the_role_no_shadow_is_cast_or_received() {
    let Some(open) = drawn(Roles::NONE, Roles::NO_SHADOW, 1) else { return };
    let object = drawn(Roles::ALL, Roles::NONE, 1).unwrap();
    let deaf = Roles { receives: false, ..Roles::NO_SHADOW };
    let pictures =
        [drawn(Roles::NO_SHADOW, Roles::NO_SHADOW, 1).unwrap(), drawn(Roles::ALL, deaf, 1).unwrap()];
    for picture in pictures {
        for (index, pixel) in picture.iter().enumerate() {
            if object[index][3] == 0.0 {
                assert_eq!(*pixel, open[index]);
            }
        }
    }
}
