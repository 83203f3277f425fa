//! Damaged scene files: whatever their bytes, reading them neither panics nor takes excessive memory.
//!
//! 600 mutations of a small file of each kind, with a fixed seed, as in `corrupt_files.rs`: a few bytes are
//! replaced, and every fourth file is also truncated. In text files the inserted bytes include digits and
//! separators, so that many mutations are still numbers.

#![cfg(feature = "render")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../examples/walking_figure.rs"]
mod figure;

use lightcast::error::Kind;
use lightcast::scene::{Pose, Scene};
use std::fs;
use std::io::Write;
use std::path::Path;

const MUTATIONS: usize = 600;

/// Marsaglia's xorshift64.
struct XorShift(u64);

impl XorShift {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % limit as u64) as usize
    }
}

/// Panics inside libraries are caught. The backtrace of one would map the program's debug information, which
/// would then count as memory of the reader.
fn say_panics_without_backtrace() {
    std::panic::set_hook(Box::new(|panic| eprintln!("{panic}")));
}

/// Largest resident size of this process so far, in MB; `None` where the system does not report it.
fn peak_resident_mb() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? / 1024)
}

/// Computes poses and the bounds of a scene that was read, and checks that all numbers are valid.
fn use_scene(scene: &Scene) {
    let mut pose = Pose::default();
    for time_s in [0.0, 0.3 * scene.duration_s(), scene.duration_s()] {
        scene.pose(time_s, &mut pose);
        assert!(pose.vertices().iter().all(|vertex| vertex.position.iter().all(|x| x.is_finite())));
        assert!(pose.world_from_mesh().iter().all(|matrix| matrix.is_finite()));
    }
    scene.pose(0.0, &mut pose);
    assert!(scene.bounds(&pose).radius().is_finite());
    for mesh in &scene.meshes {
        assert!(mesh.indices.iter().all(|index| (*index as usize) < mesh.vertices.len()));
        assert!(mesh.vertices.iter().all(|vertex| {
            let [x, y, z] = vertex.normal;
            ((x * x + y * y + z * z) - 1.0).abs() < 1e-5 && vertex.position.iter().all(|x| x.is_finite())
        }));
    }
}

/// Reads mutations of `original`; half of the mutations are within its first `head` bytes.
fn survive(name: &str, original: &[u8], head: usize, seed: u64) {
    say_panics_without_backtrace();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let mut random = XorShift(seed);
    let mut readable = 0;
    fs::write(&path, original).unwrap();
    use_scene(&Scene::load(&path).expect("the original is a scene"));
    for mutation in 0..MUTATIONS {
        let mut bytes = original.to_vec();
        for _ in 0..1 + random.below(3) {
            let range = if random.below(2) == 0 { head } else { bytes.len() };
            let at = random.below(range.min(bytes.len()));
            bytes[at] = match random.below(6) {
                0 => bytes[at] ^ (1 << random.below(8)),
                1 => 0xff,
                2 => 0,
                3 => b"0123456789"[random.below(10)],
                4 => b" -./,e\n"[random.below(7)],
                _ => random.below(256) as u8,
            };
        }
        if mutation % 4 == 3 {
            bytes.truncate(random.below(bytes.len()));
        }
        fs::write(&path, &bytes).unwrap();
        match Scene::load(&path) {
            Ok(scene) => {
                readable += 1;
                use_scene(&scene);
            }
            Err(error) => {
                assert_eq!(error.kind(), Kind::Usage);
                assert!(error.to_string().starts_with(path.to_str().unwrap()), "{error}");
            }
        }
    }
    eprintln!("{name}: {readable} of {MUTATIONS} mutations are still scenes");
    if let Some(mb) = peak_resident_mb() {
        eprintln!("{name}: at most {mb} MB resident");
        // The originals take a few kB; all tests of this file share the process.
        assert!(mb < 256, "{name}: {mb} MB");
    }
    assert!(0 < readable && readable < MUTATIONS, "{name}: {readable} of {MUTATIONS}");
}

/// A grid of points on a wave, and its triangles.
fn wave(cells: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let row = cells + 1;
    let points = (0..row * row).map(|i| [(i % row) as f32, (i as f32).sin(), (i / row) as f32]).collect();
    let triangles = (0..cells * cells)
        .map(|cell| cell / cells * row + cell % cells)
        .flat_map(|corner| [[corner, corner + row, corner + row + 1], [corner, corner + row + 1, corner + 1]])
        .collect();
    (points, triangles)
}

