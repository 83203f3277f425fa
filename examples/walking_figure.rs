//! Writes a walking figure as a `.glb`: 13 joints that bend one skin, a walk of one second, and a morph
//! target, a pointed hat, which grows and shrinks. For trials of moving scenes:
//!
//!     cargo run --example walking_figure figure.glb
//!     lightcast render panorama.hdr --scene figure.glb --ground --time 0.25 --output figure.png

use glam::{Quat, Vec3};
use serde_json::{Value, json};
use std::f32::consts::TAU;

/// Names of the joints, each with its parent's number and its place in metres; the figure looks along +Z.
const JOINTS: [(&str, usize, Vec3); 13] = [
    ("hips", 0, Vec3::new(0.0, 0.95, 0.0)),
    ("chest", 0, Vec3::new(0.0, 1.2, 0.0)),
    ("head", 1, Vec3::new(0.0, 1.5, 0.0)),
    ("left shoulder", 1, Vec3::new(0.2, 1.4, 0.0)),
    ("left elbow", 3, Vec3::new(0.22, 1.12, 0.0)),
    ("right shoulder", 1, Vec3::new(-0.2, 1.4, 0.0)),
    ("right elbow", 5, Vec3::new(-0.22, 1.12, 0.0)),
    ("left hip", 0, Vec3::new(0.1, 0.92, 0.0)),
    ("left knee", 7, Vec3::new(0.1, 0.5, 0.0)),
    ("left ankle", 8, Vec3::new(0.1, 0.1, 0.0)),
    ("right hip", 0, Vec3::new(-0.1, 0.92, 0.0)),
    ("right knee", 10, Vec3::new(-0.1, 0.5, 0.0)),
    ("right ankle", 11, Vec3::new(-0.1, 0.1, 0.0)),
];

/// Keys of the walk, the last one equal to the first.
const KEYS: usize = 17;

/// Steps around a limb, and along it.
const STEPS: [usize; 2] = [16, 24];

/// Half the length of a joint's bend, in metres.
const BEND: f32 = 0.06;

#[allow(dead_code, reason = "a test takes the figure from this file, without the program")]
fn main() -> std::io::Result<()> {
    let path = std::env::args_os().nth(1).unwrap_or_else(|| "figure.glb".into());
    std::fs::write(path, walking_figure())
}

/// A part of the skin.
#[derive(Default)]
struct Part {
    positions: Vec<f32>,
    normals: Vec<f32>,
    joints: Vec<u8>,
    weights: Vec<f32>,
    indices: Vec<u16>,
}

impl Part {
    /// A spindle around the line between two points, `radius` thick in the middle of `shape` 0 (an ellipsoid)
    /// or over most of its length (`shape` 1). The second joint takes over around the height `bend_y`.
    fn spindle(&mut self, ends: [Vec3; 2], radius: f32, shape: f32, joints: [u8; 2], bend_y: f32) {
        let first = (self.positions.len() / 3) as u16;
        let axis = (ends[1] - ends[0]).normalize_or(Vec3::Y);
        let (side, other) = axis.any_orthonormal_pair();
        let [around, along] = STEPS;
        for row in 0..=along {
            let t = row as f32 / along as f32;
            let x = 2.0 * t - 1.0;
            // A superellipse: its radius over its length.
            let power = 2.0 + 4.0 * shape;
            let r = radius * (1.0 - x.abs().powf(power)).max(0.0).powf(1.0 / power);
            let slope = x.signum() * x.abs().powf(power - 1.0) / (0.5 * (ends[1] - ends[0]).length());
            for column in 0..around {
                let (sin, cos) = (TAU * column as f32 / around as f32).sin_cos();
                let out = side * cos + other * sin;
                let place = ends[0].lerp(ends[1], t) + out * r;
                let steep = out * (r / radius).powf(power - 1.0) / radius + axis * slope;
                let second = ((bend_y + BEND - place.y) / (2.0 * BEND)).clamp(0.0, 1.0);
                self.positions.extend(place.to_array());
                self.normals.extend(steep.normalize_or(axis * x.signum()).to_array());
                self.joints.extend([joints[0], joints[1], 0, 0]);
                self.weights.extend([1.0 - second, second, 0.0, 0.0]);
            }
        }
        for row in 0..along as u16 {
            for column in 0..around as u16 {
                let next = (column + 1) % around as u16;
                let [a, b] = [row, row + 1].map(|row| first + row * around as u16);
                self.indices.extend([a + column, a + next, b + next, a + column, b + next, b + column]);
            }
        }
    }
}

