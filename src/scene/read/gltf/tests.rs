use crate::error::Kind;
use crate::scene::built_in_tests::assert_sound;
use crate::scene::*;
use base64::Engine;
use glam::{Mat4, Quat, Vec3};
use serde_json::{Value, json};
use std::fs;

/// A document whose accessors are added one by one, each with a view of its own.
pub(super) struct Document {
    pub(super) json: Value,
    pub(super) binary: Vec<u8>,
}

impl Document {
    pub(super) fn accessor(
        &mut self,
        component_type: u32,
        dimensions: &str,
        count: usize,
        bytes: &[u8],
    ) -> usize {
        let offset = self.binary.len();
        self.binary.extend_from_slice(bytes);
        while !self.binary.len().is_multiple_of(4) {
            self.binary.push(0);
        }
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }));
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(json!({
            "bufferView": accessors.len(), "componentType": component_type, "type": dimensions, "count": count,
            "min": [0, 0, 0], "max": [1, 1, 1]
        }));
        accessors.len() - 1
    }

    pub(super) fn floats(&mut self, dimensions: &str, values: &[f32]) -> usize {
        let size = match dimensions {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            _ => 4,
        };
        self.accessor(5126, dimensions, values.len() / size, bytemuck::cast_slice(values))
    }

    /// A triangle in the plane z = 0 that faces +Z, at node 0; accessor 0 holds positions, accessor 1
    /// indices.
    pub(super) fn triangle() -> Self {
        let mut document = Self {
            json: json!({
                "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
                "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
                "materials": [], "bufferViews": [], "accessors": [], "animations": []
            }),
            binary: Vec::new(),
        };
        document.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        document.accessor(5123, "SCALAR", 3, bytemuck::cast_slice(&[0_u16, 1, 2]));
        document
    }

    /// The document as a `.gltf` with its data in a URI.
    pub(super) fn text(&self) -> String {
        let mut json = self.json.clone();
        let data = base64::engine::general_purpose::STANDARD.encode(&self.binary);
        json["buffers"] = json!([{
            "byteLength": self.binary.len(), "uri": format!("data:application/octet-stream;base64,{data}")
        }]);
        json.to_string()
    }

    /// The document as a `.glb`.
    pub(super) fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.binary.len() }]);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + text.len() + 8 + self.binary.len();
        let mut bytes = b"glTF".to_vec();
        bytes.extend([2, total as u32, text.len() as u32].map(u32::to_le_bytes).concat());
        bytes.extend_from_slice(b"JSON");
        bytes.extend_from_slice(&text);
        bytes.extend((self.binary.len() as u32).to_le_bytes());
        bytes.extend_from_slice(b"BIN\0");
        bytes.extend_from_slice(&self.binary);
        bytes
    }

    pub(super) fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    pub(super) fn animate(&mut self, path: &str, interpolation: &str, times: &[f32], values: &[f32]) {
        let input = self.floats("SCALAR", times);
        let output = self.floats(if path == "rotation" { "VEC4" } else { "VEC3" }, values);
        self.json["animations"].as_array_mut().unwrap().push(json!({
            "samplers": [{ "input": input, "output": output, "interpolation": interpolation }],
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": path } }]
        }));
    }
}

pub(super) fn load_bytes(name: &str, bytes: &[u8]) -> crate::error::Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    let outcome = Scene::load(&path);
    if let Err(error) = &outcome {
        assert_eq!(error.kind(), Kind::Usage);
        assert!(error.to_string().starts_with(path.to_str().unwrap()), "{error}");
    }
    outcome
}

fn load(document: &Document) -> Scene {
    let scene = load_bytes("a.gltf", document.text().as_bytes()).unwrap();
    assert_sound(&scene);
    assert_eq!(load_bytes("a.bin", &document.glb()).unwrap(), scene, "GLB and text say the same");
    scene
}

