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
