//! Wavefront OBJ files and their material libraries, by `tobj`.
//!
//! Polygons may be concave. Points, lines, curves and smoothing groups are left out, and so are faces with a
//! corner that is not finite. All faces of one material become one mesh. Vertex colours (three numbers
//! after a position, as MeshLab writes them) are taken as sRGB. Materials: Lambert with `Kd` (linear, as the
//! format defines it) and `map_Kd` (sRGB), Phong's lobe with `Ks` and `Ns` unless `illum` is 0 or 1, `Ke`,
//! `d`. If a library is missing or damaged, the scene is read without its materials, and a note says so.

use super::budget::{Budget, MAX_TRIANGLES, MAX_VERTICES};
use super::files::{Files, contained, short};
use super::linear_from_srgb;
use super::notes::{TRANSPARENCY, add_note, normal_notes};
use super::plain_text::plain_text;
use super::polygon::Polygons;
use super::texture_options::{TextureOptions, texture_options};
use crate::error::{Error, Place, Result};
use crate::scene::material::GREY;
use crate::scene::mesh::{check, drop_zero_area};
use crate::scene::normals::fill_normals;
use crate::scene::texture::MAX_TEXTURE_PIXELS;
use crate::scene::{Material, Mesh, Scene, Shading, Texture, Vertex};
use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use std::io::{BufRead, Read};
use std::path::Path;

/// Most objects, groups and changes of material: `tobj` makes a mesh of each.
const MAX_GROUPS: usize = 1 << 20;

/// Most bytes of a material library: a material of ten bytes in the file takes some hundreds of bytes in
/// memory.
const MAX_LIBRARY_BYTES: usize = 1 << 24;

/// Largest exponent of Phong's lobe that is kept; MTL files have up to 1000. Its lobe is less than a degree
/// wide.
const MAX_EXPONENT: f32 = 1e4;

pub(super) fn read(bytes: &[u8], files: Files) -> Result<Scene> {
    let bytes = &*plain_text(bytes);
    check_counts(bytes)?;
    let files = RefCell::new(files);
    let notes = RefCell::new(Vec::new());
    let known = RefCell::new(HashSet::new());
    let mut lines = Lines { rest: bytes, read: 0 };
    let options = tobj::LoadOptions { triangulate: false, ..tobj::GPU_LOAD_OPTIONS };
    let loaded = tobj::load_obj_buf(&mut lines, &options, |name| {
        // A library may be named in every group.
        if !known.borrow_mut().insert(name.to_path_buf()) {
            return Ok(Default::default());
        }
        read_libraries(&mut files.borrow_mut(), name).or_else(|error| {
            notes.borrow_mut().push(format!("materials left out: {error}"));
            Ok(Default::default())
        })
    });
    let (models, materials) = loaded.map_err(|error| {
        Error::usage("cannot be read as OBJ, here or in the faces before")
            .because(error)
            .at(Place::line(lines.read as u64))
    })?;
    let materials = materials.map_err(|error| Error::usage("has damaged materials").because(error))?;
    let mut files = files.into_inner();
    let mut notes = notes.into_inner();

    let mut textures = Vec::new();
    let mut converted = Materials {
        files: &mut files,
        textures: &mut textures,
        notes: &mut notes,
        pixels_left: MAX_TEXTURE_PIXELS,
        known: HashMap::new(),
    };
    let mut materials: Vec<Material> = materials.iter().map(|material| converted.convert(material)).collect();
    let (vertices, faces) = gather(&models, &mut materials, &mut notes)?;
    let meshes = split(&vertices, &faces);
    Ok(Scene::of_meshes(meshes, materials, textures, notes))
}

/// Refuses files with more elements than a scene may have, before `tobj` allocates ten times the file's size
/// for them.
fn check_counts(bytes: &[u8]) -> Result<()> {
    let (mut vertices, mut corners, mut groups) = (0, 0, 0);
    for line in bytes.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii_start) {
        match line.first() {
            Some(b'v') => vertices += 1,
            Some(b'f' | b'l') => {
                let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
                corners += words.count() - 1;
            }
            // `o`, `g`, `usemtl`, `mtllib`.
            Some(b'o' | b'g' | b'u' | b'm') => groups += 1,
            _ => {}
        }
    }
    // Positions, normals and texture coordinates.
    for (count, most, what) in [
        (vertices, 3 * MAX_VERTICES, "lines `v`, `vn` and `vt`"),
        (corners, 3 * MAX_TRIANGLES, "corners of faces"),
        (groups, MAX_GROUPS, "lines that begin an object, a group or a material"),
    ] {
        if count > most {
            return Err(Error::usage(format!("has {count} {what}; at most {most} are read: simplify it")));
        }
    }
    Ok(())
}

/// Vertices of all models, and for every material its triangles.
type Gathered = (Vec<Vertex>, Vec<(usize, Vec<u32>)>);

