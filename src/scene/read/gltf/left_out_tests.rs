//! What is left out does not decide whether the rest loads, and what is a hair wrong is mended.

use super::tests::{Document, load_bytes};
use crate::scene::*;
use glam::{Mat4, Vec2, Vec3};
use lightcast_core::test_data::real_folder;
use serde_json::{Value, json};

fn load(document: &Document) -> Scene {
    load_bytes("a.gltf", document.text().as_bytes()).unwrap()
}

/// Corners of all triangles in the world.
fn corners(scene: &Scene) -> Vec<Vec3> {
    let mut pose = Pose::default();
    scene.pose(0.0, &mut pose);
    let instances = scene.instances.iter().zip(pose.world_from_mesh());
    let corners = instances.flat_map(|(instance, matrix)| {
        let mesh = &scene.meshes[instance.mesh];
        mesh.indices
            .iter()
            .map(|index| matrix.transform_point3(mesh.vertices[*index as usize].position.into()))
    });
    corners.collect()
}

#[test]
fn files_of_other_programs_load_as_the_plain_one() {
    let Some(folder) = real_folder("faults/scene") else { return };
    let load = |name: &str| Scene::load(&folder.join(name));
    let plain = load("g_plain.gltf").unwrap();
    for (name, note) in [
        ("g_notarget", "animations left out"),
        ("g_animptr", "animations left out"),
        ("g_emptyscene", ""),
        ("g_nominmax", ""),
        ("g_webp_used", "textures left out whose pictures are neither PNG nor JPEG"),
        ("g_morphnoview", ""),
        ("g_fac1", "baseColorFactor [1.0000001, 0.3, 0.2, 1.0] clamped"),
        ("g_emis5", "belongs into KHR_materials_emissive_strength"),
        ("g_quant", ""),
        ("g_texxf_req", "extensions left out: KHR_materials_unlit"),
    ] {
        let scene = load(&format!("{name}.gltf")).unwrap_or_else(|error| panic!("{name}: {error}"));
        let notes = scene.notes.join("; ");
        assert!(notes.contains(note) && (!note.is_empty() || scene.notes == plain.notes), "{name}: {notes}");
        let pairs = corners(&scene).into_iter().zip(corners(&plain));
        assert!(pairs.clone().count() == 18 && pairs.clone().all(|(a, b)| a.abs_diff_eq(b, 1e-6)), "{name}");
        let mut expected = plain.materials.clone();
        match name {
            "g_fac1" => expected[0].base_colour[0] = 1.0,
            "g_emis5" => expected[0].emissive = [1.0; 3],
            _ => {}
        }
        assert_eq!((&scene.materials, scene.textures.len()), (&expected, 0), "{name}");
        assert!(!scene.is_animated(), "{name}");
    }
    let refused = load("g_draco.gltf").unwrap_err().to_string();
    assert!(
        refused.contains("requires extensions that are not read (KHR_draco_mesh_compression)"),
        "{refused}"
    );
}

