//! glTF 2.0: `.glb`, and `.gltf` with its buffers and pictures in files beside it or in data URIs.
//!
//! What is read: the default scene (without one, all root nodes), triangles, strips and fans, the
//! metallic-roughness material, `TEXCOORD_0`, `COLOR_0`, sparse accessors, animation of nodes, skins and
//! morph targets (positions and normals), the first perspective camera, `KHR_mesh_quantization`,
//! `KHR_texture_transform` and `KHR_materials_emissive_strength`. What is left out, with a note: points and
//! lines, second texture coordinates, blending (drawn where alpha >= 1/2), occlusion textures (see
//! [`Material`](crate::scene::Material)), other extensions.
//!
//! What is left out does not decide whether the rest loads: it is removed before the document is checked. A
//! file is refused where a part that is shown is damaged, or has an extension that the file requires and that
//! changes where things are.

mod accessor;
mod animation;
mod cut_down;
mod document;
#[cfg(test)]
mod fault_tests;
mod figure;
#[cfg(test)]
mod figure_tests;
#[cfg(test)]
mod left_out_tests;
mod material;
mod node;
mod primitive;
#[cfg(test)]
mod tests;
mod uri;

use super::budget::Budget;
use super::files::{Files, short};
use super::notes::add_note;
use crate::error::{Error, Result};
use crate::scene::{Instance, Node, Roles, Scene};
use accessor::Buffers;
use document::Document;
use material::Materials;
use node::{camera, own_roles, transform};
use std::collections::HashMap;
use uri::read_uri;

/// Most nodes, and most instances.
const MAX_NODES: usize = 1 << 16;

/// Greatest depth of the tree of nodes.
const MAX_DEPTH: usize = 1 << 10;

pub(super) fn read(bytes: &[u8], mut files: Files) -> Result<Scene> {
    let mut document = Document::parse(bytes)?;
    let scene = Scene { notes: std::mem::take(&mut document.notes), ..Scene::default() };
    let buffers = read_buffers(&mut document, &mut files)?;
    let Document { gltf, channels, .. } = &document;
    let mut reader = Reader {
        materials: Materials::new(files),
        buffers: &buffers,
        budget: Budget::default(),
        meshes: HashMap::new(),
        deformations: HashMap::new(),
        pending: Vec::new(),
        scene,
    };
    let places = reader.nodes(gltf)?;
    reader.figures(gltf, &places)?;
    let Reader { materials, mut scene, .. } = reader;
    (scene.materials, scene.textures) = (materials.materials, materials.textures);
    for note in materials.notes {
        add_note(&mut scene.notes, note);
    }
    animation::read(gltf, channels, &buffers, &places, &mut scene)?;
    scene.camera = camera(gltf, &places, &scene);
    Ok(scene)
}

/// The data of the buffers that are needed; the others are empty.
fn read_buffers(document: &mut Document, files: &mut Files) -> Result<Buffers> {
    let Document { gltf, blob, buffers, .. } = document;
    gltf.buffers()
        .map(|buffer| {
            if !buffers.contains(&buffer.index()) {
                return Ok(Vec::new());
            }
            let outcome = match buffer.source() {
                gltf::buffer::Source::Uri(uri) => read_uri(uri, files),
                gltf::buffer::Source::Bin => {
                    blob.take().ok_or_else(|| Error::usage("has neither a URI nor the data of a GLB file"))
                }
            };
            outcome
                .and_then(|data| {
                    if data.len() >= buffer.length() {
                        return Ok(data);
                    }
                    Err(Error::usage(format!(
                        "is truncated: it has {} of {} bytes",
                        data.len(),
                        buffer.length()
                    )))
                })
                .map_err(|error| error.at(format_args!("buffer {}", buffer.index())))
        })
        .collect()
}

struct Reader<'a> {
    materials: Materials,
    buffers: &'a Buffers,
    budget: Budget,
    /// The scene's meshes for each mesh of the file: one for each primitive with triangles.
    meshes: HashMap<usize, Vec<usize>>,
    /// The deformation of a mesh of the scene.
    deformations: HashMap<usize, usize>,
    pending: Vec<Pending>,
    scene: Scene,
}

