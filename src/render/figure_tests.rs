//! Figures look like rigid meshes that lie as they do.

use super::test_scenes::*;
use super::{DirectionalOptions, Options, Renderer};
use crate::gpu::Gpu;
use crate::scene::{
    Channel, Deformation, Figure, Influence, Interpolation, Joint, Keys, Material, Mesh, MorphTarget, Node,
    Pose, Scene, Skin, Transform,
};
use glam::{Mat4, Quat, Vec3};

/// The sphere on the ground, whose upper half a joint takes to the side while a target makes it wider.
fn bending() -> Scene {
    let mut scene = sphere_on_ground(Material::lambert([0.6, 0.4, 0.3]));
    scene.nodes.push(Node { parent: None, transform: Transform::IDENTITY });
    let influences = scene.meshes[0].vertices.iter().flat_map(|vertex| {
        let second = (0.5 + 0.5 * vertex.position[1]).clamp(0.0, 1.0);
        [Influence { joint: 0, weight: 1.0 - second }, Influence { joint: 1, weight: second }]
    });
    let wider = scene.meshes[0].vertices.iter().map(|vertex| Vec3::X * vertex.position[0]);
    scene.deformations.push(Deformation {
        influences: influences.collect(),
        targets: vec![MorphTarget { positions: wider.collect(), normals: Vec::new() }],
        is_flat: false,
    });
    let joint = |node| Joint { node, joint_from_mesh: Mat4::IDENTITY };
    scene.skins.push(Skin { joints: vec![joint(0), joint(1)] });
    scene.figures.push(Figure { instance: 0, deformation: 0, skin: Some(0), weights: vec![0.0] });
    let channel = |node, keys| Channel {
        node,
        duration_s: 2.0,
        interpolation: Interpolation::Linear,
        times_s: vec![0.0, 2.0],
        keys,
    };
    scene.channels = vec![
        channel(0, Keys::Weights(vec![0.0, 1.0])),
        channel(1, Keys::Rotation(vec![Quat::IDENTITY, Quat::from_rotation_z(1.0)])),
        channel(1, Keys::Translation(vec![Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)])),
    ];
    scene
}

/// The picture after the scene was posed as at these times.
fn drawn(scene: Scene, times_s: &[f64]) -> Option<Vec<[f32; 4]>> {
    let options = Options {
        width_px: 96,
        height_px: 72,
        directional: DirectionalOptions { lights: 24, shadow_maps: 24, ..DirectionalOptions::default() },
        ..Options::default()
    };
    let mut renderer = Renderer::new(Gpu::for_test()?, scene, &options).unwrap();
    times_s.iter().for_each(|time_s| renderer.pose(*time_s));
    renderer.draw(&sky(200), &camera(), 1).unwrap();
    let mut pixels = Vec::new();
    renderer.read_radiance(&mut pixels).unwrap();
    Some(pixels)
}

#[test]
fn a_figure_and_its_shadow_are_those_of_a_rigid_mesh_that_lies_alike() {
    let Some(figure) = drawn(bending(), &[0.3, 1.4]) else { return };
    let mut rigid = bending();
    let mut pose = Pose::default();
    rigid.pose(1.4, &mut pose);
    rigid.meshes[0] = Mesh::new(pose.vertices().to_vec(), rigid.meshes[0].indices.clone(), 0);
    rigid.figures.clear();
    assert_eq!(figure, drawn(rigid, &[1.4]).unwrap());
    let still = drawn(bending(), &[0.0]).unwrap();
    let moved = figure.iter().zip(&still).filter(|(a, b)| a != b).count();
    assert!(moved > figure.len() / 8, "{moved} of {}", figure.len());
}