#[test]
fn damage_in_what_is_not_shown_does_no_harm() {
    let mut document = Document::triangle();
    let plain = load(&document);
    let broken = [
        ("scenes", json!({ "nodes": [7], "name": 5 })),
        ("nodes", json!({ "mesh": 9, "children": "none", "skin": -1 })),
        ("meshes", json!({ "primitives": [{ "attributes": { "POSITION": 99 } }] })),
        ("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 55 } } })),
        ("textures", json!({ "source": 4 })),
        ("images", json!([])),
        ("samplers", json!({ "wrapS": 1 })),
        ("skins", json!({})),
        ("cameras", json!(null)),
        ("accessors", json!({ "bufferView": 3, "type": "VEC9" })),
        ("bufferViews", json!({ "buffer": 12 })),
        ("buffers", json!({ "uri": "missing.bin", "byteLength": 10 })),
        ("animations", json!({ "channels": [{ "sampler": 3, "target": { "node": 1, "path": "scale" } }] })),
    ];
    for (list, part) in &broken {
        if document.json[*list].is_null() {
            document.json[*list] = json!([]);
        }
        document.json[*list].as_array_mut().unwrap().push(part.clone());
    }
    // The data of the document goes first.
    let mut json: Value = serde_json::from_str(&document.text()).unwrap();
    json["buffers"].as_array_mut().unwrap().push(json!({ "uri": "missing.bin", "byteLength": 10 }));
    json["asset"] = json!({ "generator": 5 });
    json["extensionsRequired"] = json!(["KHR_draco_mesh_compression", "KHR_materials_unlit"]);
    json["meshes"][1]["extensions"] = json!({ "KHR_draco_mesh_compression": {} });
    json["nodes"][0]["extras"] = json!("anything");
    json["nodes"][0]["name"] = json!(7);
    json["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(77);
    json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_5"] = json!(77);
    json["meshes"][0]["primitives"][0]["attributes"]["COLOUR"] = json!(77);
    json["accessors"][0]["min"] = json!("none");
    let mut scene = load_bytes("a.gltf", json.to_string().as_bytes()).unwrap();
    let note = "without which it is shown: KHR_draco_mesh_compression, KHR_materials_unlit";
    assert!(scene.notes.iter().any(|own| own.contains(note)), "{:?}", scene.notes);
    scene.notes.retain(|own| !own.contains(note));
    assert_eq!(scene, plain);
}

#[test]
fn primitives_without_triangles_are_left_out_whatever_is_in_them() {
    let mut document = Document::triangle();
    let drawn = document.primitive().clone();
    document.json["meshes"][0]["primitives"] = json!([
        { "attributes": { "POSITION": 40 }, "mode": 1, "material": 3 },
        drawn,
        { "attributes": { "NORMAL": 0 }, "indices": 50 },
    ]);
    let scene = load(&document);
    assert_eq!(scene.instances.len(), 1);
    let notes = scene.notes.join("; ");
    assert!(notes.contains("points and lines left out"), "{notes}");
    assert!(notes.contains("primitives without positions left out"), "{notes}");
}

#[test]
fn cameras_that_cannot_be_used_leave_the_place_to_others() {
    let mut document = Document::triangle();
    document.json["cameras"] = json!([
        { "type": "orthographic" }, { "type": "perspective", "perspective": { "yfov": 0.5 } },
        { "type": "perspective", "perspective": { "yfov": 0.5, "znear": 0.125, "zfar": "far" } }
    ]);
    document.json["nodes"] = json!([{ "mesh": 0, "children": [1, 2, 3] }, { "camera": 0 }, { "camera": 1 },
        { "camera": 2, "translation": [0, 0, 4] }]);
    let scene = load(&document);
    assert_eq!(scene.camera.unwrap().eye, Vec3::new(0.0, 0.0, 4.0));
    assert!(scene.notes.join("; ").contains("camera 1 left out"), "{:?}", scene.notes);
}

#[test]
fn channels_keep_their_numbers_when_others_are_left_out() {
    let mut document = Document::triangle();
    document.animate("scale", "STEP", &[0.0], &[2.0; 3]);
    let animation = &mut document.json["animations"][0];
    let kept = animation["channels"][0].clone();
    animation["channels"] = json!([{ "sampler": 9, "target": { "path": "pointer" } }, kept]);
    animation["samplers"].as_array_mut().unwrap().push(json!({ "input": "nothing" }));
    assert_eq!(load(&document).channels.len(), 1);
    document.json["nodes"][0]["matrix"] = json!(Mat4::IDENTITY.to_cols_array().to_vec());
    let error = load_bytes("a.gltf", document.text().as_bytes()).unwrap_err().to_string();
    assert!(error.contains("animation 0, channel 1: moves a node that has a matrix"), "{error}");
}

#[test]
fn chunks_of_other_types_are_skipped() {
    let document = Document::triangle();
    let mut bytes = document.glb();
    bytes.extend(4_u32.to_le_bytes());
    bytes.extend_from_slice(b"MINE1234");
    let length = bytes.len() as u32;
    bytes[8..12].copy_from_slice(&length.to_le_bytes());
    assert_eq!(load_bytes("a.glb", &bytes).unwrap(), load(&document));
}

#[test]
fn textures_are_moved_turned_and_scaled_each_for_itself() {
    let mut png = Vec::new();
    let picture = image::RgbImage::from_pixel(1, 1, image::Rgb([10, 20, 30]));
    picture.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    let mut document = Document::triangle();
    let view = document.accessor(5121, "SCALAR", png.len(), &png);
    // No type: the bytes tell it.
    document.json["images"] = json!([{ "bufferView": view }]);
    document.json["textures"] = json!([{ "source": 0 }]);
    let with = |transform: Value| json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
    document.json["materials"] = json!([{
        "pbrMetallicRoughness": {
            "baseColorTexture": with(json!({ "offset": [0.5, 0.25], "scale": [2, 3], "rotation": 0.5 })),
            "metallicRoughnessTexture": with(json!({ "texCoord": 1 })),
        },
        "normalTexture": with(json!({ "scale": [4, 4], "texCoord": 0 })),
        "emissiveTexture": { "index": 0 }, "emissiveFactor": [0.5, 1, 1.5],
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 8 } },
    }]);
    document.json["materials"][0]["normalTexture"]["texCoord"] = json!(1);
    document.primitive()["material"] = json!(0);
    document.json["extensionsRequired"] = json!(["KHR_texture_transform"]);
    let scene = load(&document);
    let material = &scene.materials[0];
    // Counter-clockwise where v points down.
    let (sin, cos) = 0.5_f32.sin_cos();
    let at = |uv: Vec2| material.base_colour_uv.transform_point2(uv);
    assert!(at(Vec2::X).abs_diff_eq(Vec2::new(0.5 + 2.0 * cos, 0.25 - 2.0 * sin), 1e-6));
    assert!(at(Vec2::Y).abs_diff_eq(Vec2::new(0.5 + 3.0 * sin, 0.25 + 3.0 * cos), 1e-6));
    assert_eq!(material.metallic_roughness_texture, None, "on the second texture coordinates");
    assert_eq!(material.normal_uv.transform_point2(Vec2::ONE), Vec2::splat(4.0));
    assert!(material.normal_texture.is_some(), "its transform says: on the first ones");
    assert_eq!(material.emissive_uv, glam::Affine2::IDENTITY);
    assert_eq!(material.emissive, [4.0, 8.0, 8.0]);
    for (wrong, says) in [(json!({ "scale": [1] }), "scale"), (json!({ "rotation": "left" }), "rotation")] {
        document.json["materials"][0]["normalTexture"] = with(wrong);
        let error = load_bytes("a.gltf", document.text().as_bytes()).unwrap_err().to_string();
        assert!(error.contains("KHR_texture_transform") && error.contains(says), "{error}");
    }
}

#[test]
fn small_integers_stand_for_themselves() {
    let mut document = Document::triangle();
    let positions = document.accessor(5120, "VEC3", 3, &[0, 0, 0, 9, 100, 0, 0, 9, 0, 0xff, 0, 9]);
    let uvs = document.accessor(5123, "VEC2", 3, bytemuck::cast_slice(&[0_u16, 500, 65_535, 0, 1, 2]));
    let normals = document.accessor(5122, "VEC3", 3, bytemuck::cast_slice(&[[0_i16, 0, -32_767, 0]; 3]));
    document.json["accessors"][normals]["normalized"] = json!(true);
    document.json["bufferViews"][normals]["byteStride"] = json!(8);
    document.json["bufferViews"][positions]["byteStride"] = json!(4);
    document.primitive()["attributes"] =
        json!({ "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs });
    document.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let scene = load(&document);
    let vertices = &scene.meshes[0].vertices;
    assert_eq!(
        vertices.iter().map(|v| v.position).collect::<Vec<_>>(),
        [[0.0; 3], [100.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    );
    assert_eq!((vertices[1].uv, vertices[0].normal), ([65_535.0, 0.0], [0.0, 0.0, -1.0]));
}
