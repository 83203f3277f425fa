use super::tests::{Document, load_bytes};
use crate::scene::built_in_tests::assert_sound;
use crate::scene::*;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

fn failure(document: &Document) -> String {
    load_bytes("a.gltf", document.text().as_bytes()).unwrap_err().to_string()
}

#[test]
fn triangles_without_area_and_useless_normals_are_counted() {
    let mut document = Document::triangle();
    let normals = document.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, f32::NAN, 1.0]);
    let indices = document.accessor(5121, "SCALAR", 9, &[0, 0, 1, 0, 1, 2, 2, 1, 2]);
    *document.primitive() = json!({ "attributes": { "POSITION": 0, "NORMAL": normals }, "indices": indices });
    let scene = load_bytes("a.gltf", document.text().as_bytes()).unwrap();
    assert_sound(&scene);
    assert_eq!(scene.meshes[0].indices, [0, 1, 2]);
    assert!(scene.meshes[0].vertices.iter().all(|vertex| vertex.normal == [0.0, 0.0, 1.0]));
    let notes = scene.notes.join("; ");
    assert!(notes.contains("mesh 0, primitive 0: 2 triangles without area left out"), "{notes}");
    assert!(notes.contains("primitive 0: 2 vertices have no usable normal"), "{notes}");
}

#[test]
fn damaged_documents_say_what_is_wrong_and_where() {
    type Change = Box<dyn Fn(&mut Document)>;
    let mut faults: Vec<(&str, Change)> = Vec::new();
    let mut fault = |says, change: Change| faults.push((says, change));
    fault(
        "position of vertex 1 (counted from 0) not finite",
        Box::new(|d| {
            d.binary[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
        }),
    );
    fault("not finite: [inf", Box::new(|d| d.binary[0..4].copy_from_slice(&f32::INFINITY.to_le_bytes())));
    fault("corner 1 of triangle 0 is vertex 7, but there are 3", Box::new(|d| d.binary[38] = 7));
    fault("has no triangle to show", Box::new(|d| d.binary[38] = 0));
    fault("accessor 0: is truncated", Box::new(|d| d.json["accessors"][0]["count"] = json!(4)));
    fault(
        "is said to have 4000000000 vertices",
        Box::new(|d| d.json["accessors"][0]["count"] = json!(4_000_000_000_u64)),
    );
    fault("16777216", Box::new(|d| d.json["accessors"][1]["count"] = json!(1_u64 << 60)));
    fault("0 elements", Box::new(|d| d.json["accessors"][1]["count"] = json!(0)));
    fault("2 indices are no triangles", Box::new(|d| d.json["accessors"][1]["count"] = json!(2)));
    fault("has 3 components, not 2", Box::new(|d| d.primitive()["attributes"]["TEXCOORD_0"] = json!(0)));
    fault("has no indices but", Box::new(|d| d.primitive()["indices"] = json!(0)));
    fault("view 0 has 9999 bytes", Box::new(|d| d.json["bufferViews"][0]["byteLength"] = json!(9999)));
    fault(
        "view 0 has 36 bytes from byte 18446744073709551615",
        Box::new(|d| {
            d.json["bufferViews"][0]["byteOffset"] = json!(u64::MAX);
        }),
    );
    fault(
        "node 0: is damaged: it has two parents or is its own ancestor",
        Box::new(|d| {
            d.json["nodes"] = json!([{ "mesh": 0, "children": [1] }, { "children": [0] }]);
        }),
    );
    fault(
        "has no triangle to show",
        Box::new(|d| {
            d.json["nodes"] = json!([{ "children": [1] }, { "mesh": 0, "children": [0] }]);
            d.json["scenes"] = json!([]);
            d.json.as_object_mut().unwrap().remove("scene");
        }),
    );
    fault(
        "node 2: is damaged: it has two parents",
        Box::new(|d| {
            d.json["nodes"] = json!([{ "mesh": 0, "children": [1, 2] }, { "children": [2] }, {}]);
        }),
    );
    fault(
        "generations",
        Box::new(|d| {
            d.json["nodes"] =
                (0..2000).map(|i| json!({ "mesh": 0, "children": [i + 1] })).chain([json!({})]).collect();
        }),
    );
    fault(
        "nodes or",
        Box::new(|d| {
            let children: Vec<u32> = (1..70_000).collect();
            d.json["nodes"] =
                [json!({ "children": children })].into_iter().chain((1..70_000).map(|_| json!({}))).collect();
        }),
    );
    fault(
        "nodes[0]: is damaged: invalid type: string \"a\"",
        Box::new(|d| d.json["nodes"][0]["mesh"] = json!("a")),
    );
    fault(
        "meshes[0].primitives[0].indices: is damaged: Index out of bounds",
        Box::new(|d| d.primitive()["indices"] = json!(2)),
    );
    fault("is glTF 1.0; 2.0 is read", Box::new(|d| d.json["asset"]["version"] = json!("1.0")));
    fault(
        "is glTF 2.1 (at least 2.1)",
        Box::new(|d| d.json["asset"] = json!({ "version": "2.1", "minVersion": "2.1" })),
    );
    fault("not affine", Box::new(|d| d.json["nodes"][0]["matrix"] = json!([0.5_f32; 16].to_vec())));
    fault("rotation of length zero", Box::new(|d| d.json["nodes"][0]["rotation"] = json!([0, 0, 0, 0])));
    fault(
        "node 0: is damaged: translation or scale not finite",
        Box::new(|d| d.json["nodes"][0]["scale"] = json!([1e39, 1, 1])),
    );
    fault("coordinates are read up to 1e9", Box::new(|d| d.json["nodes"][0]["scale"] = json!([1e12, 1, 1])));
    fault("has no triangle to show", Box::new(|d| d.json["nodes"] = json!([{}])));
    fault(
        "requires extensions that are not read (KHR_draco_mesh_compression)",
        Box::new(|d| {
            d.json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
            d.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
            d.primitive()["extensions"] = json!({ "KHR_draco_mesh_compression": { "bufferView": 0 } });
        }),
    );
    fault(
        "baseColorFactor is [inf",
        Box::new(|d| {
            d.json["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorFactor": [1e39, 1, 1, 1] } }]);
            d.primitive()["material"] = json!(0);
        }),
    );
    fault(
        "animation 0, channel 0: has 2 times but 1 values",
        Box::new(|d| {
            d.animate("scale", "LINEAR", &[0.0, 1.0], &[1.0; 3]);
        }),
    );
    fault("not strictly increasing", Box::new(|d| d.animate("scale", "LINEAR", &[1.0, 1.0], &[1.0; 6])));
    fault("not strictly increasing", Box::new(|d| d.animate("scale", "LINEAR", &[f32::NAN], &[1.0; 3])));
    fault(
        "not strictly increasing",
        Box::new(|d| d.animate("scale", "LINEAR", &[0.0, f32::INFINITY], &[1.0; 6])),
    );
    fault(
        "value 1 (counted from 0) is not finite",
        Box::new(|d| {
            d.animate("translation", "STEP", &[0.0, 1.0], &[0.0, 0.0, 0.0, 0.0, f32::NAN, 0.0]);
        }),
    );
    fault(
        "rotation 0 (counted from 0) has no length",
        Box::new(|d| {
            d.animate("rotation", "STEP", &[0.0], &[0.0; 4]);
        }),
    );
    fault(
        "moves a node that has a matrix",
        Box::new(|d| {
            d.json["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
            d.animate("scale", "STEP", &[0.0], &[1.0; 3]);
        }),
    );
    let unlike: Vec<String> = faults
        .iter()
        .filter_map(|(says, change)| {
            let mut document = Document::triangle();
            change(&mut document);
            let message = failure(&document);
            (!message.contains(says)).then(|| format!("`{says}` expected, but: {message}"))
        })
        .collect();
    assert!(unlike.is_empty(), "{}", unlike.join("\n"));
}