/// Puts all models into one list of vertices, so that their normals are smooth across the borders of groups
/// and materials, and the triangles of every material together.
fn gather(
    models: &[tobj::Model],
    materials: &mut Vec<Material>,
    notes: &mut Vec<String>,
) -> Result<Gathered> {
    let total: usize = models.iter().map(|model| model.mesh.positions.len() / 3).sum();
    let triangles: usize =
        models.iter().flat_map(|model| faces(&model.mesh)).map(|face| face.len() - 2).sum();
    Budget::default().take(total, triangles)?;
    let mut vertices: Vec<Vertex> = Vec::with_capacity(total);
    let mut indices = Vec::with_capacity(3 * triangles);
    let mut polygons = Polygons::default();
    // For every model, the material of the triangles that use vertices from its first one on.
    let mut ends = Vec::new();
    let mut default_material: [Option<usize>; 2] = [None; 2];
    let mut has_normals = false;
    for model in models.iter().filter(|model| !model.mesh.indices.is_empty()) {
        let mesh = &model.mesh;
        let first = vertices.len() as u32;
        let count = mesh.positions.len() / 3;
        // `tobj` packs the numbers that exist: where a corner lacks one, all later ones are out of place.
        let complete = |what: &str, values: &[f32], size: usize, notes: &mut Vec<String>| {
            let is_complete = values.len() == size * count;
            if !is_complete && !values.is_empty() {
                notes.push(format!("{what} of `{}` left out: not every corner has them", short(&model.name)));
            }
            is_complete
        };
        let uvs = complete("texture coordinates", &mesh.texcoords, 2, notes).then_some(&mesh.texcoords);
        let normals = complete("normals", &mesh.normals, 3, notes).then_some(&mesh.normals);
        let colours = complete("colours", &mesh.vertex_color, 3, notes).then_some(&mesh.vertex_color);
        has_normals |= normals.is_some();
        vertices.extend((0..count).map(|i| {
            let three = |values: &[f32]| [values[3 * i], values[3 * i + 1], values[3 * i + 2]];
            let [r, g, b] = colours.map_or([1.0; 3], |c| three(c).map(linear_from_srgb));
            Vertex {
                position: three(&mesh.positions),
                normal: normals.map_or([0.0; 3], |normals| three(normals)),
                uv: uvs.map_or([0.0; 2], |uvs| [uvs[2 * i], 1.0 - uvs[2 * i + 1]]),
                colour: [r, g, b, 1.0],
            }
        }));
        let own = &mut vertices[first as usize..];
        let mut triangles = Vec::new();
        for face in faces(mesh) {
            polygons.cut(face, |index| own[index as usize].position, &mut triangles);
        }
        // No triangle has them.
        for vertex in own.iter_mut().filter(|v| v.position.iter().any(|value| !value.is_finite())) {
            vertex.position = [0.0; 3];
        }
        let material = mesh.material_id.unwrap_or_else(|| {
            *default_material[usize::from(colours.is_some())].get_or_insert_with(|| {
                materials.push(Material::lambert([if colours.is_some() { 1.0 } else { GREY }; 3]));
                materials.len() - 1
            })
        });
        check(own, &triangles).map_err(|error| error.at(format_args!("object `{}`", short(&model.name))))?;
        indices.extend(triangles.iter().map(|index| first + index));
        ends.push((first, material));
    }
    polygons.notes(notes);
    let dropped = drop_zero_area(&vertices, &mut indices);
    let given = fill_normals(&mut vertices, &indices);
    normal_notes(notes, dropped, if has_normals { given } else { 0 });

    let mut of_material = vec![Vec::new(); materials.len()];
    for triangle in indices.as_chunks::<3>().0 {
        // Models do not share vertices, so a corner's vertex determines its material.
        let model = ends.partition_point(|(first, _)| *first <= triangle[0]) - 1;
        of_material[ends[model].1].extend_from_slice(triangle);
    }
    let faces = of_material.into_iter().enumerate().filter(|(_, indices)| !indices.is_empty()).collect();
    Ok((vertices, faces))
}

/// The faces of three corners or more; `tobj` does not say how many each has where all are triangles.
fn faces(mesh: &tobj::Mesh) -> impl Iterator<Item = &[u32]> {
    let arities = mesh.face_arities.iter().map(|arity| *arity as usize);
    let triangles = if mesh.face_arities.is_empty() { mesh.indices.len() / 3 } else { 0 };
    let mut rest = &mesh.indices[..];
    arities
        .chain(std::iter::repeat_n(3, triangles))
        .map_while(move |arity| rest.split_off(..arity))
        .filter(|face| face.len() >= 3)
}

/// A mesh for every material, with only the vertices that it uses.
fn split(vertices: &[Vertex], faces: &[(usize, Vec<u32>)]) -> Vec<Mesh> {
    let mut places = vec![u32::MAX; vertices.len()];
    faces
        .iter()
        .map(|(material, indices)| {
            let mut own = Vec::new();
            let indices = indices
                .iter()
                .map(|index| {
                    let place = &mut places[*index as usize];
                    if *place == u32::MAX {
                        *place = own.len() as u32;
                        own.push(vertices[*index as usize]);
                    }
                    *place
                })
                .collect();
            Mesh::new(own, indices, *material)
        })
        .collect()
}

