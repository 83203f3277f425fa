//! Skins and morph targets of glTF files.

use super::accessor::{floats, joints, quantized};
use super::{Pending, Reader};
use crate::error::{Error, Result};
use crate::scene::read::notes::add_note;
use crate::scene::{Deformation, Figure, Influence, Joint, MorphTarget, Skin};
use glam::{Mat4, Vec3, Vec4};
use gltf::Semantic;
use gltf::mesh::Primitive;
use std::collections::HashMap;

/// Most joints of one skin.
const MAX_JOINTS: usize = 1 << 12;

/// Most joints of all skins together, and most weights of all figures.
const MAX_ALL: usize = 1 << 20;

/// Most vertices of all figures together, which are moved in every frame (200 MB).
const MAX_FIGURE_VERTICES: usize = 1 << 22;

/// Sets of four joints and weights that a vertex may have.
const SETS: u32 = 4;

/// How many numbers a vertex has that move it: one for each target and for each four joints.
pub(super) fn movers(primitive: &Primitive) -> usize {
    primitive.morph_targets().len() + sets(primitive) as usize
}

fn sets(primitive: &Primitive) -> u32 {
    (0..SETS)
        .take_while(|&set| {
            [Semantic::Joints(set), Semantic::Weights(set)].iter().all(|what| primitive.get(what).is_some())
        })
        .count() as u32
}

