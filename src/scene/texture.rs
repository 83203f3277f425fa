/// What lies beyond a texture's edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The texture again.
    #[default]
    Repeat,
    /// The texture again, every other time mirrored.
    MirroredRepeat,
    /// The pixels of the edge.
    ClampToEdge,
}

/// A picture on a surface. Row 0 is at v = 0, the top. How it is filtered is the renderer's matter; the filters of
/// glTF files are not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texture {
    /// Columns, > 0.
    pub width: u32,
    /// Rows, > 0.
    pub height: u32,
    /// `4 * width * height` bytes, rows from the top.
    pub rgba8: Vec<u8>,
    /// Whether red, green and blue are coded as sRGB (colours) or linear (normals, roughness). Alpha is linear.
    pub is_srgb: bool,
    /// Beyond the left and right edges.
    pub wrap_u: Wrap,
    /// Beyond the top and bottom edges.
    pub wrap_v: Wrap,
}
