//! The triangles of glTF meshes.

use super::Reader;
use super::accessor::{floats, indices, quantized};
use super::figure;
use crate::error::{Error, Result};
use crate::scene::mesh::{check, drop_zero_area};
use crate::scene::normals::{fill_normals, flat};
use crate::scene::read::notes::{add_note, normal_notes};
use crate::scene::{Deformation, Mesh, Vertex};
use gltf::Semantic;
use gltf::mesh::Mode;

impl Reader<'_> {
    /// A primitive's triangles, and how they can move; `None` where no triangle has an area.
    pub(super) fn primitive(
        &mut self,
        primitive: &gltf::Primitive,
        place: &str,
    ) -> Result<Option<(Mesh, Option<Deformation>)>> {
        let at_place = |error: Error| error.at(place);
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            add_note(&mut self.scene.notes, "points and lines left out");
            return Ok(None);
        }
        let Some(positions) = primitive.get(&Semantic::Positions) else {
            add_note(&mut self.scene.notes, "primitives without positions left out");
            return Ok(None);
        };
        let corners = primitive.indices().map_or(positions.count(), |indices| indices.count());
        let has_normals = primitive.get(&Semantic::Normals).is_some();
        // A strip or a fan has nearly as many triangles as corners; with flat shading each triangle has three
        // vertices of its own.
        let triangles = if primitive.mode() == Mode::Triangles { corners / 3 } else { corners };
        let most =
            if has_normals { positions.count() } else { positions.count().max(triangles.saturating_mul(3)) };
        self.budget.take(most, triangles).map_err(at_place)?;

        self.budget.take_movers(most, figure::movers(primitive)).map_err(at_place)?;

        let mut vertices = self.vertices(primitive, &positions).map_err(at_place)?;
        let corners = match primitive.indices() {
            Some(accessor) => indices(&accessor, self.buffers).map_err(at_place)?,
            None => (0..vertices.len() as u32).collect(),
        };
        let mut indices = triangles_of(primitive.mode(), corners);
        check(&vertices, &indices).map_err(at_place)?;
        let mut deformation = self.deformation(primitive, vertices.len()).map_err(at_place)?;
        // A triangle without area may have one when its corners have moved.
        let dropped = if deformation.is_none() { drop_zero_area(&vertices, &mut indices) } else { 0 };
        if indices.is_empty() {
            add_note(&mut self.scene.notes, format!("{place} left out: it has no triangle with an area"));
            return Ok(None);
        }
        let mut given = 0;
        if has_normals {
            given = fill_normals(&mut vertices, &indices);
        } else {
            deformation = deformation.map(|deformation| deformation.of_corners(vertices.len(), &indices));
            (vertices, indices) = flat(&vertices, &indices);
        }
        let mut notes = Vec::new();
        normal_notes(&mut notes, dropped, given);
        self.scene.notes.extend(notes.into_iter().map(|note| format!("{place}: {note}")));
        let material = self.materials.place(&primitive.material(), self.buffers)?;
        Ok(Some((Mesh::new(vertices, indices, material), deformation)))
    }

    fn vertices(&self, primitive: &gltf::Primitive, positions: &gltf::Accessor) -> Result<Vec<Vertex>> {
        let positions = quantized::<3>(positions, self.buffers)?;
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
            let uvs = quantized::<2>(&accessor, self.buffers)?;
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
