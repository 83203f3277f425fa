//! A figure with a skin and a morph target, as `examples/walking_figure.rs` writes it: its pose against a slow
//! evaluation of the file, number by number in f64, and its picture.

#![cfg(feature = "render")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../examples/walking_figure.rs"]
mod figure;

use glam::{DMat4, DQuat, DVec3, DVec4, Vec3};
use lightcast::scene::{Pose, Scene};
use serde_json::Value;
use std::f64::consts::TAU;

/// A `.glb` taken apart.
struct Slow {
    json: Value,
    binary: Vec<u8>,
}

impl Slow {
    fn new(glb: &[u8]) -> Self {
        let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        let json = serde_json::from_slice(&glb[20..20 + length]).unwrap();
        Self { json, binary: glb[28 + length..].to_vec() }
    }

    /// All numbers of an accessor; zeros where it has no view.
    fn numbers(&self, accessor: &Value) -> Vec<f64> {
        let accessor = &self.json["accessors"][accessor.as_u64().unwrap() as usize];
        let size = match accessor["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let count = size * accessor["count"].as_u64().unwrap() as usize;
        let Some(view) = accessor["bufferView"].as_u64() else { return vec![0.0; count] };
        let at = self.json["bufferViews"][view as usize]["byteOffset"].as_u64().unwrap() as usize;
        let bytes = &self.binary[at..];
        let number = |i: usize| match accessor["componentType"].as_u64().unwrap() {
            5121 => f64::from(bytes[i]),
            5123 => f64::from(u16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]])),
            _ => f64::from(f32::from_le_bytes(bytes[4 * i..4 * i + 4].try_into().unwrap())),
        };
        (0..count).map(number).collect()
    }

    /// What a channel gives its node at `time`: the two keys around it, and how far it is between them.
    fn channel(&self, node: usize, path: &str, size: usize, time: f64) -> Option<(Vec<f64>, Vec<f64>, f64)> {
        let animation = &self.json["animations"][0];
        let channel = animation["channels"]
            .as_array()
            .unwrap()
            .iter()
            .find(|channel| channel["target"]["node"] == node && channel["target"]["path"] == path)?;
        let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
        let (times, values) = (self.numbers(&sampler["input"]), self.numbers(&sampler["output"]));
        let time = time.rem_euclid(*times.last().unwrap());
        let key = (0..times.len() - 1).rfind(|key| times[*key] <= time).unwrap();
        let share = (time - times[key]) / (times[key + 1] - times[key]);
        let value = |key: usize| values[key * size..(key + 1) * size].to_vec();
        Some((value(key), value(key + 1), share))
    }

    fn world(&self, node: usize, time: f64) -> DMat4 {
        let own = &self.json["nodes"][node];
        let mut place = DVec3::ZERO;
        if let Some(values) = own["translation"].as_array() {
            place = DVec3::from_slice(&values.iter().map(|x| x.as_f64().unwrap()).collect::<Vec<_>>());
        }
        if let Some((a, b, t)) = self.channel(node, "translation", 3, time) {
            place = DVec3::from_slice(&a).lerp(DVec3::from_slice(&b), t);
        }
        let mut turn = DQuat::IDENTITY;
        if let Some((a, b, t)) = self.channel(node, "rotation", 4, time) {
            turn = DQuat::from_slice(&a).slerp(DQuat::from_slice(&b), t);
        }
        let local = DMat4::from_rotation_translation(turn, place);
        let is_child = |parent: &&Value| {
            parent["children"].as_array().is_some_and(|children| children.iter().any(|child| *child == node))
        };
        let parent = self.json["nodes"].as_array().unwrap().iter().position(|parent| is_child(&parent));
        parent.map_or(local, |parent| self.world(parent, time) * local)
    }

    /// Positions and normals of a primitive at `time`, in the world.
    fn vertices(&self, primitive: usize, time: f64) -> Vec<(DVec3, DVec3)> {
        let primitive = &self.json["meshes"][0]["primitives"][primitive];
        let of = |name: &str| self.numbers(&primitive["attributes"][name]);
        let (positions, normals) = (of("POSITION"), of("NORMAL"));
        let (joints, weights) = (of("JOINTS_0"), of("WEIGHTS_0"));
        let deltas = self.numbers(&primitive["targets"][0]["POSITION"]);
        let (a, b, t) = self.channel(13, "weights", 1, time).unwrap();
        let morph = a[0] + (b[0] - a[0]) * t;
        let skin = &self.json["skins"][0];
        let binds = self.numbers(&skin["inverseBindMatrices"]);
        let matrices: Vec<DMat4> = (0..13)
            .map(|joint| {
                let node = skin["joints"][joint].as_u64().unwrap() as usize;
                self.world(node, time) * DMat4::from_cols_slice(&binds[16 * joint..16 * joint + 16])
            })
            .collect();
        (0..positions.len() / 3)
            .map(|vertex| {
                let three = |from: &[f64]| DVec3::from_slice(&from[3 * vertex..3 * vertex + 3]);
                let mut matrix = DMat4::ZERO;
                for i in 4 * vertex..4 * vertex + 4 {
                    matrix += matrices[joints[i] as usize] * weights[i];
                }
                let position = matrix * DVec4::from((three(&positions) + morph * three(&deltas), 1.0));
                let normal = matrix.inverse().transpose().transform_vector3(three(&normals));
                (position.truncate(), normal.normalize_or_zero())
            })
            .collect()
    }
}