impl Reader<'_> {
    /// How the `count` vertices of a primitive can move; `None` where they cannot.
    pub(super) fn deformation(&mut self, primitive: &Primitive, count: usize) -> Result<Option<Deformation>> {
        if movers(primitive) == 0 {
            return Ok(None);
        }
        let influences = self.influences(primitive, count)?;
        let deltas = |accessor: Option<gltf::Accessor>, what: &str| -> Result<Vec<Vec3>> {
            let Some(accessor) = accessor else { return Ok(Vec::new()) };
            let deltas = of_all(&accessor, count, || quantized::<3>(&accessor, self.buffers))?;
            match deltas.iter().position(|delta| delta.iter().any(|x| !x.is_finite())) {
                Some(at) => Err(Error::usage(format!("{what} {at} (counted from 0) not finite"))),
                None => Ok(deltas.into_iter().map(Vec3::from).collect()),
            }
        };
        let targets = primitive.morph_targets().enumerate().map(|(number, target)| {
            let read = || {
                Ok(MorphTarget {
                    positions: deltas(target.positions(), "position")?,
                    normals: deltas(target.normals(), "normal")?,
                })
            };
            read().map_err(|error: Error| error.at(format_args!("morph target {number}")))
        });
        let targets = targets.collect::<Result<_>>()?;
        let is_flat = primitive.get(&Semantic::Normals).is_none();
        Ok(Some(Deformation { influences, targets, is_flat }))
    }

    /// The joints of all vertices, with weights that sum to 1 for each vertex.
    fn influences(&mut self, primitive: &Primitive, count: usize) -> Result<Vec<Influence>> {
        let sets = sets(primitive);
        let each = 4 * sets as usize;
        let mut influences = vec![Influence::default(); each * count];
        for set in 0..sets {
            let (Some(of_joints), Some(of_weights)) =
                (primitive.get(&Semantic::Joints(set)), primitive.get(&Semantic::Weights(set)))
            else {
                continue;
            };
            let numbers = of_all(&of_joints, count, || joints(&of_joints, self.buffers))?;
            let weights = of_all(&of_weights, count, || floats::<4>(&of_weights, self.buffers))?;
            for (vertex, own) in influences.chunks_exact_mut(each).enumerate() {
                for (i, influence) in own[4 * set as usize..][..4].iter_mut().enumerate() {
                    let (joint, weight) = (numbers[vertex][i], weights[vertex][i]);
                    if !weight.is_finite() {
                        return Err(Error::usage(format!(
                            "weight of vertex {vertex} (counted from 0) not finite"
                        )));
                    }
                    // Joints of no weight are often left as they happened to be.
                    if weight > 0.0 {
                        *influence = Influence { joint, weight };
                    }
                }
            }
        }
        let mut without = 0;
        for own in influences.chunks_exact_mut(each.max(1)) {
            let sum: f64 = own.iter().map(|influence| f64::from(influence.weight)).sum();
            if sum > 0.0 {
                own.iter_mut().for_each(|one| one.weight = (f64::from(one.weight) / sum) as f32);
            } else {
                own[0].weight = 1.0;
                without += 1;
            }
        }
        if without > 0 {
            let note = "vertices of skins without a weight follow the first joint of their skin";
            add_note(&mut self.scene.notes, note);
        }
        Ok(influences)
    }

    /// Makes figures of the instances whose meshes can move, now that all nodes have their places.
    pub(super) fn figures(&mut self, gltf: &gltf::Document, places: &[Option<usize>]) -> Result<()> {
        let nodes: Vec<gltf::Node> = gltf.nodes().collect();
        let mut known: HashMap<usize, Option<usize>> = HashMap::new();
        let (mut joints_left, mut weights_left, mut vertices_left) = (MAX_ALL, MAX_ALL, MAX_FIGURE_VERTICES);
        for Pending { instance, deformation, node } in std::mem::take(&mut self.pending) {
            let at_node = |error: Error| error.at(format_args!("node {node}"));
            let deforming = &self.scene.deformations[deformation];
            let targets = deforming.targets.len();
            let most_joint = deforming.influences.iter().map(|influence| usize::from(influence.joint)).max();
            let skin = match (nodes[node].skin(), most_joint) {
                (Some(skin), Some(most)) => {
                    let place = match known.get(&skin.index()) {
                        Some(place) => *place,
                        None => self.skin(&skin, places, &mut joints_left).map_err(at_node)?,
                    };
                    known.insert(skin.index(), place);
                    let joints = place.map_or(usize::MAX, |place| self.scene.skins[place].joints.len());
                    if most >= joints {
                        return Err(at_node(Error::usage(format!(
                            "its mesh follows joint {most} (counted from 0) of skin {}, which has {joints}",
                            skin.index()
                        ))));
                    }
                    place
                }
                _ => None,
            };
            if skin.is_none() && targets == 0 {
                continue;
            }
            let mesh = &self.scene.meshes[self.scene.instances[instance].mesh];
            let left = (vertices_left.checked_sub(mesh.vertices.len()), weights_left.checked_sub(targets));
            let (Some(vertices), Some(weights)) = left else {
                return Err(at_node(Error::usage(format!(
                    "with it more than {MAX_FIGURE_VERTICES} vertices are to be moved by joints and morph \
                     targets, or more than {MAX_ALL} weights; simplify the meshes that move"
                ))));
            };
            (vertices_left, weights_left) = (vertices, weights);
            let weights = weights_of(&nodes[node], targets).map_err(at_node)?;
            self.scene.figures.push(Figure { instance, deformation, skin, weights });
        }
        Ok(())
    }

    /// Adds a skin; `None`, with a note, where a joint is not in the scene.
    fn skin(
        &mut self,
        skin: &gltf::Skin,
        places: &[Option<usize>],
        left: &mut usize,
    ) -> Result<Option<usize>> {
        let mut read = || {
            let count = skin.joints().len();
            let rest = left.checked_sub(count).filter(|_| (1..=MAX_JOINTS).contains(&count));
            *left = rest.ok_or_else(|| {
                Error::usage(format!(
                    "has {count} joints; 1 to {MAX_JOINTS} are read, of all skins {MAX_ALL}"
                ))
            })?;
            let matrices = match skin.inverse_bind_matrices() {
                Some(accessor) if accessor.count() < count => {
                    return Err(Error::usage(format!(
                        "has {count} joints but {} matrices",
                        accessor.count()
                    )));
                }
                Some(accessor) => floats::<16>(&accessor, self.buffers)?,
                None => vec![Mat4::IDENTITY.to_cols_array(); count],
            };
            let mut joints = Vec::with_capacity(count);
            for (node, matrix) in skin.joints().zip(matrices) {
                let mut joint_from_mesh = Mat4::from_cols_array(&matrix);
                if !joint_from_mesh.is_finite() || !joint_from_mesh.row(3).abs_diff_eq(Vec4::W, 1e-3) {
                    return Err(Error::usage(format!(
                        "is damaged: the matrix of joint {} is not affine (bottom row 0, 0, 0, 1) or not finite",
                        joints.len()
                    )));
                }
                // Rounding in other programs leaves the last row a hair off.
                let axes =
                    [&mut joint_from_mesh.x_axis, &mut joint_from_mesh.y_axis, &mut joint_from_mesh.z_axis];
                axes.into_iter().for_each(|axis| axis.w = 0.0);
                joint_from_mesh.w_axis.w = 1.0;
                let Some(node) = places[node.index()] else { return Ok(None) };
                joints.push(Joint { node, joint_from_mesh });
            }
            Ok(Some(joints))
        };
        let joints = read().map_err(|error: Error| error.at(format_args!("skin {}", skin.index())))?;
        let Some(joints) = joints else {
            let note = format!("skin {} left out: a joint of it is not in the scene", skin.index());
            add_note(&mut self.scene.notes, note);
            return Ok(None);
        };
        self.scene.skins.push(Skin { joints });
        Ok(Some(self.scene.skins.len() - 1))
    }
}

/// Numbers for all `count` vertices; refuses accessors with other counts before they are read.
fn of_all<T>(accessor: &gltf::Accessor, count: usize, read: impl FnOnce() -> Result<T>) -> Result<T> {
    if accessor.count() == count {
        return read();
    }
    Err(Error::usage(format!("has {} elements for {count} positions", accessor.count()))
        .at(format_args!("accessor {}", accessor.index())))
}

/// The weights that a node gives to the targets of its mesh, or else the mesh itself; 0 where neither does.
fn weights_of(node: &gltf::Node, targets: usize) -> Result<Vec<f32>> {
    let of_mesh = node.mesh().and_then(|mesh| mesh.weights().map(<[f32]>::to_vec));
    let mut weights = node.weights().map(<[f32]>::to_vec).or(of_mesh).unwrap_or_default();
    weights.resize(targets, 0.0);
    if weights.iter().all(|weight| weight.is_finite()) {
        return Ok(weights);
    }
    Err(Error::usage("is damaged: weights are not finite"))
}
