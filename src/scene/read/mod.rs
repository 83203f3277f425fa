//! Readers of scenes: what kind of file it is, and whether the scene contains anything visible.

mod budget;
mod files;
mod gltf;
#[cfg(test)]
mod mesh_file_tests;
mod notes;
mod obj;
mod plain_text;
mod ply;
mod ply_text;
mod polygon;
mod texture_options;

pub use budget::{MAX_TRIANGLES, MAX_VERTICES};
pub use files::MAX_BYTES;
pub(super) use files::short;

use super::{Pose, Scene};
use crate::error::{Error, Result, without_mark};
use files::{Files, contained};
use glam::Mat4;
use lightcast_core::math;
use std::path::Path;

/// Largest coordinate in the world at time 0: its square and its fourth power are still finite as f32.
pub const MAX_COORDINATE: f32 = 1e9;

impl Scene {
    /// Reads a scene.
    ///
    /// | file | what is read |
    /// |---|---|
    /// | glTF 2.0, `.glb` or `.gltf` | the default scene: meshes, metal-rough materials, textures, animation of nodes, skins and morph targets, the first camera |
    /// | Wavefront `.obj` | polygons, normals, texture coordinates, vertex colours; from `.mtl`: `Kd`, `Ks`, `Ns`, `Ke`, `d`, `map_Kd` |
    /// | `.ply`, ascii or binary | polygons, normals, texture coordinates, vertex colours |
    ///
    /// glTF and PLY files are recognised by their first bytes, OBJ files, which have no signature, by their
    /// name. Units and axes are taken as they are. Files that a scene refers to must lie in its folder or
    /// below it. What is left out is listed in [`Scene::notes`].
    ///
    /// # Errors
    ///
    /// Of kind [`Usage`](crate::error::Kind::Usage), naming the file: missing, empty, truncated, damaged, of
    /// unknown kind, larger than the limits of this module, without a triangle; references to files that are
    /// missing or lie elsewhere; indices out of range; numbers that are not finite; trees with cycles. No
    /// content of a file causes a panic.
    pub fn load(path: &Path) -> Result<Self> {
        contained(|| load_by_kind(path)).map_err(|error| error.at(path))
    }
}

fn load_by_kind(path: &Path) -> Result<Scene> {
    let mut files = Files::beside(path);
    let file = files.read_path(path)?;
    let bytes = without_mark(&file);
    let has_extension =
        |wanted: &str| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(wanted));
    let first = bytes.trim_ascii_start().first();
    let scene = match bytes {
        [] => return Err(Error::usage("is empty")),
        [b'g', b'l', b'T', b'F', ..] => gltf::read(bytes, files)?,
        [b'p', b'l', b'y', b'\n' | b'\r', ..] => ply::read(bytes)?,
        _ if first == Some(&b'{') || has_extension("gltf") => gltf::read(bytes, files)?,
        _ if has_extension("obj") => obj::read(bytes, files)?,
        _ => {
            return Err(Error::usage(format!(
                "is neither glTF nor PLY (it begins with the bytes {:02x?}), nor is it called .obj; give one of these",
                &bytes[..bytes.len().min(8)]
            )));
        }
    };
    check_whole(&scene)?;
    Ok(scene)
}

/// Refuses scenes in which nothing is visible.
fn check_whole(scene: &Scene) -> Result<()> {
    if scene.instances.is_empty() {
        let notes =
            if scene.notes.is_empty() { String::new() } else { format!(": {}", scene.notes.join("; ")) };
        return Err(Error::usage(format!("has no triangle to show{notes}")));
    }
    let mut pose = Pose::default();
    scene.pose(0.0, &mut pose);
    let bounds = scene.bounds(&pose);
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    if largest.is_nan() || largest > MAX_COORDINATE || pose.world_from_mesh().contains(&Mat4::ZERO) {
        return Err(Error::usage(format!(
            "reaches from {} to {}; coordinates are read up to {MAX_COORDINATE:e}: scale it down",
            bounds.min, bounds.max
        )));
    }
    Ok(())
}

/// Linear value of an sRGB value of a file; values outside [0, 1] are clamped.
fn linear_from_srgb(value: f32) -> f32 {
    math::linear_from_srgb(value.clamp(0.0, 1.0))
}
