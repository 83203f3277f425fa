use super::tests::{Document, load_bytes};
use crate::scene::*;
use glam::{Mat4, Vec3};
use serde_json::json;

/// The triangle with two joints, nodes 1 and 2: its corners follow the first, the second, and both alike.
fn skinned() -> Document {
    let mut document = Document::triangle();
    let joints = document.accessor(5121, "VEC4", 3, &[0, 9, 9, 9, 1, 0, 0, 0, 0, 1, 0, 0]);
    let weights = document.floats("VEC4", &[1.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 3.0, 3.0, 0.0, -1.0]);
    document.primitive()["attributes"]["JOINTS_0"] = json!(joints);
    document.primitive()["attributes"]["WEIGHTS_0"] = json!(weights);
    document.json["nodes"] = json!([
        { "mesh": 0, "skin": 0, "translation": [0, 50, 0] },
        { "translation": [10, 0, 0], "children": [2] },
        { "translation": [0, 0, 100] }
    ]);
    document.json["scenes"][0]["nodes"] = json!([0, 1]);
    document.json["skins"] = json!([{ "joints": [1, 2] }]);
    document
}

fn load(document: &Document) -> Scene {
    load_bytes("a.gltf", document.text().as_bytes()).unwrap()
}

fn positions(scene: &Scene, time_s: f64) -> Vec<[f32; 3]> {
    let mut pose = Pose::default();
    scene.pose(time_s, &mut pose);
    pose.vertices().iter().map(|vertex| vertex.position).collect()
}

