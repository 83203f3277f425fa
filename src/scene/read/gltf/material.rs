//! Materials and textures of glTF files, read when a mesh first asks for them.

use super::accessor::{Buffers, view_bytes};
use super::uri::read_uri;
use crate::error::{Error, Place, Result};
use crate::scene::read::files::{Files, contained};
use crate::scene::read::notes::{TRANSPARENCY, add_note};
use crate::scene::texture::MAX_TEXTURE_PIXELS;
use crate::scene::{Material, Shading, Texture, Wrap};
use gltf::image::Source;
use gltf::material::AlphaMode;
use gltf::texture::WrappingMode;
use std::borrow::Cow;
use std::collections::HashMap;

/// The scene's materials and textures so far.
pub(super) struct Materials {
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    pub(super) notes: Vec<String>,
    files: Files,
    pixels_left: u64,
    /// By the file's index; `None` is the default material.
    known: HashMap<Option<usize>, usize>,
    /// By the file's index and whether the colours are sRGB.
    known_textures: HashMap<(usize, bool), usize>,
}

impl Materials {
    pub(super) fn new(files: Files) -> Self {
        Self {
            materials: Vec::new(),
            textures: Vec::new(),
            notes: Vec::new(),
            files,
            pixels_left: MAX_TEXTURE_PIXELS,
            known: HashMap::new(),
            known_textures: HashMap::new(),
        }
    }

    /// The index of a material in the scene's list.
    pub(super) fn place(&mut self, from: &gltf::Material, buffers: &Buffers) -> Result<usize> {
        if let Some(place) = self.known.get(&from.index()) {
            return Ok(*place);
        }
        let name = from.index().map_or("default material".to_owned(), |index| format!("material {index}"));
        let material = self.convert(from, buffers).map_err(|error| error.at(name))?;
        self.materials.push(material);
        self.known.insert(from.index(), self.materials.len() - 1);
        Ok(self.materials.len() - 1)
    }

    fn convert(&mut self, from: &gltf::Material, buffers: &Buffers) -> Result<Material> {
        let rough = from.pbr_metallic_roughness();
        if from.index().is_none() {
            add_note(&mut self.notes, "meshes without a material have glTF's default, a rough white metal");
        }
        let [red, green, blue, alpha] = factors(rough.base_color_factor(), "baseColorFactor")?;
        let [metallic] = factors([rough.metallic_factor()], "metallicFactor")?;
        let [roughness] = factors([rough.roughness_factor()], "roughnessFactor")?;
        let mut material = Material::new(Shading::MetalRough { metallic, roughness }, [red, green, blue]);
        material.base_colour[3] = alpha;
        material.emissive = factors(from.emissive_factor(), "emissiveFactor")?;
        material.alpha_cutoff = match from.alpha_mode() {
            AlphaMode::Opaque => None,
            AlphaMode::Mask => Some(from.alpha_cutoff().unwrap_or(0.5)),
            AlphaMode::Blend => {
                // Many exporters ask for blending on surfaces that are entirely opaque.
                if alpha < 1.0 || rough.base_color_texture().is_some() {
                    add_note(&mut self.notes, TRANSPARENCY);
                }
                Some(0.5)
            }
        };
        if material.alpha_cutoff.is_some_and(|cutoff| !cutoff.is_finite()) {
            return Err(Error::usage("is damaged: alphaCutoff is not finite"));
        }
        if let Some(info) = rough.base_color_texture() {
            material.base_colour_texture = self.texture(&info.texture(), info.tex_coord(), true, buffers)?;
        }
        if let Some(info) = rough.metallic_roughness_texture() {
            material.metallic_roughness_texture =
                self.texture(&info.texture(), info.tex_coord(), false, buffers)?;
        }
        if let Some(info) = from.emissive_texture() {
            material.emissive_texture = self.texture(&info.texture(), info.tex_coord(), true, buffers)?;
        }
        if let Some(info) = from.normal_texture() {
            material.normal_texture = self.texture(&info.texture(), info.tex_coord(), false, buffers)?;
            material.normal_scale = info.scale();
            if !material.normal_scale.is_finite() {
                return Err(Error::usage("is damaged: the scale of its normal texture is not finite"));
            }
        }
        if from.occlusion_texture().is_some() {
            add_note(
                &mut self.notes,
                "occlusion textures left out: the lights' own shadows take their place",
            );
        }
        Ok(material)
    }

    /// The index of a texture in the scene's list; `None` for textures that cannot be looked up.
    fn texture(
        &mut self,
        from: &gltf::Texture,
        uv_set: u32,
        is_srgb: bool,
        buffers: &Buffers,
    ) -> Result<Option<usize>> {
        if uv_set != 0 {
            add_note(&mut self.notes, "textures on the second texture coordinates left out");
            return Ok(None);
        }
        if let Some(place) = self.known_textures.get(&(from.index(), is_srgb)) {
            return Ok(Some(*place));
        }
        let read = match from.source().source() {
            Source::View { view, .. } => view_bytes(&view, buffers).map(Cow::Borrowed),
            Source::Uri { uri, .. } => read_uri(uri, &mut self.files).map(Cow::Owned),
        };
        let outcome =
            read.and_then(|bytes| contained(|| Texture::decode(&bytes, is_srgb, &mut self.pixels_left)));
        let image = from.source().index();
        let mut texture = outcome.map_err(|error| error.at(format_args!("image {image}")))?;
        let wrap = |mode| match mode {
            WrappingMode::Repeat => Wrap::Repeat,
            WrappingMode::MirroredRepeat => Wrap::MirroredRepeat,
            WrappingMode::ClampToEdge => Wrap::ClampToEdge,
        };
        (texture.wrap_u, texture.wrap_v) = (wrap(from.sampler().wrap_s()), wrap(from.sampler().wrap_t()));
        self.textures.push(texture);
        self.known_textures.insert((from.index(), is_srgb), self.textures.len() - 1);
        Ok(Some(self.textures.len() - 1))
    }
}

/// Factors, which must be in [0, 1] by the specification.
fn factors<const N: usize>(values: [f32; N], name: &str) -> Result<[f32; N]> {
    if values.iter().all(|value| (0.0..=1.0).contains(value)) {
        return Ok(values);
    }
    Err(Error::usage("glTF has it in [0, 1]").at(Place::value(name, format_args!("{values:?}"))))
}
