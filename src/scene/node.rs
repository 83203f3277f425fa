use super::Roles;
use glam::{Mat4, Quat, Vec3};

/// Position and orientation of a node in its parent's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transform {
    /// Any affine matrix. A node with one is not animated.
    Matrix(Mat4),
    /// Scaling, then rotation, then translation: the form that animations change.
    Trs {
        /// Translation in the parent's units.
        translation: Vec3,
        /// Unit quaternion.
        rotation: Quat,
        /// Factor along each axis; negative ones mirror.
        scale: Vec3,
    },
}

impl Transform {
    /// The identity.
    pub const IDENTITY: Self =
        Self::Trs { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };

    /// The matrix from the node's frame to its parent's.
    pub fn parent_from_node(&self) -> Mat4 {
        match *self {
            Self::Matrix(matrix) => matrix,
            Self::Trs { translation, rotation, scale } => {
                Mat4::from_scale_rotation_translation(scale, rotation, translation)
            }
        }
    }
}

/// A frame in the tree of frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Index of the parent, smaller than the node's own; `None` for root nodes, whose parent is the world.
    pub parent: Option<usize>,
    /// Its transform when nothing animates it.
    pub transform: Transform,
}

/// A mesh at a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instance {
    /// Index of the mesh.
    pub mesh: usize,
    /// Index of the node whose frame the mesh stands in.
    pub node: usize,
    /// Which roles it plays.
    pub roles: Roles,
}