fn body() -> Part {
    let mut part = Part::default();
    let at = |joint: usize| JOINTS[joint].2;
    let up = |y: f32| Vec3::new(0.0, y, 0.0);
    // A trunk whose upper end belongs to the chest: the second joint is the lower one.
    part.spindle([at(0) - up(0.1), up(1.48)], 0.17, 0.6, [1, 0], 1.1);
    for [upper, lower] in [[3, 4], [5, 6]] {
        let hand = at(lower) - up(0.33);
        part.spindle([at(upper) + up(0.06), hand], 0.05, 1.0, [upper as u8, lower as u8], at(lower).y);
    }
    for [hip, knee, ankle] in [[7, 8, 9], [10, 11, 12]] {
        part.spindle(
            [at(hip) + up(0.08), at(ankle) - up(0.05)],
            0.075,
            1.0,
            [hip as u8, knee as u8],
            at(knee).y,
        );
        let [heel, toe] =
            [Vec3::new(0.0, -0.05, -0.08), Vec3::new(0.0, -0.05, 0.19)].map(|by| at(ankle) + by);
        part.spindle([heel, toe], 0.05, 0.5, [ankle as u8, ankle as u8], 0.0);
    }
    part
}

/// The head, and what the hat adds to its positions.
fn head() -> (Part, Vec<f32>) {
    let mut part = Part::default();
    part.spindle([Vec3::new(0.0, 1.46, 0.01), Vec3::new(0.0, 1.75, 0.01)], 0.11, 0.2, [2, 2], 0.0);
    let hat = part.positions.as_chunks::<3>().0.iter().flat_map(|&[x, y, z]| {
        // A cone on the upper half.
        let share = ((y - 1.62) / 0.13).clamp(0.0, 1.0);
        [-0.75 * x * share, 0.35 * share, -0.75 * z * share]
    });
    let hat = hat.collect();
    (part, hat)
}

/// The rotation of a joint at phase `p` of the walk; the left leg is in front at 0.
fn rotation(joint: usize, p: f32) -> Quat {
    // The right side is half a cycle later.
    let p = if [5, 6, 10, 11, 12].contains(&joint) { p + 0.5 } else { p };
    let cos = (TAU * p).cos();
    let hip = -0.45 * cos;
    // The leg swings forward in the second half of its cycle, and the knee bends meanwhile.
    let knee = 0.1 + 0.9 * (-(TAU * p).sin()).max(0.0).powi(2);
    match joint {
        0 => Quat::from_rotation_y(0.1 * cos),
        1 => Quat::from_rotation_y(-0.2 * cos) * Quat::from_rotation_x(0.06),
        3 | 5 => Quat::from_rotation_x(0.5 * cos),
        4 | 6 => Quat::from_rotation_x(-0.5 + 0.2 * cos),
        7 | 10 => Quat::from_rotation_x(hip),
        8 | 11 => Quat::from_rotation_x(knee),
        9 | 12 => Quat::from_rotation_x(-0.6 * (hip + knee)),
        _ => Quat::IDENTITY,
    }
}