fn pose(scene: &Scene, time_s: f64) -> Mat4 {
    let mut pose = Pose::default();
    scene.pose(time_s, &mut pose);
    pose.world_from_mesh()[0]
}

#[test]
fn without_normals_and_material_a_triangle_is_flat_and_of_the_default_material() {
    let scene = load(&Document::triangle());
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.indices, [0, 1, 2]);
    assert!(mesh.vertices.iter().all(|v| v.normal == [0.0, 0.0, 1.0] && v.colour == [1.0; 4]));
    assert_eq!(scene.materials[0].shading, Shading::MetalRough { metallic: 1.0, roughness: 1.0 });
    assert_eq!(mesh.bounds, Bounds { min: Vec3::ZERO, max: Vec3::new(1.0, 1.0, 0.0) });
    assert!(!scene.is_animated() && scene.duration_s() == 0.0 && scene.notes.len() == 1);
}

#[test]
fn a_file_s_animation_turns_half_way_in_half_the_time() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let mut document = Document::triangle();
    document.animate("rotation", "LINEAR", &[0.0, 2.0], &[0.0, 0.0, 0.0, 1.0, 0.0, half, 0.0, half]);
    document.animate("translation", "STEP", &[0.0, 1.0], &[0.0, 0.0, 0.0, 5.0, 0.0, 0.0]);
    let zeros = [0.0; 3];
    let scales = [zeros, [1.0; 3], zeros, zeros, [3.0; 3], zeros].concat();
    document.animate("scale", "CUBICSPLINE", &[0.0, 4.0], &scales);
    let scene = load(&document);
    assert_eq!(scene.duration_s(), 4.0);
    // At half its duration a spline with zero tangents is half-way; the step animation is at the start of its
    // second loop.
    let turn = Mat4::from_rotation_y(std::f32::consts::FRAC_PI_4);
    let expected = |scale: f32| turn * Mat4::from_scale(Vec3::splat(scale));
    assert!(pose(&scene, 1.0).abs_diff_eq(expected(1.0 + 2.0 * (3.0 / 16.0 - 2.0 / 64.0)), 1e-5));
    assert!(pose(&scene, 3.0).abs_diff_eq(expected(1.0 + 2.0 * (27.0 / 16.0 - 54.0 / 64.0)), 1e-5));
    assert!(pose(&scene, 2.0).abs_diff_eq(Mat4::from_scale(Vec3::splat(2.0)), 1e-5));
}

#[test]
fn colours_coordinates_sparse_positions_strips_and_normalised_integers_are_read() {
    let mut document = Document::triangle();
    let uv = document.accessor(5123, "VEC2", 3, bytemuck::cast_slice(&[0_u16, 65_535, 0, 0, 65_535, 0]));
    // Three bytes in every four: elements with a gap.
    let colour = document.accessor(5121, "VEC3", 3, &[255, 0, 51, 9, 0, 0, 0, 9, 0, 255, 0, 9]);
    document.json["accessors"][colour]["normalized"] = json!(true);
    document.json["accessors"][uv]["normalized"] = json!(true);
    document.json["bufferViews"][colour]["byteStride"] = json!(4);
    document.primitive()["attributes"] = json!({ "POSITION": 0, "TEXCOORD_0": uv, "COLOR_0": colour });
    document.primitive()["mode"] = json!(5);
    let place = document.accessor(5121, "SCALAR", 1, &[2]);
    let value = document.floats("VEC3", &[0.0, 9.0, 0.0]);
    document.json["accessors"][0]["sparse"] = json!({ "count": 1, "indices": { "bufferView": place, "componentType": 5121 }, "values": { "bufferView": value } });
    let scene = load(&document);
    let vertices = &scene.meshes[0].vertices;
    assert_eq!(vertices[2].position, [0.0, 9.0, 0.0]);
    assert_eq!((vertices[0].uv, vertices[2].uv), ([0.0, 1.0], [1.0, 0.0]));
    assert_eq!((vertices[0].colour, vertices[2].colour), ([1.0, 0.0, 0.2, 1.0], [0.0, 1.0, 0.0, 1.0]));
}

