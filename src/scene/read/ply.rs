//! PLY files: polygons of `vertex_indices` or `vertex_index` over vertices with `x y z`, and, where present,
//! `nx ny nz`, `red green blue` (`alpha`) and `s t`, `u v` or `texture_u texture_v`.
//!
//! Colours are taken as sRGB, as 3D scanners and MeshLab write them; 8 and 16 bits are scaled to [0, 1]. With
//! colours the surface is Lambertian with the vertex colour as albedo, without colours it is
//! [`GREY`](crate::scene::GREY). Faces with a corner that is not finite, as scanners write where they saw
//! nothing, are left out.
//!
//! The bodies of ascii files are read here: `ply-rs-bw` takes plain decimal numbers only, not `nan`, `.5` or
//! `5.`, and no blank lines.

use super::budget::{Budget, MAX_TRIANGLES, MAX_VERTICES};
use super::files::short;
use super::linear_from_srgb;
use super::notes::normal_notes;
use super::ply_text::AsciiBody;
use super::polygon::Polygons;
use crate::error::{Error, Result};
use crate::scene::material::GREY;
use crate::scene::mesh::{check, drop_zero_area};
use crate::scene::normals::fill_normals;
use crate::scene::{Material, Mesh, Scene, Vertex};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

pub(super) fn read(bytes: &[u8]) -> Result<Scene> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(damaged)?;
    check_header(&header, bytes.len())?;
    let mut text = AsciiBody::of(&header, bytes);
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => vertices = elements::<PlyVertex>(&mut reader, text.as_mut(), element, &header)?,
            "face" => faces = elements::<Face>(&mut reader, text.as_mut(), element, &header)?,
            _ => drop(elements::<Skipped>(&mut reader, text.as_mut(), element, &header)?),
        }
    }
    let mut vertices: Vec<Vertex> = vertices.into_iter().map(|element| element.0).collect();
    let mut notes = Vec::new();
    let mut indices = triangulate(&faces, &vertices, &mut notes)?;
    Budget::default().take(vertices.len(), indices.len() / 3)?;
    // No triangle has them.
    for vertex in vertices.iter_mut().filter(|v| v.position.iter().any(|value| !value.is_finite())) {
        *vertex = Vertex::default();
    }
    check(&vertices, &indices).map_err(|error| error.at("mesh"))?;
    let has = |property| header.elements.get("vertex").is_some_and(|e| e.properties.contains_key(property));
    let dropped = drop_zero_area(&vertices, &mut indices);
    let given = fill_normals(&mut vertices, &indices);
    normal_notes(&mut notes, dropped, if has("nx") { given } else { 0 });
    let material = Material::lambert([if has("red") { 1.0 } else { GREY }; 3]);
    let meshes = if indices.is_empty() { Vec::new() } else { vec![Mesh::new(vertices, indices, 0)] };
    Ok(Scene::of_meshes(meshes, vec![material], Vec::new(), notes))
}

/// All elements of one kind.
fn elements<T: PropertyAccess>(
    reader: &mut Reader<&[u8]>,
    text: Option<&mut AsciiBody>,
    element: &ElementDef,
    header: &Header,
) -> Result<Vec<T>> {
    match text {
        Some(text) => (0..element.count).map(|_| text.element(element)).collect(),
        None => Parser::new().read_payload_for_element(reader, element, header).map_err(damaged),
    }
}

fn damaged(error: ParseError) -> Error {
    Error::usage(format!("cannot be read as PLY; is it complete? {}", short(&error.to_string())))
}

/// Refuses counts that the file is too short for: `ply-rs-bw` 4.0 allocates little in advance, but it would
/// create as many elements without properties as the header claims.
fn check_header(header: &Header, bytes: usize) -> Result<()> {
    for (name, element) in &header.elements {
        let least: usize = match header.encoding {
            // A digit and its separator for each property.
            Encoding::Ascii => 2 * element.properties.len().max(1) - 1,
            _ => element.properties.values().map(|property| least_bytes(&property.data_type)).sum(),
        };
        if least == 0 && element.count > 0 || element.count.saturating_mul(least) > bytes {
            return Err(Error::usage(format!(
                "is truncated or damaged: {bytes} bytes cannot hold the {} elements `{}` of its header",
                element.count,
                short(name)
            )));
        }
        let most = match name.as_str() {
            "vertex" => MAX_VERTICES,
            "face" => MAX_TRIANGLES,
            _ => usize::MAX,
        };
        if element.count > most {
            return Err(Error::usage(format!(
                "has {} elements `{name}`; at most {most} are read",
                element.count
            )));
        }
    }
    let has = |element: &ElementDef, names: &[&str]| {
        names.iter().all(|name| element.properties.contains_key(*name))
    };
    if !header.elements.get("vertex").is_some_and(|element| has(element, &["x", "y", "z"])) {
        return Err(Error::usage("has no element `vertex` with the properties x, y and z"));
    }
    let is_face = |e: &ElementDef| has(e, &["vertex_indices"]) || has(e, &["vertex_index"]);
    if !header.elements.get("face").is_some_and(is_face) {
        return Err(Error::usage(
            "has no element `face` with the property vertex_indices: a cloud of points, or strips; triangulate it",
        ));
    }
    Ok(())
}