/// The binary chunk, and the parts of the document that say what lies in it.
#[derive(Default)]
struct Data {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Data {
    /// Adds an array of `count` elements; returns the number of its accessor.
    fn add(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        self.views.push(json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }));
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1, "componentType": component, "type": kind, "count": count
        }));
        self.accessors.len() - 1
    }

    fn floats(&mut self, kind: &str, size: usize, values: &[f32]) -> usize {
        let number = self.add(kind, 5126, values.len() / size, bytemuck::cast_slice(values));
        let extreme = |start: f32, choose: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..size).map(|i| values.iter().skip(i).step_by(size).fold(start, |a, b| choose(a, *b))).collect()
        };
        self.accessors[number]["min"] = json!(extreme(f32::INFINITY, f32::min));
        self.accessors[number]["max"] = json!(extreme(f32::NEG_INFINITY, f32::max));
        number
    }

    /// A primitive with one morph target; without `target` it adds nothing: zeros that take no space.
    fn primitive(&mut self, part: &Part, target: Option<&[f32]>, material: usize) -> Value {
        let count = part.positions.len() / 3;
        let target = target.map(|deltas| self.floats("VEC3", 3, deltas)).unwrap_or_else(|| {
            self.accessors.push(json!({
                "componentType": 5126, "type": "VEC3", "count": count, "min": [0, 0, 0], "max": [0, 0, 0]
            }));
            self.accessors.len() - 1
        });
        json!({
            "attributes": {
                "POSITION": self.floats("VEC3", 3, &part.positions),
                "NORMAL": self.floats("VEC3", 3, &part.normals),
                "JOINTS_0": self.add("VEC4", 5121, count, &part.joints),
                "WEIGHTS_0": self.floats("VEC4", 4, &part.weights)
            },
            "indices": self.add("SCALAR", 5123, part.indices.len(), bytemuck::cast_slice(&part.indices)),
            "targets": [{ "POSITION": target }],
            "material": material
        })
    }

    /// The walk: rotations of all joints, the hips' height, the weight of the hat.
    fn walk(&mut self) -> Value {
        let phases: Vec<f32> = (0..KEYS).map(|key| key as f32 / (KEYS - 1) as f32).collect();
        let times = self.floats("SCALAR", 1, &phases);
        let (mut samplers, mut channels) = (Vec::new(), Vec::new());
        let mut channel = |output: usize, node: usize, path: &str| {
            channels.push(json!({ "sampler": samplers.len(), "target": { "node": node, "path": path } }));
            samplers.push(json!({ "input": times, "output": output }));
        };
        for joint in 0..JOINTS.len() {
            let turns: Vec<f32> = phases.iter().flat_map(|p| rotation(joint, *p).to_array()).collect();
            channel(self.floats("VEC4", 4, &turns), joint, "rotation");
        }
        let heights: Vec<f32> =
            phases.iter().flat_map(|p| [0.0, 0.925 - 0.02 * (2.0 * TAU * p).cos(), 0.0]).collect();
        channel(self.floats("VEC3", 3, &heights), 0, "translation");
        let hat: Vec<f32> = phases.iter().map(|p| 0.5 - 0.5 * (TAU * p).cos()).collect();
        channel(self.floats("SCALAR", 1, &hat), JOINTS.len(), "weights");
        json!({ "name": "walk", "samplers": samplers, "channels": channels })
    }
}

/// The figure as a `.glb` file: node 0 to 12 are the joints, node 13 holds the mesh.
pub fn walking_figure() -> Vec<u8> {
    let mut data = Data::default();
    let (head, hat) = head();
    let primitives = [data.primitive(&body(), None, 0), data.primitive(&head, Some(&hat), 1)];
    let binds: Vec<f32> = JOINTS
        .iter()
        .flat_map(|(_, _, place)| glam::Mat4::from_translation(-place).to_cols_array())
        .collect();
    let binds = data.floats("MAT4", 16, &binds);
    let animation = data.walk();
    let mut nodes: Vec<Value> = (0..JOINTS.len())
        .map(|joint| {
            let (name, parent, place) = JOINTS[joint];
            let origin = if joint == 0 { Vec3::ZERO } else { JOINTS[parent].2 };
            let children: Vec<usize> = (1..JOINTS.len()).filter(|child| JOINTS[*child].1 == joint).collect();
            let mut node = json!({ "name": name, "translation": (place - origin).to_array() });
            if !children.is_empty() {
                node["children"] = json!(children);
            }
            node
        })
        .collect();
    nodes.push(json!({ "name": "figure", "mesh": 0, "skin": 0 }));
    let rough = |colour: [f32; 4]| {
        json!({ "pbrMetallicRoughness": {
            "baseColorFactor": colour, "metallicFactor": 0, "roughnessFactor": 0.7
        } })
    };
    let document = json!({
        "asset": { "version": "2.0", "generator": "lightcast, examples/walking_figure.rs" },
        "scene": 0,
        "scenes": [{ "nodes": [0, JOINTS.len()] }],
        "nodes": nodes,
        "meshes": [{ "primitives": primitives, "weights": [0] }],
        "skins": [{ "joints": (0..JOINTS.len()).collect::<Vec<_>>(), "inverseBindMatrices": binds }],
        "animations": [animation],
        "materials": [rough([0.2, 0.35, 0.6, 1.0]), rough([0.75, 0.5, 0.35, 1.0])],
        "accessors": data.accessors,
        "bufferViews": data.views,
        "buffers": [{ "byteLength": data.bytes.len() }]
    });
    glb(document.to_string().into_bytes(), &data.bytes)
}

/// The chunks of a `.glb`.
fn glb(mut text: Vec<u8>, binary: &[u8]) -> Vec<u8> {
    text.resize(text.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + text.len() + 8 + binary.len();
    let number = |n: usize| (n as u32).to_le_bytes();
    [
        &b"glTF"[..],
        &number(2),
        &number(total),
        &number(text.len()),
        b"JSON",
        &text,
        &number(binary.len()),
        b"BIN\0",
        binary,
    ]
    .concat()
}