#[test]
fn strips_and_fans_keep_their_front() {
    for (mode, quad) in [(5, [0_u16, 1, 3, 2]), (6, [0, 1, 2, 3])] {
        let mut document = Document::triangle();
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0_f32]];
        let positions = document.floats("VEC3", &corners.concat());
        let indices = document.accessor(5123, "SCALAR", 4, bytemuck::cast_slice(&quad));
        *document.primitive() =
            json!({ "attributes": { "POSITION": positions }, "indices": indices, "mode": mode });
        let scene = load(&document);
        assert_eq!(scene.meshes[0].indices.len(), 6);
        assert!(scene.meshes[0].vertices.iter().all(|vertex| vertex.normal == [0.0, 0.0, 1.0]), "{mode}");
    }
}

#[test]
fn materials_and_their_pictures_are_read_once_for_each_coding() {
    let mut png = Vec::new();
    let picture = image::RgbImage::from_pixel(2, 1, image::Rgb([10, 20, 30]));
    picture.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    let mut document = Document::triangle();
    document.json["images"] = json!([{ "uri": "my%20picture.png" }]);
    document.json["samplers"] = json!([{ "wrapS": 33071, "wrapT": 33648 }]);
    document.json["textures"] = json!([{ "source": 0, "sampler": 0 }]);
    document.json["materials"] = json!([{
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 1.0, 0.75], "metallicFactor": 0.0, "roughnessFactor": 0.5,
            "baseColorTexture": { "index": 0 }, "metallicRoughnessTexture": { "index": 0 }
        },
        "normalTexture": { "index": 0, "scale": 0.5 }, "occlusionTexture": { "index": 0 },
        "emissiveTexture": { "index": 0, "texCoord": 1 }, "emissiveFactor": [0.0, 1.0, 0.0],
        "alphaMode": "MASK", "alphaCutoff": 0.25
    }]);
    document.primitive()["material"] = json!(0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    fs::write(&path, document.text()).unwrap();
    let missing = Scene::load(&path).unwrap_err().to_string();
    assert!(missing.contains("material 0: image 0: `my picture.png`: cannot be read"), "{missing}");
    fs::write(folder.path().join("my picture.png"), &png).unwrap();
    let scene = Scene::load(&path).unwrap();
    let material = &scene.materials[0];
    assert_eq!(scene.textures.len(), 2, "as colours and as numbers");
    assert_eq!((material.base_colour_texture, material.metallic_roughness_texture), (Some(0), Some(1)));
    assert_eq!(
        (material.normal_texture, material.normal_scale, material.emissive_texture),
        (Some(1), 0.5, None)
    );
    assert_eq!((material.base_colour, material.alpha_cutoff), ([0.5, 0.25, 1.0, 0.75], Some(0.25)));
    assert!(scene.textures[0].is_srgb && !scene.textures[1].is_srgb);
    assert_eq!(
        (scene.textures[1].wrap_u, scene.textures[1].wrap_v),
        (Wrap::ClampToEdge, Wrap::MirroredRepeat)
    );
    assert_eq!(scene.textures[0].rgba8, [10, 20, 30, 255, 10, 20, 30, 255]);
    let notes = scene.notes.join("; ");
    assert!(
        notes.contains("occlusion textures left out") && notes.contains("second texture coordinates"),
        "{notes}"
    );
    fs::write(folder.path().join("my picture.png"), &png[..50]).unwrap();
    assert!(Scene::load(&path).unwrap_err().to_string().contains("is it complete?"));
}

