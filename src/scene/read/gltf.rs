//! glTF 2.0: `.glb`, and `.gltf` with its buffers and pictures in files beside it or in data URIs.
//!
//! What is read: the default scene (without one, all root nodes), triangles, strips and fans, the
//! metallic-roughness material, `TEXCOORD_0`, `COLOR_0`, sparse accessors, animation of nodes and the first
//! perspective camera. What is left out, with a note: skins and morph targets (the mesh is shown as it lies
//! in the file), points and lines, second texture coordinates, blending (drawn where alpha >= 1/2), occlusion
//! textures (see [`Material`](crate::scene::Material)), extensions. A file that requires an extension is
//! refused.

mod accessor;
mod animation;
#[cfg(test)]
mod fault_tests;
mod material;
#[cfg(test)]
mod tests;
mod uri;

use super::budget::Budget;
use super::files::{Files, short};
use super::notes::{add_note, normal_notes};
use crate::error::{Error, Place, Result};
use crate::scene::mesh::{check, drop_zero_area};
use crate::scene::normals::{fill_normals, flat};
use crate::scene::{Camera, Instance, Mesh, Node, Roles, Scene, Transform, Vertex};
use accessor::{Buffers, floats, indices};
use glam::{Mat4, Quat, Vec3, Vec4};
use gltf::json::validation::Validate;
use gltf::mesh::Mode;
use gltf::{Gltf, Semantic};
use material::Materials;
use std::collections::HashMap;
use uri::read_uri;

/// Most objects in the JSON text: each takes a few hundred bytes of memory, however short its text.
const MAX_OBJECTS: usize = 1 << 20;

/// Most nodes, and most instances.
const MAX_NODES: usize = 1 << 16;

/// Greatest depth of the tree of nodes.
const MAX_DEPTH: usize = 1 << 10;

pub(super) fn read(bytes: &[u8], mut files: Files) -> Result<Scene> {
    let gltf = parse(bytes)?;
    let mut scene = Scene::default();
    let left_out: Vec<&str> = gltf.extensions_used().collect();
    if !left_out.is_empty() {
        scene.notes.push(format!("extensions left out: {}", short(&left_out.join(", "))));
    }
    let buffers = read_buffers(&gltf, &mut files)?;
    let mut reader = Reader {
        materials: Materials::new(files),
        buffers: &buffers,
        budget: Budget::default(),
        meshes: HashMap::new(),
        scene,
    };
    let places = reader.nodes(&gltf)?;
    let Reader { materials, mut scene, .. } = reader;
    (scene.materials, scene.textures) = (materials.materials, materials.textures);
    for note in materials.notes {
        add_note(&mut scene.notes, note);
    }
    animation::read(&gltf, &buffers, &places, &mut scene)?;
    scene.camera = camera(&gltf, &places, &scene);
    Ok(scene)
}

/// Parses and checks the JSON part.
fn parse(bytes: &[u8]) -> Result<Gltf> {
    let damaged =
        |error: gltf::Error| Error::usage("cannot be read as glTF 2.0; is it complete?").because(error);
    if bytes.iter().filter(|byte| **byte == b'{').count() > MAX_OBJECTS && !bytes.starts_with(b"glTF") {
        return Err(Error::usage(format!("has more than {MAX_OBJECTS} JSON objects")));
    }
    if let Some(length) = bytes.strip_prefix(b"glTF").and_then(|rest| rest.get(8..12)) {
        let length = u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize;
        let json = bytes.get(20..20 + length).unwrap_or_default();
        if json.iter().filter(|byte| **byte == b'{').count() > MAX_OBJECTS {
            return Err(Error::usage(format!("has more than {MAX_OBJECTS} JSON objects")));
        }
    }
    let gltf = Gltf::from_slice_without_validation(bytes).map_err(damaged)?;
    let required: Vec<&str> = gltf.extensions_required().collect();
    if !required.is_empty() {
        return Err(Error::usage(format!(
            "requires extensions that are not read ({}); export it without them",
            short(&required.join(", "))
        )));
    }
    let root = gltf.as_json();
    let mut fault = None;
    root.validate(root, gltf::json::Path::new, &mut |path, error| {
        fault.get_or_insert_with(|| (path().to_string(), error));
    });
    match fault {
        None => Ok(gltf),
        Some((key, error)) => Err(Error::usage(format!("is damaged: {error}")).at(Place::key(short(&key)))),
    }
}

