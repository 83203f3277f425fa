//! All shaders, without a GPU.

use super::test_scenes::*;
use super::{Options, Renderer};
use super::{shade, shadow, surface};
use crate::gpu::Gpu;
use crate::gpu::layout::assert_valid;
use crate::scene::{Material, Scene};

/// Source of a file of `shaders/` behind the parts that it needs.
fn joined(name: &str, source: &str) -> String {
    match name {
        "shade.wgsl" => shade::SOURCES.concat(),
        "shadow.wgsl" => shadow::SOURCES.concat(),
        "surface.wgsl" => surface::SOURCES.concat(),
        _ => source.to_owned(),
    }
}

#[test]
fn every_file_in_shaders_is_valid() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        let source = std::fs::read_to_string(&path).unwrap();
        let joined = joined(&name, &source);
        assert!(joined.contains(&source), "{name}: the file is newer than this test");
        assert_valid(&name, &joined);
        names.push(name);
    }
    assert!(names.len() >= 10, "{names:?}");
}

#[test]
fn a_device_without_a_driver_accepts_every_pipeline_and_binding() {
    for (options, lights) in [
        (Options { width_px: 96, height_px: 72, ..Options::default() }, sky(300)),
        (Options { culling: false, count_lights: true, clusters: Some(5), ..Options::default() }, sky(300)),
        (Options { shadow_maps: 0, cone_rad: 0.0, soft_samples: 1, ..Options::default() }, Vec::new()),
    ] {
        for scene in [sphere_on_ground(Material::lambert([0.5; 3])), Scene::default()] {
            let mut renderer = Renderer::new(Gpu::noop(), scene, &options).unwrap();
            renderer.draw(&lights, &camera(), 2).unwrap();
            renderer.draw_reference(&lights, &camera(), 2, |_| true).unwrap();
            let (mut pixels, mut picture) = (Vec::new(), Vec::new());
            renderer.read_radiance(&mut pixels).unwrap();
            renderer.read_picture(0.0, &mut picture).unwrap();
            renderer.read_counts().unwrap();
            renderer.read_times().unwrap();
            renderer.gpu().check().unwrap();
            assert_eq!((pixels.len(), picture.len()), (options.pixels(), 3 * options.pixels()));
        }
    }
}
