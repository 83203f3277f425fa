//! Meshes that bend with joints and change their shape: what moves them, and how they lie when it has moved
//! them (glTF 2.0, sections 3.7.2.2 and 3.7.3).

use super::{Mesh, Vertex};
use glam::{Mat3, Mat4, Vec3};

/// How much a joint takes a vertex along.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Influence {
    /// Index into [`Skin::joints`].
    pub joint: u16,
    /// In [0, 1].
    pub weight: f32,
}

/// What a shape that a mesh can take adds to its vertices at weight 1. Both lists have one entry for each
/// vertex, or none where nothing is added.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// In the mesh's frame and unit. Finite.
    pub positions: Vec<Vec3>,
    /// Finite.
    pub normals: Vec<Vec3>,
}

/// How the vertices of one mesh can move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deformation {
    /// Those of the first vertex, then those of the second, and so on, as many for each. The weights of a
    /// vertex sum to 1. Empty for meshes without joints.
    pub influences: Vec<Influence>,
    /// Shapes; their weighted sum is added before joints move the vertices.
    pub targets: Vec<MorphTarget>,
    /// Whether triangles share no vertices and are flat however they move; their normals are then those of
    /// the moved triangles.
    pub is_flat: bool,
}

/// The joints that bend a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// At least one.
    pub joints: Vec<Joint>,
}

/// A node that takes vertices along.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Index of the node.
    pub node: usize,
    /// From the frame of the mesh to that of the joint, where the mesh lies as in its vertices (the inverse
    /// bind matrix). Affine and finite.
    pub joint_from_mesh: Mat4,
}

/// An instance whose vertices move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// Index of the instance.
    pub instance: usize,
    /// Index of its mesh's deformation.
    pub deformation: usize,
    /// Index of the skin, which has all joints of the deformation's influences. Without one, influences
    /// count for nothing; with one, the mesh follows its joints alone, and not the instance's node.
    pub skin: Option<usize>,
    /// The weights of the deformation's targets, one for each, where no animation changes them. Finite.
    pub weights: Vec<f32>,
}

impl Deformation {
    /// The same for other vertices: each of `corners` is one of the `count` vertices of before.
    pub(super) fn of_corners(&self, count: usize, corners: &[u32]) -> Self {
        let joints = self.influences.len() / count.max(1);
        let each = |deltas: &[Vec3]| -> Vec<Vec3> {
            if deltas.is_empty() { Vec::new() } else { corners.iter().map(|i| deltas[*i as usize]).collect() }
        };
        let targets = self.targets.iter();
        let targets = targets
            .map(|target| MorphTarget { positions: each(&target.positions), normals: each(&target.normals) });
        let of_corner = |i: &u32| &self.influences[*i as usize * joints..][..joints];
        Self {
            influences: corners.iter().flat_map(of_corner).copied().collect(),
            targets: targets.collect(),
            ..*self
        }
    }

    /// Moves `vertices`, which are those of `mesh`, and returns whether all their positions are finite.
    ///
    /// `weights` has one weight for each target, `world_from_mesh` the matrix of each joint; without a matrix
    /// the vertices stay in the mesh's frame, otherwise they come into the frame of the matrices. Normals
    /// follow as the inverse transpose has it, and where one is lost (a joint that flattens everything) it
    /// stays as it was.
    pub(super) fn apply(
        &self,
        mesh: &Mesh,
        weights: &[f32],
        world_from_mesh: &[Mat4],
        vertices: &mut [Vertex],
    ) -> bool {
        for (target, &weight) in self.targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
            for (vertex, delta) in vertices.iter_mut().zip(&target.positions) {
                vertex.position = (Vec3::from(vertex.position) + weight * delta).to_array();
            }
            for (vertex, delta) in vertices.iter_mut().zip(&target.normals) {
                vertex.normal = (Vec3::from(vertex.normal) + weight * delta).to_array();
            }
        }
        if !world_from_mesh.is_empty() {
            let each = self.influences.len() / vertices.len().max(1);
            for (vertex, influences) in vertices.iter_mut().zip(self.influences.chunks_exact(each.max(1))) {
                bend(vertex, influences, world_from_mesh);
            }
        }
        if self.is_flat {
            flatten(vertices);
        }
        let mut is_finite = true;
        for (vertex, rest) in vertices.iter_mut().zip(&mesh.vertices) {
            let normal = Vec3::from(vertex.normal).try_normalize();
            vertex.normal = normal.map_or(rest.normal, |normal| normal.to_array());
            is_finite &= Vec3::from(vertex.position).is_finite();
        }
        is_finite
    }
}

/// Moves a vertex by the weighted sum of its joints' matrices.
fn bend(vertex: &mut Vertex, influences: &[Influence], world_from_mesh: &[Mat4]) {
    let mut matrix = Mat4::ZERO;
    for influence in influences.iter().filter(|influence| influence.weight != 0.0) {
        matrix += world_from_mesh[usize::from(influence.joint)] * influence.weight;
    }
    vertex.position = matrix.transform_point3(vertex.position.into()).to_array();
    // The cofactor matrix is the inverse transpose times the determinant, and exists without an inverse.
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| axis.truncate());
    let cofactors = Mat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let normal = cofactors * Vec3::from(vertex.normal);
    vertex.normal = if x.dot(cofactors.x_axis) < 0.0 { -normal } else { normal }.to_array();
}

/// Gives all corners of a triangle its normal; three vertices are a triangle.
fn flatten(vertices: &mut [Vertex]) {
    for corners in vertices.as_chunks_mut::<3>().0 {
        let [a, b, c] = corners.each_ref().map(|corner| Vec3::from(corner.position).as_dvec3());
        let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array();
        corners.iter_mut().for_each(|corner| corner.normal = normal);
    }
}
