//! Files of scenes: which kind one is, what it may refer to, and how much of it is read.

use super::{Scene, gltf_file, obj_file, ply_file};
use crate::error::{Error, Result};
use crate::rt;
use glam::Mat4;
use lightcast_core::math;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

/// Bytes that a scene's files have together at most.
pub const MAX_BYTES: u64 = 1 << 30;

/// Vertices of a scene at most (800 MB), after those that share a place but not a normal were told apart.
pub const MAX_VERTICES: usize = 1 << 24;

/// Triangles of a scene's meshes at most, each mesh counted once.
pub const MAX_TRIANGLES: usize = 1 << 24;

/// Largest coordinate, in the world at time 0: its square, and that of its square, still are f32.
pub const MAX_COORDINATE: f32 = 1e9;

impl Scene {
    /// Reads a scene.
    ///
    /// | file | what is read |
    /// |---|---|
    /// | glTF 2.0, `.glb` or `.gltf` | the default scene: meshes, metal-rough materials, textures, animation of nodes, the first camera |
    /// | Wavefront `.obj` | polygons, normals, texture coordinates, vertex colours; of `.mtl` `Kd`, `Ks`, `Ns`, `Ke`, `d`, `map_Kd` |
    /// | `.ply`, ascii or binary | polygons, normals, texture coordinates, vertex colours |
    ///
    /// glTF and PLY files are known by their first bytes, OBJ files, which have none of their own, by their name.
    /// Units and axes are taken as they are. What files refer to lies in their folder or below it. What is left out
    /// stands in [`Scene::notes`].
    ///
    /// # Errors
    ///
    /// Of kind [`Usage`](crate::error::Kind::Usage), naming the file: missing, empty, truncated, damaged, of no
    /// known kind, larger than the limits of this module, without a triangle; references to files that are missing
    /// or lie elsewhere; indices of what is not there; numbers that are not finite; trees with cycles. No content of
    /// a file panics.
    pub fn load(path: &Path) -> Result<Self> {
        contained(|| load_by_kind(path)).map_err(|error| error.at(path.display()))
    }
}

/// Runs a reader; its panic becomes an error. `gltf` 1.4, `tobj` 4.0 and the decoders of `image` 0.25 index and
/// unwrap what damaged files say. Nothing of theirs outlives the call.
pub(super) fn contained<T>(read: impl FnOnce() -> Result<T>) -> Result<T> {
    rt::contained(read)
        .unwrap_or_else(|cause| Err(Error::usage(format!("is damaged: its reader gave up with `{cause}`"))))
}