#[test]
fn the_first_perspective_camera_looks_at_the_scene_from_its_node() {
    let mut document = Document::triangle();
    document.json["cameras"] = json!([
        { "type": "orthographic", "orthographic": { "xmag": 1.0, "ymag": 1.0, "zfar": 2.0, "znear": 0.0 } },
        { "type": "perspective", "perspective": { "yfov": 0.5, "znear": 0.125 } }
    ]);
    document.json["nodes"] = json!([
        { "mesh": 0, "children": [1] }, { "camera": 0, "children": [2] },
        { "camera": 1, "translation": [0.5, 0.5, 4.0], "scale": [2.0, 2.0, 2.0] }
    ]);
    let camera = load(&document).camera.unwrap();
    assert_eq!(
        (camera.eye, camera.target, camera.up),
        (Vec3::new(0.5, 0.5, 4.0), Vec3::new(0.5, 0.5, 0.0), Vec3::Y)
    );
    assert_eq!((camera.vertical_fov_rad, camera.near), (0.5, 0.125));
    document.json["nodes"] = json!([{ "mesh": 0 }, { "camera": 1 }]);
    assert_eq!(load(&document).camera, None, "its node is not in the scene");
}

#[test]
fn mirrored_nodes_have_a_negative_determinant_and_bounds_all_the_same() {
    let mut document = Document::triangle();
    document.json["nodes"] = json!([{ "mesh": 0, "scale": [-2.0, 1.0, 1.0] }]);
    let scene = load(&document);
    let matrix = pose(&scene, 0.0);
    assert_eq!(matrix.determinant(), -2.0);
    let mut posed = Pose::default();
    scene.pose(0.0, &mut posed);
    assert_eq!(
        scene.bounds(&posed),
        Bounds { min: Vec3::new(-2.0, 0.0, 0.0), max: Vec3::new(0.0, 1.0, 0.0) }
    );
    // The same as a matrix.
    document.json["nodes"] =
        json!([{ "mesh": 0, "matrix": [-2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] }]);
    assert_eq!(pose(&load(&document), 0.0), matrix);
    // The same as a rotation that is not of unit length.
    document.json["nodes"] = json!([{ "mesh": 0, "rotation": [0.0, 0.0, 3.0, 4.0] }]);
    let turned = Mat4::from_quat(Quat::from_xyzw(0.0, 0.0, 0.6, 0.8));
    assert!(pose(&load(&document), 0.0).abs_diff_eq(turned, 1e-6));
}

#[test]
fn attributes_that_only_their_makers_know_do_no_harm() {
    let mut document = Document::triangle();
    let plain = load(&document);
    document.primitive()["attributes"]["_BATCHID"] = json!(0);
    document.json["nodes"][0]["extras"] = json!({ "made by": ["hand"] });
    assert_eq!(load(&document), plain);
}

#[test]
fn extras_give_roles_to_a_node_and_all_below_it() {
    let mut document = Document::triangle();
    let extras = |roles: Value| json!({ "lightcast": { "roles": roles } });
    document.json["nodes"] = json!([
        { "mesh": 0, "name": "real", "children": [1, 2], "extras": extras(json!(["casts"])) },
        { "mesh": 0 },
        { "mesh": 0, "extras": extras(json!(["seen", "receives"])) },
        { "mesh": 0, "extras": { "lightcast": 7 } },
    ]);
    document.json["scenes"][0]["nodes"] = json!([0, 3]);
    let scene = load(&document);
    let roles: Vec<Roles> = scene.instances.iter().map(|instance| instance.roles).collect();
    assert_eq!(roles, [Roles::HELD_OUT, Roles::HELD_OUT, Roles::NO_SHADOW, Roles::ALL]);
    assert_eq!(scene.node_names, ["real", "", "", ""]);
    for (wrong, about) in [(json!("casts"), "no list of names"), (json!(["cast"]), "`cast` is no role")] {
        document.json["nodes"][1]["extras"] = extras(wrong);
        let error = load_bytes("a.gltf", document.text().as_bytes()).unwrap_err().to_string();
        assert!(error.contains("node 1: extras.lightcast.roles: ") && error.contains(about), "{error}");
    }
}
