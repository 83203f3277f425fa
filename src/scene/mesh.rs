use super::Bounds;

/// A corner of triangles: 48 bytes without gaps, as a GPU reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Vertex {
    /// In the mesh's frame, in the file's unit. Finite.
    pub position: [f32; 3],
    /// Outward unit vector.
    pub normal: [f32; 3],
    /// Texture coordinates, origin at the top left of the picture, v downwards (as glTF; OBJ and PLY files are
    /// turned over). Zero where a file has none.
    pub uv: [f32; 2],
    /// Linear colour and alpha in [0, 1], a factor on the material's base colour. White where a file has none.
    pub colour: [f32; 4],
}

/// Triangles of one material in a right-handed frame; seen from the front their corners run counter-clockwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The corners; triangles share them.
    pub vertices: Vec<Vertex>,
    /// Three for each triangle, each below the number of vertices. No triangle is without area.
    pub indices: Vec<u32>,
    /// Index of the material.
    pub material: usize,
    /// Box around the triangles in the mesh's frame.
    pub bounds: Bounds,
}