#[test]
fn buffers_that_are_missing_or_short_are_named() {
    let document = Document::triangle();
    let mut json = document.json.clone();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let mut failure = |uri: Value, length: usize| {
        json["buffers"] = json!([{ "byteLength": length, "uri": uri }]);
        fs::write(&path, json.to_string()).unwrap();
        Scene::load(Path::new(&path)).map_err(|error| error.to_string())
    };
    let error = |outcome: Result<Scene, String>| outcome.unwrap_err();
    assert!(error(failure(json!("b.bin"), 44)).contains("buffer 0: `b.bin`: cannot be read"));
    fs::write(folder.path().join("b.bin"), &document.binary).unwrap();
    assert!(failure(json!("b.bin"), 44).is_ok());
    assert!(error(failure(json!("b.bin"), 45)).contains("buffer 0: is truncated: it has 44 of 45 bytes"));
    assert!(error(failure(json!("../b.bin"), 44)).contains("leads out"));
    assert!(error(failure(json!("%2e%2e/b.bin"), 44)).contains("leads out"));
    assert!(error(failure(json!("http://a/b.bin"), 44)).contains("is a URL"));
    assert!(error(failure(json!("%zz"), 44)).contains("is no URI"));
    assert!(error(failure(json!("data:;base64,A*"), 1)).contains("no base64"));
    assert!(error(failure(json!("data:text/plain,abc"), 1)).contains("not one of base64"));
    assert!(error(failure(Value::Null, 44)).contains("neither a URI nor the data"));

    let glb = document.glb();
    for length in [0, 3, 11, 15, 30, glb.len() - 1] {
        assert!(load_bytes("a.glb", &glb[..length]).is_err(), "{length}");
    }
}