fn load_by_kind(path: &Path) -> Result<Scene> {
    let mut files =
        Files { folder: path.parent().map(Path::to_path_buf).unwrap_or_default(), bytes_left: MAX_BYTES };
    let bytes = files.read_path(path)?;
    let has_extension =
        |wanted: &str| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(wanted));
    let first = bytes.trim_ascii_start().first();
    let scene = match bytes.as_slice() {
        [] => return Err(Error::usage("is empty")),
        [b'g', b'l', b'T', b'F', ..] => gltf_file::read(&bytes, files)?,
        [b'p', b'l', b'y', b'\n' | b'\r', ..] => ply_file::read(&bytes)?,
        _ if first == Some(&b'{') || has_extension("gltf") => gltf_file::read(&bytes, files)?,
        _ if has_extension("obj") => obj_file::read(&bytes, files)?,
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

/// Refuses scenes in which nothing can be seen.
fn check_whole(scene: &Scene) -> Result<()> {
    if scene.instances.is_empty() {
        let notes =
            if scene.notes.is_empty() { String::new() } else { format!(": {}", scene.notes.join("; ")) };
        return Err(Error::usage(format!("has no triangle to show{notes}")));
    }
    let mut world_from_mesh = Vec::new();
    scene.pose(0.0, &mut world_from_mesh);
    let bounds = scene.bounds(&world_from_mesh);
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    if largest.is_nan() || largest > MAX_COORDINATE || world_from_mesh.contains(&Mat4::ZERO) {
        return Err(Error::usage(format!(
            "reaches from {} to {}; coordinates are read up to {MAX_COORDINATE:e}: scale it down",
            bounds.min, bounds.max
        )));
    }
    Ok(())
}

/// What a scene's files may still take.
pub(super) struct Budget {
    vertices: usize,
    triangles: usize,
}

impl Default for Budget {
    fn default() -> Self {
        Self { vertices: MAX_VERTICES, triangles: MAX_TRIANGLES }
    }
}

impl Budget {
    /// Takes a mesh from what is left, before anything is allocated for it.
    pub(super) fn take(&mut self, vertices: usize, triangles: usize) -> Result<()> {
        match (self.vertices.checked_sub(vertices), self.triangles.checked_sub(triangles)) {
            (Some(left), Some(triangles_left)) => {
                (self.vertices, self.triangles) = (left, triangles_left);
                Ok(())
            }
            _ => Err(Error::usage(format!(
                "is said to have {vertices} vertices and {triangles} triangles, with what came before more than the \
                 {MAX_VERTICES} and {MAX_TRIANGLES} that a scene may have"
            ))),
        }
    }
}

/// The folder of a scene, from which files are read by the names that stand in other files.
pub(super) struct Files {
    folder: PathBuf,
    bytes_left: u64,
}

impl Files {
    /// Reads the file `name`, a path relative to the scene's folder with `/` between its parts. Parts that lead out
    /// of the folder are refused, and so are URLs.
    pub(super) fn read(&mut self, name: &str) -> Result<Vec<u8>> {
        let relative = Path::new(name);
        let is_inside =
            relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        let outcome = if name.contains("://") {
            Err(Error::usage("is a URL; fetch the file and refer to it by its name"))
        } else if name.is_empty() || name.contains('\0') {
            Err(Error::usage("is no name of a file"))
        } else if !is_inside {
            Err(Error::usage("leads out of the scene's folder; put the file there"))
        } else {
            self.read_path(&self.folder.join(relative))
        };
        outcome.map_err(|error| error.at(format_args!("`{}`", short(name))))
    }

    fn read_path(&mut self, path: &Path) -> Result<Vec<u8>> {
        let failed = |error: std::io::Error| Error::usage("cannot be read").because(error);
        // Before it is opened: opening a pipe waits for its writer.
        let about = std::fs::metadata(path).map_err(failed)?;
        if !about.is_file() {
            return Err(Error::usage("cannot be read: it is not a file"));
        }
        let mut bytes = Vec::new();
        let file = File::open(path).map_err(failed)?;
        // A file that grows meanwhile stops at the limit, too.
        let read = file.take(self.bytes_left + 1).read_to_end(&mut bytes).map_err(failed)?;
        self.bytes_left = self.bytes_left.checked_sub(read as u64).ok_or_else(|| {
            Error::usage(format!("is too large: a scene's files have at most {MAX_BYTES} bytes together"))
        })?;
        Ok(bytes)
    }
}

/// The beginning of a text from a file, for messages.
pub(super) fn short(text: &str) -> String {
    let mut beginning: String = text.chars().take(80).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().nth(80).is_some() {
        beginning.push_str("...");
    }
    beginning
}

/// Linear value of an sRGB value of a file; what lies outside [0, 1] is cut off.
pub(super) fn linear_from_srgb(value: f32) -> f32 {
    math::linear_from_srgb(value.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("scene");
        std::fs::create_dir_all(inside.join("a")).unwrap();
        std::fs::write(folder.path().join("secret"), b"x").unwrap();
        std::fs::write(inside.join("a/b.bin"), b"1234567").unwrap();
        let mut files = Files { folder: inside.clone(), bytes_left: 10 };
        let mut failure = |name: &str| files.read(name).unwrap_err().to_string();
        let absolute = folder.path().join("secret");
        for name in ["../secret", "a/../../secret", absolute.to_str().unwrap(), ".."] {
            assert!(failure(name).contains("leads out"), "{name}");
        }
        assert!(failure("https://example.com/a.bin").contains("is a URL"));
        assert!(failure("a").contains("not a file"));
        assert!(failure("").contains("no name"));
        assert!(failure("missing.bin").starts_with("`missing.bin`: cannot be read: "));
        assert_eq!(files.read("./a/b.bin").unwrap(), b"1234567");
        assert!(files.read("a/b.bin").unwrap_err().to_string().contains("too large"));
    }

    #[test]
    fn the_budget_is_used_up_by_all_meshes_together() {
        let mut budget = Budget::default();
        budget.take(MAX_VERTICES - 5, 3).unwrap();
        assert!(budget.take(6, 1).is_err());
        budget.take(5, 1).unwrap();
        assert!(budget.take(0, MAX_TRIANGLES).is_err());
    }
}
