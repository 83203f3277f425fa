//! Scenes as others' programs write them: read as their plain forms are.

use super::fault;
use lightcast::scene::{Pose, Scene};

/// The scene of a file, and its notes.
fn scene(name: &str) -> Option<Scene> {
    Some(Scene::load(&fault(&format!("scene/{name}"))?).unwrap_or_else(|error| panic!("{error}")))
}

/// Positions of all corners of all triangles, and the colour of each mesh.
fn shape(scene: &Scene) -> (Vec<[f32; 3]>, Vec<[f32; 4]>) {
    let corners = scene
        .meshes
        .iter()
        .flat_map(|mesh| mesh.indices.iter().map(|index| mesh.vertices[*index as usize].position));
    let colours = scene.meshes.iter().map(|mesh| scene.materials[mesh.material].base_colour);
    (corners.collect(), colours.collect())
}

#[test]
fn marks_encodings_continued_lines_and_several_libraries_change_nothing() {
    let Some(plain) = scene("o_plain.obj") else { return };
    for name in ["o_bom.obj", "o_latin1.obj", "o_mtllatin.obj", "o_cont.obj", "o_twolibs.obj"] {
        let read = scene(name).unwrap();
        assert_eq!(shape(&read), shape(&plain), "{name}: {:?}", read.notes);
        assert!(read.notes.is_empty(), "{name}: {:?}", read.notes);
    }
}

#[test]
fn options_of_textures_stand_before_their_names() {
    let Some(read) = scene("o_map2.obj") else { return };
    let material = &read.materials[read.meshes[0].material];
    assert!(material.base_colour_texture.is_some(), "{:?}", read.notes);
    assert_eq!(material.base_colour_uv.matrix2.x_axis.x, 2.0);
    let mut pose = Pose::default();
    read.pose(0.0, &mut pose);
}

/// The area of all triangles.
fn area(scene: &Scene) -> f32 {
    let (corners, _) = shape(scene);
    let area = |[a, b, c]: &[[f32; 3]; 3]| {
        let [a, b, c] = [a, b, c].map(|corner| glam::Vec3::from(*corner));
        0.5 * (b - a).cross(c - a).length()
    };
    corners.as_chunks::<3>().0.iter().map(area).sum()
}

#[test]
fn concave_faces_cover_what_their_triangles_cover() {
    let Some(concave) = scene("o_concave.obj") else { return };
    let triangles = scene("o_concave_tri.obj").unwrap();
    let (found, expected) = (area(&concave), area(&triangles));
    assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    assert!(concave.notes.is_empty(), "{:?}", concave.notes);
}

#[test]
fn ply_files_may_have_blank_lines_and_numbers_of_any_form() {
    let Some(plain) = scene("p_plain.ply") else { return };
    for name in ["p_blank.ply", "p_dot1.ply"] {
        let read = scene(name).unwrap();
        assert_eq!(shape(&read), shape(&plain), "{name}");
        assert!(read.notes.is_empty(), "{name}: {:?}", read.notes);
    }
    // Its normals are.
    let read = scene("p_nan.ply").unwrap();
    assert_eq!(shape(&read), shape(&plain));
    assert!(
        read.notes.iter().any(|note| note.contains("5 vertices have no usable normal")),
        "{:?}",
        read.notes
    );
}