fn read_buffers(gltf: &Gltf, files: &mut Files) -> Result<Buffers> {
    let mut blob = gltf.blob.clone();
    gltf.buffers()
        .map(|buffer| {
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
    scene: Scene,
}

impl Reader<'_> {
    /// Puts the tree of nodes and its meshes into the scene; returns for every node of the file its index in
    /// the scene.
    fn nodes(&mut self, gltf: &Gltf) -> Result<Vec<Option<usize>>> {
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
                if node.skin().is_some() {
                    add_note(
                        &mut self.scene.notes,
                        "skins left out: their meshes stand still, as they lie in the file",
                    );
                }
                let meshes = self.mesh(&mesh)?;
                if self.scene.instances.len() + meshes.len() > MAX_NODES {
                    return Err(Error::usage(format!(
                        "with it more than {MAX_NODES} meshes are to be drawn; join some"
                    ))
                    .at(format_args!("node {number}")));
                }
                for mesh in meshes {
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
            if let Some(mesh) = self.primitive(&primitive, &place)? {
                self.scene.meshes.push(mesh);
                places.push(self.scene.meshes.len() - 1);
            }
        }
        self.meshes.insert(mesh.index(), places.clone());
        Ok(places)
    }

    /// A primitive's triangles; `None` where no triangle has an area.
    fn primitive(&mut self, primitive: &gltf::Primitive, place: &str) -> Result<Option<Mesh>> {
        let at_place = |error: Error| error.at(place);
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            add_note(&mut self.scene.notes, "points and lines left out");
            return Ok(None);
        }
        if primitive.morph_targets().next().is_some() {
            add_note(&mut self.scene.notes, "morph targets left out");
        }
        let positions = primitive
            .get(&Semantic::Positions)
            .ok_or_else(|| Error::usage("has no positions"))
            .map_err(at_place)?;
        let corners = primitive.indices().map_or(positions.count(), |indices| indices.count());
        let has_normals = primitive.get(&Semantic::Normals).is_some();
        // A strip or a fan has nearly as many triangles as corners; with flat shading each triangle has three
        // vertices of its own.
        let triangles = if primitive.mode() == Mode::Triangles { corners / 3 } else { corners };
        let most =
            if has_normals { positions.count() } else { positions.count().max(triangles.saturating_mul(3)) };
        self.budget.take(most, triangles).map_err(at_place)?;

        let mut vertices = self.vertices(primitive, &positions).map_err(at_place)?;
        let corners = match primitive.indices() {
            Some(accessor) => indices(&accessor, self.buffers).map_err(at_place)?,
            None => (0..vertices.len() as u32).collect(),
        };
        let mut indices = triangles_of(primitive.mode(), corners);
        check(&vertices, &indices).map_err(at_place)?;
        let dropped = drop_zero_area(&vertices, &mut indices);
        if indices.is_empty() {
            add_note(&mut self.scene.notes, format!("{place} left out: it has no triangle with an area"));
            return Ok(None);
        }
        let mut given = 0;
        if has_normals {
            given = fill_normals(&mut vertices, &indices);
        } else {
            (vertices, indices) = flat(&vertices, &indices);
        }
        let mut notes = Vec::new();
        normal_notes(&mut notes, dropped, given);
        self.scene.notes.extend(notes.into_iter().map(|note| format!("{place}: {note}")));
        let material = self.materials.place(&primitive.material(), self.buffers)?;
        Ok(Some(Mesh::new(vertices, indices, material)))
    }

    fn vertices(&self, primitive: &gltf::Primitive, positions: &gltf::Accessor) -> Result<Vec<Vertex>> {
        let positions = floats::<3>(positions, self.buffers)?;
        let mut vertices: Vec<Vertex> = positions
            .into_iter()
            .map(|position| Vertex { position, colour: [1.0; 4], ..Vertex::default() })
            .collect();
        let count = vertices.len();
        let attribute = |semantic: Semantic, what: &str| {
            let Some(accessor) = primitive.get(&semantic) else { return Ok(None) };
            if accessor.count() == count {
                return Ok(Some(accessor));
            }
            Err(Error::usage(format!("has {count} positions but {} {what}", accessor.count())))
        };
        if let Some(accessor) = attribute(Semantic::Normals, "normals")? {
            let normals = floats::<3>(&accessor, self.buffers)?;
            vertices.iter_mut().zip(normals).for_each(|(vertex, normal)| vertex.normal = normal);
        }
        if let Some(accessor) = attribute(Semantic::TexCoords(0), "texture coordinates")? {
            let uvs = floats::<2>(&accessor, self.buffers)?;
            vertices.iter_mut().zip(uvs).for_each(|(vertex, uv)| vertex.uv = uv);
        }
        if let Some(accessor) = attribute(Semantic::Colors(0), "colours")? {
            let colours = if accessor.dimensions() == gltf::accessor::Dimensions::Vec3 {
                floats::<3>(&accessor, self.buffers)?.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
            } else {
                floats::<4>(&accessor, self.buffers)?
            };
            // A surface cannot reflect more light than it receives.
            vertices
                .iter_mut()
                .zip(colours)
                .for_each(|(vertex, colour)| vertex.colour = colour.map(|x| x.clamp(0.0, 1.0)));
        }
        Ok(vertices)
    }
}