#[test]
fn skins_move_vertices_with_normalised_weights() {
    let mut document = skinned();
    let scene = load(&document);
    assert_eq!(scene.figures.len(), 1);
    assert_eq!(positions(&scene, 0.0), [[10.0, 0.0, 0.0], [11.0, 0.0, 100.0], [10.0, 1.0, 50.0]]);
    // Without normals in the file triangles are flat, however they lie.
    let mut pose = Pose::default();
    scene.pose(0.0, &mut pose);
    let normal = Vec3::new(-100.0, -50.0, 1.0).normalize_or_zero();
    assert!(pose.vertices().iter().all(|vertex| Vec3::from(vertex.normal).abs_diff_eq(normal, 1e-5)));
    assert_eq!(scene.notes, load(&Document::triangle()).notes);

    let bind = Mat4::from_translation(Vec3::new(0.0, 0.0, -100.0)).to_cols_array();
    let binds = document.floats("VEC4", &[Mat4::IDENTITY.to_cols_array(), bind].concat());
    (document.json["accessors"][binds]["type"], document.json["accessors"][binds]["count"]) =
        (json!("MAT4"), json!(2));
    document.json["skins"][0]["inverseBindMatrices"] = json!(binds);
    assert_eq!(positions(&load(&document), 0.0), [[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [10.0, 1.0, 0.0]]);
}

#[test]
fn targets_move_vertices_by_weights_of_mesh_node_and_animation() {
    let mut document = Document::triangle();
    let deltas = document.accessor(5122, "VEC3", 3, bytemuck::cast_slice(&[[0_i16, 0, 7, 0]; 3]));
    document.json["bufferViews"][deltas]["byteStride"] = json!(8);
    document.primitive()["targets"] = json!([{ "POSITION": deltas }, { "TANGENT": 99 }]);
    let height = |document: &Document, time_s: f64| positions(&load(document), time_s)[0][2];
    assert_eq!(height(&document, 0.0), 0.0);
    document.json["meshes"][0]["weights"] = json!([0.5, 1]);
    assert_eq!(height(&document, 0.0), 3.5);
    document.json["nodes"][0]["weights"] = json!([2]);
    assert_eq!(height(&document, 0.0), 14.0);
    let input = document.floats("SCALAR", &[0.0, 1.0]);
    let output = document.floats("SCALAR", &[0.0, 5.0, 1.0, 5.0]);
    document.json["animations"] = json!([{
        "samplers": [{ "input": input, "output": output }],
        "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }]
    }]);
    // A node with a matrix has weights all the same.
    document.json["nodes"][0]["matrix"] = json!(Mat4::IDENTITY.to_cols_array().to_vec());
    assert_eq!(height(&document, 0.25), 1.75);
    document.json["accessors"][output]["count"] = json!(2);
    let error = load_bytes("a.gltf", document.text().as_bytes()).unwrap_err().to_string();
    assert!(error.contains("animation 0, channel 0: has 2 times but 2 values; 2 for each"), "{error}");
}

#[test]
fn skins_that_are_not_used_or_not_in_the_scene_leave_the_mesh_as_it_lies() {
    let mut document = skinned();
    document.json["scenes"][0]["nodes"] = json!([0]);
    let scene = load(&document);
    assert!(scene.figures.is_empty() && scene.skins.is_empty());
    assert!(scene.notes.join("; ").contains("skin 0 left out: a joint of it is not in the scene"));
    document.json["nodes"][0]["skin"] = json!(null);
    document.json["skins"] = json!(["broken"]);
    assert!(load(&document).figures.is_empty());
    // Joints without a skin's mesh: the mesh has no influences.
    let mut document = skinned();
    document.primitive()["attributes"].as_object_mut().unwrap().remove("WEIGHTS_0");
    assert!(load(&document).figures.is_empty());
}

#[test]
fn damaged_skins_and_targets_say_what_is_wrong_and_where() {
    type Change = fn(&mut Document);
    let faults: [(&str, Change); 9] = [
        ("node 0: its mesh follows joint 1 (counted from 0) of skin 0, which has 1", |d| {
            d.json["skins"] = json!([{ "joints": [1] }]);
        }),
        ("node 0: skin 0: has 0 joints", |d| d.json["skins"] = json!([{ "joints": [] }])),
        ("skins[0].joints[1]: is damaged: Index out of bounds", |d| {
            d.json["skins"] = json!([{ "joints": [1, 7] }]);
        }),
        ("has 2 joints but 1 matrices", |d| {
            let binds = d.floats("VEC4", &Mat4::IDENTITY.to_cols_array());
            (d.json["accessors"][binds]["type"], d.json["accessors"][binds]["count"]) =
                (json!("MAT4"), json!(1));
            d.json["skins"][0]["inverseBindMatrices"] = json!(binds);
        }),
        ("the matrix of joint 0 is not affine", |d| {
            let binds = d.floats("VEC4", &[1.0; 32]);
            (d.json["accessors"][binds]["type"], d.json["accessors"][binds]["count"]) =
                (json!("MAT4"), json!(2));
            d.json["skins"][0]["inverseBindMatrices"] = json!(binds);
        }),
        ("weight of vertex 0 (counted from 0) not finite", |d| {
            let at = d.json["bufferViews"][3]["byteOffset"].as_u64().unwrap() as usize;
            d.binary[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
        }),
        ("primitive 0: accessor 3: has 2 elements for 3 positions", |d| {
            d.json["accessors"][3]["count"] = json!(2);
        }),
        ("morph target 0: accessor 0: has 1000000000 elements for 3 positions", |d| {
            let positions = d.json["accessors"][0].clone();
            d.json["accessors"].as_array_mut().unwrap().push(positions);
            d.primitive()["attributes"]["POSITION"] = json!(4);
            d.json["accessors"][0]["count"] = json!(1_000_000_000);
            d.primitive()["targets"] = json!([{ "POSITION": 0 }]);
        }),
        ("16777216 pairs", |d| {
            d.json["accessors"][0]["count"] = json!(4_000_000);
            d.primitive()["targets"] = json!(vec![json!({}); 5]);
        }),
    ];
    for (says, change) in faults {
        let mut document = skinned();
        change(&mut document);
        let error = load_bytes("a.gltf", document.text().as_bytes()).unwrap_err().to_string();
        assert!(error.contains(says), "`{says}` expected, but: {error}");
    }
}