fn load(glb: &[u8]) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("figure.glb");
    std::fs::write(&path, glb).unwrap();
    Scene::load(&path).unwrap()
}

#[test]
fn every_vertex_is_where_a_slow_evaluation_of_the_file_has_it() {
    let glb = figure::walking_figure();
    let (scene, slow) = (load(&glb), Slow::new(&glb));
    assert_eq!((scene.figures.len(), scene.skins.len(), scene.duration_s()), (2, 1, 1.0));
    assert!(scene.notes.is_empty(), "{:?}", scene.notes);
    let (mut pose, mut worst) = (Pose::default(), [0.0_f64; 2]);
    for moment in 0..16 {
        let time = 1.37 * f64::from(moment) - 3.0;
        scene.pose(time, &mut pose);
        let mut low = f64::INFINITY;
        for (instance, primitive) in [(0, 0), (1, 1)] {
            let fast = pose.vertices_of(&scene, instance);
            let expected = slow.vertices(primitive, time);
            assert_eq!(fast.len(), expected.len());
            for (vertex, (position, normal)) in fast.iter().zip(expected) {
                let distance = |a: [f32; 3], b: DVec3| Vec3::from(a).as_dvec3().distance(b);
                worst[0] = worst[0].max(distance(vertex.position, position));
                worst[1] = worst[1].max(distance(vertex.normal, normal));
                low = low.min(position.y);
            }
        }
        let bounds = scene.caster_bounds(&pose);
        assert!((f64::from(bounds.min.y) - low).abs() < 1e-5, "{bounds:?} {low}");
    }
    eprintln!("largest difference: positions {:.1e} m, normals {:.1e}", worst[0], worst[1]);
    assert!(worst[0] < 2e-6 && worst[1] < 2e-5, "{worst:?}");
}

#[test]
fn the_figure_walks() {
    let scene = load(&figure::walking_figure());
    let mut pose = Pose::default();
    let mut heights = Vec::new();
    for moment in 0..32 {
        let time = f64::from(moment) / 32.0;
        scene.pose(time, &mut pose);
        let bounds = scene.bounds(&pose);
        // One foot is always near the ground, no foot goes far below it, and the hat comes and goes.
        assert!((-0.05..0.08).contains(&bounds.min.y), "{time}: {bounds:?}");
        let hat = 0.35 * (0.5 - 0.5 * (TAU * time).cos());
        assert!((f64::from(bounds.max.y) - 1.72 - hat).abs() < 0.1, "{time}: {bounds:?}");
        heights.push(bounds.max.z - bounds.min.z);
    }
    let [least, most] = [f32::min, f32::max].map(|choose| heights.iter().copied().reduce(choose).unwrap());
    assert!(most > 1.5 * least && most > 0.7, "strides of {least} to {most} m");
}
