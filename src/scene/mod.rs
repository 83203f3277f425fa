//! Scenes to be lit: meshes, materials, textures, a tree of nodes that may move, a camera. Plain data on the CPU,
//! read from glTF, OBJ and PLY files or built in; nothing is computed in advance that a moving object would make
//! wrong.

mod animation;
mod bounds;
mod camera;
mod material;
mod mesh;
mod node;
mod texture;
mod whole;

pub use animation::{Channel, Interpolation, Keys};
pub use bounds::Bounds;
pub use camera::Camera;
pub use material::{Material, Shading};
pub use mesh::{Mesh, Vertex};
pub use node::{Instance, Node, Transform};
pub use texture::{Texture, Wrap};
pub use whole::Scene;
