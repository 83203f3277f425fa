//! Materials and textures of glTF files, read when a mesh first asks for them.

use super::accessor::{Buffers, view_bytes};
use super::uri::read_uri;
use crate::error::{Error, Result};
use crate::scene::read::files::{Files, contained};
use crate::scene::read::notes::{TRANSPARENCY, add_note};
use crate::scene::texture::MAX_TEXTURE_PIXELS;
use crate::scene::{Material, Shading, Texture, Wrap};
use glam::{Affine2, Vec2};
use gltf::image::Source;
use gltf::material::AlphaMode;
use gltf::texture::WrappingMode;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::HashMap;

/// The extension that moves, turns and scales texture coordinates.
const TRANSFORM: &str = "KHR_texture_transform";

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
        let [red, green, blue, alpha] = self.factors(rough.base_color_factor(), "baseColorFactor", "")?;
        let [metallic] = self.factors([rough.metallic_factor()], "metallicFactor", "")?;
        let [roughness] = self.factors([rough.roughness_factor()], "roughnessFactor", "")?;
        let mut material = Material::new(Shading::MetalRough { metallic, roughness }, [red, green, blue]);
        material.base_colour[3] = alpha;
        material.emissive = self.emissive(from)?;
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
        self.textures(from, &mut material, buffers)?;
        Ok(material)
    }

    /// The radiance that a surface emits.
    fn emissive(&mut self, from: &gltf::Material) -> Result<[f32; 3]> {
        /// The extension for emission over 1.
        const STRENGTH: &str = "KHR_materials_emissive_strength";
        let factors = self.factors(
            from.emissive_factor(),
            "emissiveFactor",
            "; more belongs into KHR_materials_emissive_strength",
        )?;
        let Some(extension) = from.extension_value(STRENGTH) else { return Ok(factors) };
        let strength = extension.get("emissiveStrength").map_or(Some(1.0), Value::as_f64);
        match strength.filter(|strength| (0.0..=f64::from(f32::MAX)).contains(strength)) {
            Some(strength) => Ok(factors.map(|factor| factor * strength as f32)),
            None => Err(Error::usage("is damaged: emissiveStrength is no number >= 0").at(STRENGTH)),
        }
    }

    fn textures(&mut self, from: &gltf::Material, material: &mut Material, buffers: &Buffers) -> Result<()> {
        let rough = from.pbr_metallic_roughness();
        if let Some(info) = rough.base_color_texture() {
            let transform = info.extension_value(TRANSFORM);
            material.base_colour_texture =
                self.texture(&info.texture(), info.tex_coord(), transform, true, buffers)?;
            material.base_colour_uv = uv_transform(transform)?;
        }
        if let Some(info) = rough.metallic_roughness_texture() {
            let transform = info.extension_value(TRANSFORM);
            material.metallic_roughness_texture =
                self.texture(&info.texture(), info.tex_coord(), transform, false, buffers)?;
            material.metallic_roughness_uv = uv_transform(transform)?;
        }
        if let Some(info) = from.emissive_texture() {
            let transform = info.extension_value(TRANSFORM);
            material.emissive_texture =
                self.texture(&info.texture(), info.tex_coord(), transform, true, buffers)?;
            material.emissive_uv = uv_transform(transform)?;
        }
        if let Some(info) = from.normal_texture() {
            let transform = info.extension_value(TRANSFORM);
            material.normal_texture =
                self.texture(&info.texture(), info.tex_coord(), transform, false, buffers)?;
            material.normal_uv = uv_transform(transform)?;
            material.normal_scale = info.scale();
            if !material.normal_scale.is_finite() {
                return Err(Error::usage("is damaged: the scale of its normal texture is not finite"));
            }
        }
        Ok(())
    }

    /// Factors, which are in [0, 1] by the specification. Those a hair outside, as rounding leaves them, are
    /// clamped, and so are those that are far outside; `instead` says where such values belong.
    fn factors<const N: usize>(&mut self, values: [f32; N], name: &str, instead: &str) -> Result<[f32; N]> {
        if values.iter().all(|value| (0.0..=1.0).contains(value)) {
            return Ok(values);
        }
        if values.iter().any(|value| !value.is_finite()) {
            return Err(Error::usage(format!("{name} is {values:?}; glTF has it in [0, 1]")));
        }
        add_note(&mut self.notes, format!("{name} {values:?} clamped: glTF has it in [0, 1]{instead}"));
        Ok(values.map(|value| value.clamp(0.0, 1.0)))
    }

    /// The index of a texture in the scene's list; `None` for textures that cannot be looked up.
    fn texture(
        &mut self,
        from: &gltf::Texture,
        uv_set: u32,
        transform: Option<&Value>,
        is_srgb: bool,
        buffers: &Buffers,
    ) -> Result<Option<usize>> {
        let other = transform.and_then(|transform| transform.get("texCoord"));
        if other.map_or(uv_set != 0, |other| *other != 0) {
            add_note(&mut self.notes, "textures on the second texture coordinates left out");
            return Ok(None);
        }
        if let Some(place) = self.known_textures.get(&(from.index(), is_srgb)) {
            return Ok(Some(*place));
        }
        let Some(image) = from.source() else {
            add_note(&mut self.notes, "textures left out whose pictures are neither PNG nor JPEG");
            return Ok(None);
        };
        let read = match image.source() {
            Source::View { view, .. } => view_bytes(&view, buffers).map(Cow::Borrowed),
            Source::Uri { uri, .. } => read_uri(uri, &mut self.files).map(Cow::Owned),
        };
        let outcome =
            read.and_then(|bytes| contained(|| Texture::decode(&bytes, is_srgb, &mut self.pixels_left)));
        let mut texture = outcome.map_err(|error| error.at(format_args!("image {}", image.index())))?;
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

/// What `KHR_texture_transform` (`None`: a texture without it) does to texture coordinates: scaling, then
/// rotation, then translation.
///
/// The rotation is counter-clockwise where v points down, as the extension's table of properties, the Khronos
/// sample viewer and three.js have it; the code in its overview turns the other way.
fn uv_transform(extension: Option<&Value>) -> Result<Affine2> {
    let Some(extension) = extension else { return Ok(Affine2::IDENTITY) };
    let damaged = |key: &str| Error::usage(format!("is damaged: {key} is not finite numbers")).at(TRANSFORM);
    let number = |value: &Value| value.as_f64().map(|value| value as f32).filter(|value| value.is_finite());
    let pair = |key: &str, default: Vec2| match extension.get(key) {
        None => Ok(default),
        Some(pair) => match (number(&pair[0]), number(&pair[1])) {
            (Some(u), Some(v)) => Ok(Vec2::new(u, v)),
            _ => Err(damaged(key)),
        },
    };
    let angle = match extension.get("rotation") {
        None => 0.0,
        Some(angle) => number(angle).ok_or_else(|| damaged("rotation"))?,
    };
    let (scale, offset) = (pair("scale", Vec2::ONE)?, pair("offset", Vec2::ZERO)?);
    Ok(Affine2::from_scale_angle_translation(scale, -angle, offset))
}