/// Materials, and their places by name.
type Library = (Vec<tobj::Material>, HashMap<String, usize>);

/// One library, whose name may have blanks, or several with blanks between them.
fn read_libraries(files: &mut Files, name: &Path) -> Result<Library> {
    let name = name.to_string_lossy();
    let whole = read_library(files, &name);
    if whole.is_ok() || name.split_whitespace().count() < 2 {
        return whole;
    }
    let (mut all, mut places) = Library::default();
    for name in name.split_whitespace() {
        let (materials, own) = read_library(files, name)?;
        places.extend(own.into_iter().map(|(name, place)| (name, place + all.len())));
        all.extend(materials);
    }
    Ok((all, places))
}

fn read_library(files: &mut Files, name: &str) -> Result<Library> {
    // Programs on Windows write backslashes.
    let bytes = files.read(&name.replace('\\', "/"))?;
    if bytes.len() > MAX_LIBRARY_BYTES {
        let fault = format!("has {} bytes; at most {MAX_LIBRARY_BYTES} are read", bytes.len());
        return Err(Error::usage(fault).at(format_args!("`{}`", short(name))));
    }
    let text = plain_text(&bytes);
    contained(|| {
        tobj::load_mtl_buf(&mut &text[..]).map_err(|error| Error::usage("cannot be read").because(error))
    })
    .map_err(|error| error.at(format_args!("`{}`", short(name))))
}

/// What the conversion of materials needs.
struct Materials<'a> {
    files: &'a mut Files,
    textures: &'a mut Vec<Texture>,
    notes: &'a mut Vec<String>,
    pixels_left: u64,
    /// The textures by their names; `None` for those that cannot be used.
    known: HashMap<String, Option<usize>>,
}

impl Materials<'_> {
    fn convert(&mut self, from: &tobj::Material) -> Material {
        // Values outside the valid range are clamped, since no surface has them; NaN counts as 0.
        let within = |x: f32, most: f32| if x.is_nan() { 0.0 } else { x.clamp(0.0, most) };
        let colour = |colour: Option<[f32; 3]>, otherwise: f32| {
            colour.unwrap_or([otherwise; 3]).map(|x| within(x, 1.0))
        };
        let has_lobe = !matches!(from.illumination_model, Some(0 | 1));
        let specular = if has_lobe { colour(from.specular, 0.0) } else { [0.0; 3] };
        let exponent = within(from.shininess.unwrap_or(0.0), MAX_EXPONENT);
        let mut material = Material::new(Shading::Phong { specular, exponent }, colour(from.diffuse, GREY));
        material.emissive = from.emissive.unwrap_or_default().map(|x| within(x, f32::MAX));
        if let Some(name) = &from.diffuse_texture {
            let TextureOptions { name, uv, left_out } = texture_options(name);
            material.base_colour_texture = self.texture(name);
            material.base_colour_uv = uv;
            for option in left_out {
                self.note(format!("option {option} of texture `{}` left out", short(name)));
            }
            if material.base_colour_texture.is_some() && from.diffuse.is_none() {
                material.base_colour = [1.0; 4];
            }
        }
        if let Some(alpha) = from.dissolve.filter(|alpha| *alpha < 1.0) {
            material.base_colour[3] = alpha.max(0.0);
            material.alpha_cutoff = Some(0.5);
            self.note(TRANSPARENCY);
        }
        let others =
            [&from.specular_texture, &from.normal_texture, &from.shininess_texture, &from.dissolve_texture];
        for name in others.into_iter().flatten() {
            self.note(format!("texture `{}` left out: of MTL files only map_Kd is read", short(name)));
        }
        material
    }

    fn texture(&mut self, name: &str) -> Option<usize> {
        if let Some(known) = self.known.get(name) {
            return *known;
        }
        let bytes = self.files.read(&name.replace('\\', "/"));
        let outcome = bytes.and_then(|bytes| {
            contained(|| Texture::decode(&bytes, true, &mut self.pixels_left))
                .map_err(|error| error.at(format_args!("`{}`", short(name))))
        });
        let place = match outcome {
            Ok(texture) => {
                self.textures.push(texture);
                Some(self.textures.len() - 1)
            }
            Err(error) => {
                self.note(format!("texture left out: {error}"));
                None
            }
        };
        self.known.insert(name.to_owned(), place);
        place
    }

    fn note(&mut self, note: impl Into<String>) {
        add_note(self.notes, note);
    }
}

/// A text that counts the lines read from it, because `tobj`'s errors do not name the line.
struct Lines<'a> {
    rest: &'a [u8],
    read: usize,
}

impl Read for Lines<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let length = self.rest.len().min(buffer.len());
        buffer[..length].copy_from_slice(&self.rest[..length]);
        self.consume(length);
        Ok(length)
    }
}

impl BufRead for Lines<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        Ok(self.rest)
    }

    fn consume(&mut self, amount: usize) {
        self.read += self.rest[..amount].iter().filter(|byte| **byte == b'\n').count();
        self.rest = &self.rest[amount..];
    }
}
