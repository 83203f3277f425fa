//! All shaders, without a GPU.

use super::test_scenes::*;
use super::{DirectionalOptions, Options, Renderer};
use crate::gpu::Gpu;
use crate::gpu::layout::assert_valid;
use crate::scene::{Material, Scene};
use std::collections::BTreeSet;
use std::path::Path;

/// The files of `shaders/` as the passes concatenate them.
const JOINED: [&[&str]; 10] = [
    &["inset"],
    &["scene", "view/surface"],
    &["view/seen", "view/start"],
    &["view/histogram"],
    &["view/adapt"],
    &["view/tone"],
    &["view/seen", "ambient/shade"],
    &["directional/regions"],
    &["directional/light_space", "scene", "directional/shadow"],
    &["view/seen", "brdf", "directional/light_space", "directional/visibility", "directional/shade"],
];

/// Names of the shaders in a folder and below it, without their extension.
fn names_in(folder: &Path, before: &str, names: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = format!("{before}{}", path.file_stem().unwrap().to_str().unwrap());
        if path.is_dir() {
            names_in(&path, &format!("{name}/"), names);
        } else {
            names.insert(name);
        }
    }
}

#[test]
fn every_file_in_shaders_is_valid_where_it_is_joined() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let source = |name: &&str| std::fs::read_to_string(folder.join(name).with_extension("wgsl")).unwrap();
    for names in JOINED {
        assert_valid(&names.concat(), &names.iter().map(source).collect::<String>());
    }
    let mut names = BTreeSet::new();
    names_in(&folder, "", &mut names);
    let known: BTreeSet<String> = JOINED.concat().into_iter().map(str::to_owned).collect();
    assert_eq!(names, known);
}

#[test]
fn a_device_without_a_driver_accepts_every_pipeline_and_binding() {
    for (options, lights) in [
        (Options { width_px: 96, height_px: 72, ..Options::default() }, sky(300)),
        (
            Options {
                directional: DirectionalOptions {
                    culling: false,
                    count_lights: true,
                    clusters: Some(5),
                    ..DirectionalOptions::default()
                },
                ..Options::default()
            },
            sky(300),
        ),
        (
            Options {
                directional: DirectionalOptions {
                    shadow_maps: 0,
                    cone_rad: 0.0,
                    soft_samples: 1,
                    ..DirectionalOptions::default()
                },
                ..Options::default()
            },
            Vec::new(),
        ),
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
            assert_eq!((pixels.len(), picture.len()), (options.pixels(), options.pixels()));
        }
    }
}
