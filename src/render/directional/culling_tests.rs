//! Culling by angular regions skips lights, but changes nothing visible.

use crate::gpu::Gpu;
use crate::render::test_scenes::*;
use crate::render::{DirectionalOptions, Options, Renderer};
use crate::scene::Material;

const CULLED: Options = Options {
    width_px: 96,
    height_px: 72,
    directional: DirectionalOptions {
        lights: 300,
        shadow_maps: 72,
        soft_samples: 1,
        count_lights: true,
        ..OPTIONS.directional
    },
    ..OPTIONS
};

#[test]
fn culling_leaves_out_only_what_cannot_be_seen() {
    let Some(gpu) = Gpu::for_test() else { return };
    let material = Material::lambert([0.8, 0.5, 0.3]);
    let mut culled = Renderer::new(gpu, sphere_on_ground(material.clone()), &CULLED).unwrap();
    let Some(gpu) = Gpu::for_test() else { return };
    let options =
        Options { directional: DirectionalOptions { culling: false, ..CULLED.directional }, ..CULLED };
    let mut full = Renderer::new(gpu, sphere_on_ground(material), &options).unwrap();
    let (mut found, mut expected) = (Vec::new(), Vec::new());
    for lights in [sky(300), furnace(300), furnace(7), vec![light(0, glam::Vec3::X, 1.0)]] {
        culled.draw(&lights, &camera(), 1).unwrap();
        full.draw(&lights, &camera(), 1).unwrap();
        culled.read_radiance(&mut found).unwrap();
        full.read_radiance(&mut expected).unwrap();
        let largest = expected.iter().map(|pixel| pixel[1]).fold(0.0, f32::max);
        for (found, expected) in found.iter().zip(&expected) {
            for channel in 0..4 {
                let difference = (found[channel] - expected[channel]).abs();
                assert!(difference <= 2e-6 * largest.max(1.0), "{found:?} {expected:?}");
            }
        }
        let (few, all) = (culled.read_counts().unwrap(), full.read_counts().unwrap());
        assert_eq!((few.pixels, few.shaded), (all.pixels, all.shaded));
        assert_eq!(u64::from(all.looked_at), u64::from(all.pixels) * lights.len() as u64);
        assert!(few.looked_at < all.looked_at);
    }
}

#[test]
fn of_even_lights_a_normal_looks_at_less_than_two_thirds() {
    let Some(gpu) = Gpu::for_test() else { return };
    // Six views together show all normals of a sphere; each perspective view shows nearly half of it.
    let scene = scene(vec![(sphere(48, 0), true)], vec![Material::lambert([0.8; 3])]);
    let mut renderer = Renderer::new(gpu, scene, &CULLED).unwrap();
    for eye in [
        [6.0, 0.1, 0.0],
        [-6.0, 0.1, 0.0],
        [0.1, 6.0, 0.0],
        [0.1, -6.0, 0.0],
        [0.0, 0.1, 6.0],
        [0.0, 0.1, -6.0],
    ] {
        let up = if f32::abs(eye[1]) > 1.0 { glam::Vec3::Z } else { glam::Vec3::Y };
        let camera = crate::scene::Camera { eye: eye.into(), up, ..camera() };
        renderer.draw(&furnace(300), &camera, 1).unwrap();
    }
    let counts = renderer.read_counts().unwrap();
    let all = f64::from(counts.pixels) * 300.0;
    let (gain, most) = (all / f64::from(counts.looked_at), all / f64::from(counts.shaded));
    println!("gain {gain:.3} of at most {most:.3}");
    assert!((1.6..=1.8).contains(&gain), "{gain}");
    assert!((most - 2.0).abs() < 0.02, "{most}");
}