fn least_bytes(data_type: &PropertyType) -> usize {
    match data_type {
        PropertyType::Scalar(scalar) | PropertyType::List(scalar, _) => match scalar {
            ScalarType::Char | ScalarType::UChar => 1,
            ScalarType::Short | ScalarType::UShort => 2,
            ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
            ScalarType::Double => 8,
        },
    }
}

fn triangulate(faces: &[Face], vertices: &[Vertex], notes: &mut Vec<String>) -> Result<Vec<u32>> {
    let (mut indices, mut polygons) = (Vec::new(), Polygons::default());
    for (number, face) in faces.iter().enumerate() {
        let at_face = |fault: String| Err(Error::usage(fault).at(format_args!("face {number}")));
        if face.is_damaged {
            return at_face("is damaged: it has negative indices (faces are counted from 0)".to_owned());
        }
        if let Some(index) = face.corners.iter().find(|index| **index as usize >= vertices.len()) {
            return at_face(format!(
                "has vertex {index}, but there are {} (both counted from 0)",
                vertices.len()
            ));
        }
        if indices.len() / 3 + face.corners.len() > MAX_TRIANGLES {
            return Err(Error::usage(format!("has more than {MAX_TRIANGLES} triangles; simplify it")));
        }
        polygons.cut(&face.corners, |index| vertices[index as usize].position, &mut indices);
    }
    polygons.notes(notes);
    Ok(indices)
}

/// An element whose data are discarded.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

struct PlyVertex(Vertex);

impl PropertyAccess for PlyVertex {
    fn new() -> Self {
        Self(Vertex { colour: [1.0; 4], ..Vertex::default() })
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let Some(value) = property.to_f32_lossy() else { return PropertyAccessResult::Ignored };
        let full = match property {
            Property::UChar(_) => 255.0,
            Property::UShort(_) => 65_535.0,
            _ => 1.0,
        };
        let vertex = &mut self.0;
        match name {
            "x" => vertex.position[0] = value,
            "y" => vertex.position[1] = value,
            "z" => vertex.position[2] = value,
            "nx" => vertex.normal[0] = value,
            "ny" => vertex.normal[1] = value,
            "nz" => vertex.normal[2] = value,
            "red" => vertex.colour[0] = linear_from_srgb(value / full),
            "green" => vertex.colour[1] = linear_from_srgb(value / full),
            "blue" => vertex.colour[2] = linear_from_srgb(value / full),
            "alpha" => vertex.colour[3] = (value / full).clamp(0.0, 1.0),
            "s" | "u" | "texture_u" => vertex.uv[0] = value,
            "t" | "v" | "texture_v" => vertex.uv[1] = 1.0 - value,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

struct Face {
    corners: Vec<u32>,
    is_damaged: bool,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self { corners: Vec::new(), is_damaged: false }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if name != "vertex_indices" && name != "vertex_index" {
            return PropertyAccessResult::Ignored;
        }
        // Negative indices are rejected, not wrapped into u32.
        let signed =
            |values: Vec<i32>| values.into_iter().map(u32::try_from).collect::<Result<Vec<u32>, _>>().ok();
        let corners = match property {
            Property::ListInt(values) => signed(values),
            Property::ListUInt(values) => Some(values),
            Property::ListUShort(values) => Some(values.into_iter().map(u32::from).collect()),
            Property::ListUChar(values) => Some(values.into_iter().map(u32::from).collect()),
            Property::ListShort(values) => signed(values.into_iter().map(i32::from).collect()),
            Property::ListChar(values) => signed(values.into_iter().map(i32::from).collect()),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        self.is_damaged = corners.is_none();
        self.corners = corners.unwrap_or_default();
        PropertyAccessResult::Set
    }
}
