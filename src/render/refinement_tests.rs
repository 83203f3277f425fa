use super::budget::Quality;
use super::test_scenes::*;
use super::{DirectionalOptions, Options, Renderer};
use crate::gpu::Gpu;
use crate::scene::Material;

const SMALL: Options = Options {
    width_px: 120,
    height_px: 90,
    directional: DirectionalOptions {
        lights: 24,
        shadow_maps: 24,
        shadow_map_px: 128,
        ..OPTIONS.directional
    },
    ..OPTIONS
};

fn renderer() -> Option<Renderer> {
    let scene = sphere_on_ground(Material::lambert([0.7; 3]));
    Gpu::for_test().map(|gpu| Renderer::new(gpu, scene, &SMALL).unwrap())
}

fn radiance(renderer: &Renderer) -> Vec<[f32; 4]> {
    let mut pixels = Vec::new();
    renderer.read_radiance(&mut pixels).unwrap();
    pixels
}

fn values<'a>(pictures: [&'a [[f32; 4]]; 2]) -> impl Iterator<Item = (f64, f64)> + 'a {
    let [a, b] = pictures.map(|picture| picture.iter().flatten().map(|&v| f64::from(v)));
    a.zip(b)
}

fn most_apart(a: &[[f32; 4]], b: &[[f32; 4]]) -> f64 {
    let largest = values([b, b]).fold(0.0, |most: f64, (v, _)| most.max(v));
    values([a, b]).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) / largest
}

fn rms_apart(a: &[[f32; 4]], b: &[[f32; 4]]) -> f64 {
    (values([a, b]).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64).sqrt()
}

#[test]
fn samples_added_one_by_one_are_those_drawn_at_once() {
    let Some(mut renderer) = renderer() else { return };
    let (lights, camera) = (sky(200), camera());
    renderer.draw(&lights, &camera, 16).unwrap();
    let at_once = radiance(&renderer);
    renderer.draw(&lights, &camera, 4).unwrap();
    let of_four = radiance(&renderer);
    for drawn in 4..16 {
        renderer.refine(&camera, drawn).unwrap();
    }
    let refined = radiance(&renderer);
    assert!(most_apart(&refined, &at_once) < 1e-5, "{}", most_apart(&refined, &at_once));
    assert!(most_apart(&of_four, &at_once) > 1e-2, "the pictures can differ");
}

#[test]
fn a_refined_picture_converges() {
    let Some(mut renderer) = renderer() else { return };
    let (lights, camera) = (sky(200), camera());
    renderer.draw(&lights, &camera, 64).unwrap();
    let converged = radiance(&renderer);
    renderer.draw(&lights, &camera, 1).unwrap();
    let mut errors = vec![rms_apart(&radiance(&renderer), &converged)];
    for drawn in 1..16 {
        renderer.refine(&camera, drawn).unwrap();
        if [4, 16].contains(&(drawn + 1)) {
            errors.push(rms_apart(&radiance(&renderer), &converged));
        }
    }
    println!("1, 4, 16 samples against 64: {errors:?}");
    assert!(errors[1] < 0.7 * errors[0] && errors[2] < 0.7 * errors[1], "{errors:?}");
}

#[test]
fn lower_quality_is_what_was_built_with_fewer_lights_and_maps() {
    let Some(mut renderer) = renderer() else { return };
    let (lights, camera) = (sky(200), camera());
    renderer.draw(&lights, &camera, 1).unwrap();
    let full = radiance(&renderer);
    let fewer = Options {
        directional: DirectionalOptions { lights: 12, shadow_maps: 5, ..SMALL.directional },
        ..SMALL
    };
    let scene = sphere_on_ground(Material::lambert([0.7; 3]));
    let mut built = Renderer::new(Gpu::for_test().expect("there was one above"), scene, &fewer).unwrap();
    built.draw(&lights, &camera, 1).unwrap();
    renderer.set_quality(Quality { lights: 12, shadow_maps: 5 });
    renderer.draw(&lights, &camera, 1).unwrap();
    let lower = radiance(&renderer);
    // Lights that had a tile keep it, so that five other lights may cast shadows: the shadows may differ, but
    // most pixels may not.
    let differs = rms_apart(&lower, &radiance(&built)) / rms_apart(&lower, &full);
    assert!(differs < 1.0, "{differs}");
    assert!(most_apart(&lower, &full) > 1e-2);
    renderer.set_quality(Quality { lights: usize::MAX, shadow_maps: usize::MAX });
    renderer.draw(&lights, &camera, 1).unwrap();
    let again = rms_apart(&radiance(&renderer), &full);
    assert!(again < 1e-3 * rms_apart(&lower, &full), "back to what was reserved: {again}");
}

#[test]
fn a_resized_renderer_draws_what_one_of_that_size_draws() {
    let Some(mut renderer) = renderer() else { return };
    let (lights, camera) = (sky(200), camera());
    renderer.draw(&lights, &camera, 1).unwrap();
    let first = radiance(&renderer);
    renderer.resize(64, 100).unwrap();
    assert_eq!(renderer.size(), [64, 100]);
    renderer.draw(&lights, &camera, 1).unwrap();
    let options = Options { width_px: 64, height_px: 100, ..SMALL };
    let scene = sphere_on_ground(Material::lambert([0.7; 3]));
    let mut built = Renderer::new(Gpu::for_test().expect("there was one above"), scene, &options).unwrap();
    built.draw(&lights, &camera, 1).unwrap();
    assert_eq!(radiance(&renderer), radiance(&built));
    let mut pictures = [Vec::new(), Vec::new()];
    renderer.read_picture(0.0, &mut pictures[0]).unwrap();
    built.read_picture(0.0, &mut pictures[1]).unwrap();
    assert_eq!(pictures[0].len(), 64 * 100);
    assert_eq!(pictures[0], pictures[1]);
    assert!(renderer.resize(0, 100).is_err());
    assert_eq!(renderer.size(), [64, 100]);
    renderer.resize(SMALL.width_px, SMALL.height_px).unwrap();
    renderer.draw(&lights, &camera, 1).unwrap();
    assert_eq!(radiance(&renderer), first);
}
