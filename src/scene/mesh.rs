use super::Bounds;
use crate::error::{Error, Result};
use glam::{DVec3, Vec3};

/// A corner of triangles: 48 bytes without gaps, as a GPU reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Vertex {
    /// In the mesh's frame, in the file's unit. Finite.
    pub position: [f32; 3],
    /// Outward unit vector.
    pub normal: [f32; 3],
    /// Texture coordinates, origin at the top left of the picture, v downwards (as in glTF; v of OBJ and PLY
    /// files is flipped). Zero where a file has none.
    pub uv: [f32; 2],
    /// Linear colour and alpha in [0, 1], a factor on the material's base colour. White where a file has
    /// none.
    pub colour: [f32; 4],
}

/// Triangles of one material in a right-handed frame; seen from the front their corners run
/// counter-clockwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The corners; triangles share them.
    pub vertices: Vec<Vertex>,
    /// Three for each triangle, each below the number of vertices.
    pub indices: Vec<u32>,
    /// Index of the material.
    pub material: usize,
    /// Box around the triangles in the mesh's frame. Vertices that no triangle has do not count.
    pub bounds: Bounds,
}

impl Mesh {
    /// A mesh with its bounds. `indices` has three for each triangle, each below the number of vertices.
    pub fn new(vertices: Vec<Vertex>, indices: Vec<u32>, material: usize) -> Self {
        let corners = indices.iter().map(|index| Vec3::from(vertices[*index as usize].position));
        let bounds = Bounds::of(corners);
        Self { vertices, indices, material, bounds }
    }
}

/// Refuses numbers of a file that are not finite and indices of vertices that do not exist. `place` names the
/// mesh.
pub(super) fn check(vertices: &[Vertex], indices: &[u32]) -> Result<()> {
    if !indices.len().is_multiple_of(3) {
        return Err(Error::usage(format!("{} indices are no triangles", indices.len())));
    }
    if let Some(at) = indices.iter().position(|index| *index as usize >= vertices.len()) {
        return Err(Error::usage(format!(
            "corner {} of triangle {} is vertex {}, but there are {} (counted from 0)",
            at % 3,
            at / 3,
            indices[at],
            vertices.len()
        )));
    }
    for (number, vertex) in vertices.iter().enumerate() {
        let not_finite = |values: &[f32]| values.iter().any(|value| !value.is_finite());
        for (what, values) in [
            ("position", &vertex.position[..]),
            ("texture coordinates", &vertex.uv[..]),
            ("colour", &vertex.colour[..]),
        ] {
            if not_finite(values) {
                return Err(Error::usage(format!(
                    "{what} of vertex {number} (counted from 0) not finite: {values:?}"
                )));
            }
        }
    }
    Ok(())
}

/// Removes the triangles without area from `indices`: those with two coincident corners or with collinear
/// corners. Returns how many there were.
pub(super) fn drop_zero_area(vertices: &[Vertex], indices: &mut Vec<u32>) -> usize {
    let before = indices.len();
    let mut kept = 0;
    for at in (0..before).step_by(3) {
        let triangle = [indices[at], indices[at + 1], indices[at + 2]];
        // Differences of f32 are nearly always exact in f64, and so are their products: no threshold is
        // needed.
        if double_area(corners(vertices, triangle)) != DVec3::ZERO {
            indices[kept..kept + 3].copy_from_slice(&triangle);
            kept += 3;
        }
    }
    indices.truncate(kept);
    (before - kept) / 3
}

/// Positions of a triangle's corners.
pub(super) fn corners(vertices: &[Vertex], triangle: [u32; 3]) -> [DVec3; 3] {
    triangle.map(|index| DVec3::from(vertices[index as usize].position.map(f64::from)))
}

/// Normal of a triangle, as long as twice its area.
pub(super) fn double_area([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}
