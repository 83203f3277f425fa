//! Scenes to be lit: meshes, materials, textures, a tree of nodes that may move and bend meshes, a camera. Plain data on the
//! CPU, read from glTF, OBJ and PLY files or built in; nothing is precomputed that a moving object would
//! invalidate.

mod animation;
#[cfg(test)]
mod animation_tests;
mod bounds;
mod built_in;
#[cfg(test)]
mod built_in_tests;
mod camera;
mod figure;
#[cfg(test)]
mod figure_tests;
mod material;
mod mesh;
mod named_nodes;
mod node;
mod normals;
mod pose;
mod read;
mod roles;
mod texture;
mod whole;

pub use animation::{Channel, Interpolation, Keys};
pub use bounds::Bounds;
pub use camera::Camera;
pub use figure::{Deformation, Figure, Influence, Joint, MorphTarget, Skin};
pub use material::{GREY, Material, Shading};
pub use mesh::{Mesh, Vertex};
pub use node::{Instance, Node, Transform};
pub use pose::Pose;
pub use read::{MAX_BYTES, MAX_COORDINATE, MAX_TRIANGLES, MAX_VERTICES};
pub use roles::Roles;
pub use texture::{MAX_TEXTURE_PIXELS, MAX_TEXTURE_SIDE_PX, Texture, Wrap};
pub use whole::Scene;