#[test]
fn mutated_glb_files_never_panic() {
    let (points, triangles) = wave(6);
    let times = [0.0, 1.0, 2.0_f32];
    let turns = [[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.6, 0.0, 0.8_f32]];
    let mut binary: Vec<u8> = Vec::new();
    let mut ends = vec![0];
    for part in [
        bytemuck::cast_slice(&points),
        bytemuck::cast_slice(&triangles),
        bytemuck::cast_slice(&times),
        bytemuck::cast_slice(&turns),
    ] {
        binary.extend_from_slice(part);
        ends.push(binary.len());
    }
    let view = |i: usize| serde_json::json!({ "buffer": 0, "byteOffset": ends[i], "byteLength": ends[i + 1] - ends[i] });
    let mut text = serde_json::json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
        "nodes": [{ "children": [1, 2], "scale": [1, 2, 1] }, { "mesh": 0 }, { "camera": 0, "translation": [0, 0, 9] }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 }] }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1.0] } }],
        "animations": [{
            "channels": [{ "sampler": 0, "target": { "node": 1, "path": "rotation" } }],
            "samplers": [{ "input": 2, "output": 3, "interpolation": "LINEAR" }]
        }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": points.len(), "min": [0, -1, 0], "max": [6, 1, 6] },
            { "bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": 3 * triangles.len() },
            { "bufferView": 2, "componentType": 5126, "type": "SCALAR", "count": 3 },
            { "bufferView": 3, "componentType": 5126, "type": "VEC4", "count": 3 }
        ],
        "bufferViews": [view(0), view(1), view(2), view(3)],
        "buffers": [{ "byteLength": binary.len() }]
    })
    .to_string()
    .into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let total = 28 + text.len() + binary.len();
    let numbers =
        |values: &[usize]| values.iter().flat_map(|v| (*v as u32).to_le_bytes()).collect::<Vec<u8>>();
    let glb = [
        b"glTF".to_vec(),
        numbers(&[2, total, text.len()]),
        b"JSON".to_vec(),
        text.clone(),
        numbers(&[binary.len()]),
        b"BIN\0".to_vec(),
        binary,
    ]
    .concat();
    survive("a.glb", &glb, 20 + text.len(), 0x9e37_79b9_7f4a_7c15);
}

#[test]
fn mutated_obj_files_never_panic() {
    let (points, triangles) = wave(6);
    let mut text = String::from("o wave\nvn 0 1 0\nvt 0.5 0.5\n");
    points.iter().for_each(|[x, y, z]| text += &format!("v {x} {y} {z}\n"));
    for [a, b, c] in triangles.iter().map(|triangle| triangle.map(|index| index + 1)) {
        text += &format!("f {a}/1/1 {b}/1/1 {c}/1/1\n");
    }
    survive("a.obj", text.as_bytes(), 200, 0x2545_f491_4f6c_dd1d);
}

#[test]
fn mutated_ply_files_never_panic() {
    let (points, triangles) = wave(6);
    for format in ["ascii", "binary_little_endian"] {
        let header = format!(
            "ply\nformat {format} 1.0\ncomment wave\nelement vertex {}\nproperty float x\nproperty float y\nproperty \
             float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
            points.len(),
            triangles.len()
        );
        let mut bytes = header.clone().into_bytes();
        for [x, y, z] in &points {
            match format {
                "ascii" => bytes.extend(format!("{x} {y} {z}\n").bytes()),
                _ => bytes.extend([x, y, z].iter().flat_map(|value| value.to_le_bytes())),
            }
        }
        for triangle in &triangles {
            match format {
                "ascii" => {
                    bytes.extend(format!("3 {} {} {}\n", triangle[0], triangle[1], triangle[2]).bytes())
                }
                _ => {
                    bytes.push(3);
                    bytes.extend(triangle.iter().flat_map(|index| index.to_le_bytes()));
                }
            }
        }
        survive(&format!("{format}.ply"), &bytes, header.len(), 0xd1b5_4a32_d192_ed03);
    }
}

#[test]
fn mutated_figures_never_panic() {
    let glb = figure::walking_figure();
    let text = u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize;
    survive("figure.glb", &glb, 20 + text, 0xbf58_476d_1ce4_e5b9);
}

#[test]
fn mutated_real_files_never_panic() {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let folder = std::env::var_os("LIGHTCAST_DATA").map_or(default, Into::into).join("mesh");
    let Ok(bytes) = fs::read(folder.join("bunny.glb")) else {
        // Not eprintln!, which the test harness swallows when a test passes.
        let line = format!("skipped: mutated_real_files_never_panic: no real data in {}\n", folder.display());
        let _ = std::io::stderr().write_all(line.as_bytes());
        return;
    };
    survive("bunny.glb", &bytes, 1500, 0x94d0_49bb_1331_11eb);
}
