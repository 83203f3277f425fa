//! The reference picture, multisampling, and emissive surfaces.

use super::test_scenes::*;
use super::{DirectionalOptions, Options, Renderer};
use crate::gpu::Gpu;
use crate::scene::Material;
use lightcast_core::light::Light;

const SMALL: Options = Options {
    directional: DirectionalOptions { lights: 8, shadow_maps: 4, shadow_map_px: 128, ..OPTIONS.directional },
    ..OPTIONS
};

fn radiance(renderer: &Renderer) -> Vec<[f32; 4]> {
    let mut pixels = Vec::new();
    renderer.read_radiance(&mut pixels).unwrap();
    pixels
}

fn assert_near(found: &[[f32; 4]], expected: &[[f32; 4]], tolerance: f32) {
    let largest = expected.iter().map(|pixel| pixel[1]).fold(0.0, f32::max);
    for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
        for channel in 0..4 {
            let difference = (found[channel] - expected[channel]).abs();
            assert!(difference <= tolerance * largest.max(1.0), "{index}: {found:?} {expected:?}");
        }
    }
}

#[test]
fn the_reference_is_the_sum_over_its_lights() {
    let Some(gpu) = Gpu::for_test() else { return };
    let mut renderer = Renderer::new(gpu, sphere_on_ground(metal(0.4)), &SMALL).unwrap();
    // The number of lights is not a multiple of the batch, and ids repeat from batch to batch.
    let mut emitters = sky(11);
    emitters.iter_mut().for_each(|light| light.id %= 4);
    for samples in [1, 3] {
        let mut sum = vec![[0.0f32; 4]; SMALL.pixels()];
        for light in &emitters {
            // Each light is drawn alone as a reference: one hard light with its own shadow map.
            renderer.draw_reference(&[*light], &camera(), samples, |_| true).unwrap();
            for (sum, pixel) in sum.iter_mut().zip(radiance(&renderer)) {
                (0..3).for_each(|channel| sum[channel] += pixel[channel]);
                sum[3] = pixel[3];
            }
        }
        let mut progress = Vec::new();
        let mut keep = |done| {
            progress.push(done);
            true
        };
        assert!(renderer.draw_reference(&emitters, &camera(), samples, &mut keep).unwrap());
        assert_eq!(progress, [4, 8, 11]);
        assert_near(&radiance(&renderer), &sum, 3e-6);
        // Returning false after a pass ends the picture, except after the last pass, when it is complete
        // anyway.
        for (last, is_whole) in [(4, false), (8, false), (11, true)] {
            let mut progress = Vec::new();
            let until = |done| {
                progress.push(done);
                done < last
            };
            assert_eq!(renderer.draw_reference(&emitters, &camera(), samples, until).unwrap(), is_whole);
            assert_eq!(progress.last(), Some(&last));
        }
    }
}

#[test]
fn one_light_draws_as_its_reference() {
    let Some(gpu) = Gpu::for_test() else { return };
    let options = Options {
        directional: DirectionalOptions { soft_samples: 1, cone_rad: 0.0, ..SMALL.directional },
        ..SMALL
    };
    let mut renderer = Renderer::new(gpu, sphere_on_ground(metal(0.4)), &options).unwrap();
    let lights = &sky(4)[..];
    renderer.draw(lights, &camera(), 2).unwrap();
    let drawn = radiance(&renderer);
    renderer.draw_reference(lights, &camera(), 2, |_| true).unwrap();
    assert_near(&radiance(&renderer), &drawn, 3e-6);
}

#[test]
fn emission_is_counted_once_and_samples_weigh_one_in_all() {
    let Some(gpu) = Gpu::for_test() else { return };
    // Numbers that half floats represent exactly.
    let glow = [0.5, 0.25, 2.0];
    let material = Material { emissive: glow, ..Material::lambert([0.0; 3]) };
    let plane = scene(vec![(ground(50.0, 0.0, 0), false)], vec![material]);
    let mut renderer = Renderer::new(gpu, plane, &SMALL).unwrap();
    let above = crate::scene::Camera { eye: glam::Vec3::new(0.0, 5.0, 0.0), up: glam::Vec3::Z, ..camera() };
    let dark = Light { irradiance: [0.0; 3], ..light(0, glam::Vec3::Y, 1.0) };
    let lights: [&[Light]; 3] = [&[], &[dark; 3], &sky(9)];
    for samples in [0, 1, 4, 7] {
        for lights in lights {
            renderer.draw(lights, &above, samples).unwrap();
            let drawn = radiance(&renderer);
            renderer.draw_reference(lights, &above, samples, |_| true).unwrap();
            for pixel in drawn.into_iter().chain(radiance(&renderer)) {
                for (found, expected) in pixel.into_iter().zip([0.5, 0.25, 2.0, 1.0]) {
                    assert!((found - expected).abs() < 1e-6, "{samples} samples: {pixel:?}");
                }
            }
        }
    }
}

#[test]
fn samples_smooth_edges_and_keep_the_mean() {
    let Some(gpu) = Gpu::for_test() else { return };
    let mut renderer = Renderer::new(gpu, sphere_on_ground(Material::lambert([0.8; 3])), &SMALL).unwrap();
    let covered = |pixels: &[[f32; 4]]| pixels.iter().map(|pixel| f64::from(pixel[3])).sum::<f64>();
    renderer.draw(&sky(8), &camera(), 1).unwrap();
    let one = covered(&radiance(&renderer));
    renderer.draw(&sky(8), &camera(), 16).unwrap();
    let pixels = radiance(&renderer);
    assert!(pixels.iter().any(|pixel| pixel[3] > 0.1 && pixel[3] < 0.9), "the horizon is smooth");
    assert!((covered(&pixels) / one - 1.0).abs() < 0.01, "{} {one}", covered(&pixels));
}