/// An instance whose vertices can move.
struct Pending {
    instance: usize,
    deformation: usize,
    /// The file's node.
    node: usize,
}

impl Reader<'_> {
    /// Puts the tree of nodes and its meshes into the scene; returns for every node of the file its index in
    /// the scene.
    fn nodes(&mut self, gltf: &gltf::Document) -> Result<Vec<Option<usize>>> {
        let mut places = vec![None; gltf.nodes().len()];
        let mut all_roles: Vec<Roles> = Vec::new();
        let mut stack: Vec<(gltf::Node, Option<usize>, usize)> =
            match gltf.default_scene().or(gltf.scenes().next()) {
                Some(scene) => scene.nodes().map(|node| (node, None, 1)).collect(),
                None => {
                    let mut is_child = vec![false; places.len()];
                    gltf.nodes()
                        .flat_map(|node| node.children())
                        .for_each(|child| is_child[child.index()] = true);
                    gltf.nodes().filter(|node| !is_child[node.index()]).map(|node| (node, None, 1)).collect()
                }
            };
        stack.reverse();
        while let Some((node, parent, depth)) = stack.pop() {
            let number = node.index();
            if places[number].is_some() {
                return Err(Error::usage(
                    "is damaged: it has two parents or is its own ancestor; nodes form trees",
                )
                .at(format_args!("node {number}")));
            }
            if depth > MAX_DEPTH || self.scene.nodes.len() >= MAX_NODES {
                return Err(Error::usage(format!(
                    "has more than {MAX_NODES} nodes or {MAX_DEPTH} generations of them; simplify it"
                )));
            }
            let place = self.scene.nodes.len();
            places[number] = Some(place);
            let transform = transform(&node).map_err(|error| error.at(format_args!("node {number}")))?;
            self.scene.nodes.push(Node { parent, transform });
            self.scene.node_names.push(node.name().unwrap_or_default().to_owned());
            let own = own_roles(&node).map_err(|error| error.at(format_args!("node {number}")))?;
            let roles = own.or(parent.map(|parent| all_roles[parent])).unwrap_or(Roles::ALL);
            all_roles.push(roles);
            if let Some(mesh) = node.mesh() {
                let meshes = self.mesh(&mesh)?;
                if self.scene.instances.len() + meshes.len() > MAX_NODES {
                    return Err(Error::usage(format!(
                        "with it more than {MAX_NODES} meshes are to be drawn; join some"
                    ))
                    .at(format_args!("node {number}")));
                }
                for mesh in meshes {
                    if let Some(&deformation) = self.deformations.get(&mesh) {
                        let instance = self.scene.instances.len();
                        self.pending.push(Pending { instance, deformation, node: number });
                    }
                    self.scene.instances.push(Instance { mesh, node: place, roles });
                }
            }
            // A list of children with more entries than there are nodes contains one twice, which is detected
            // when that child is visited again.
            let children: Vec<_> = node.children().take(MAX_NODES).collect();
            stack.extend(children.into_iter().rev().map(|child| (child, Some(place), depth + 1)));
        }
        Ok(places)
    }

    fn mesh(&mut self, mesh: &gltf::Mesh) -> Result<Vec<usize>> {
        if let Some(known) = self.meshes.get(&mesh.index()) {
            return Ok(known.clone());
        }
        let mut places = Vec::new();
        if mesh.primitives().len() > MAX_NODES {
            return Err(Error::usage(format!("has more than {MAX_NODES} primitives; join some"))
                .at(format_args!("mesh {}", mesh.index())));
        }
        for primitive in mesh.primitives() {
            let name = mesh.name().map(|name| format!(" `{}`", short(name))).unwrap_or_default();
            let place = format!("mesh {}{name}, primitive {}", mesh.index(), primitive.index());
            if let Some((mesh, deformation)) = self.primitive(&primitive, &place)? {
                if let Some(deformation) = deformation {
                    self.deformations.insert(self.scene.meshes.len(), self.scene.deformations.len());
                    self.scene.deformations.push(deformation);
                }
                self.scene.meshes.push(mesh);
                places.push(self.scene.meshes.len() - 1);
            }
        }
        self.meshes.insert(mesh.index(), places.clone());
        Ok(places)
    }
}