/// Strips and fans as triangles (glTF 2.0, section 3.7.2.1).
fn triangles_of(mode: Mode, corners: Vec<u32>) -> Vec<u32> {
    match mode {
        Mode::TriangleStrip => {
            corners.windows(3).enumerate().flat_map(|(i, c)| [c[0], c[1 + i % 2], c[2 - i % 2]]).collect()
        }
        Mode::TriangleFan => {
            corners.get(1..).unwrap_or_default().windows(2).flat_map(|c| [c[0], c[1], corners[0]]).collect()
        }
        _ => corners,
    }
}

fn transform(node: &gltf::Node) -> Result<Transform> {
    match node.transform() {
        gltf::scene::Transform::Matrix { matrix } => {
            let matrix = Mat4::from_cols_array_2d(&matrix);
            if matrix.is_finite() && matrix.row(3) == Vec4::W {
                return Ok(Transform::Matrix(matrix));
            }
            Err(Error::usage("is damaged: its matrix is not affine (bottom row 0, 0, 0, 1) or not finite"))
        }
        gltf::scene::Transform::Decomposed { translation, rotation, scale } => {
            let (translation, scale) = (Vec3::from(translation), Vec3::from(scale));
            match Vec4::from(rotation).try_normalize() {
                Some(rotation) if translation.is_finite() && scale.is_finite() => {
                    Ok(Transform::Trs { translation, rotation: Quat::from_vec4(rotation), scale })
                }
                _ => Err(Error::usage(
                    "is damaged: translation or scale not finite, or rotation of length zero",
                )),
            }
        }
    }
}

/// The roles that a node's extras give to it and all nodes below it: `{"lightcast": {"roles": ["seen",
/// "casts", "receives"]}}` with the roles that it plays; `None` where the extras do not name any. Extras of
/// other programs are ignored.
fn own_roles(node: &gltf::Node) -> Result<Option<Roles>> {
    let Some(extras) = node.extras() else { return Ok(None) };
    let Ok(extras) = serde_json::from_str::<serde_json::Value>(extras.get()) else { return Ok(None) };
    let Some(roles) = extras.get("lightcast").and_then(|ours| ours.get("roles")) else { return Ok(None) };
    let names: Option<Vec<&str>> =
        roles.as_array().and_then(|names| names.iter().map(serde_json::Value::as_str).collect());
    let outcome = match names {
        Some(names) => Roles::of_names(names),
        None => Err(Error::usage("is no list of names, such as [\"casts\"]")),
    };
    outcome.map(Some).map_err(|error| error.at("extras.lightcast.roles"))
}

/// The first node of the tree with a perspective camera, as it stands at time 0.
fn camera(gltf: &Gltf, places: &[Option<usize>], scene: &Scene) -> Option<Camera> {
    let (node, (fov, near)) = gltf.nodes().find_map(|node| {
        let place = places[node.index()]?;
        match node.camera()?.projection() {
            gltf::camera::Projection::Perspective(perspective) => {
                Some((place, (perspective.yfov(), perspective.znear())))
            }
            gltf::camera::Projection::Orthographic(_) => None,
        }
    })?;
    let mut world_from_mesh = Vec::new();
    scene.pose(0.0, &mut world_from_mesh);
    let centre = scene.bounds(&world_from_mesh).centre();
    // The same tree with the camera as its only instance.
    let at_node = Scene {
        nodes: scene.nodes.clone(),
        channels: scene.channels.clone(),
        instances: vec![Instance { mesh: 0, node, roles: Roles::NONE }],
        ..Scene::default()
    };
    at_node.pose(0.0, &mut world_from_mesh);
    let matrix = world_from_mesh[0];
    let eye = matrix.w_axis.truncate();
    let forward = (-matrix.z_axis.truncate()).try_normalize()?;
    let up = matrix.y_axis.truncate().try_normalize()?;
    let is_sound = fov > 0.0 && fov < std::f32::consts::PI && near > 0.0 && near.is_finite();
    // The target: the point of the optical axis that is nearest to the centre of the scene.
    let ahead = forward.dot(centre - eye);
    let distance = if ahead > near && ahead.is_finite() { ahead } else { near.max(1.0) };
    is_sound.then(|| Camera { eye, target: eye + forward * distance, up, vertical_fov_rad: fov, near })
}
