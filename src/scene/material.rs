use glam::Affine2;

/// Albedo of surfaces that have neither a material nor colours.
pub const GREY: f32 = 0.6;

/// How a surface reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shading {
    /// The metallic-roughness model as glTF 2.0 defines it (appendix B: GGX, Smith, Schlick; F0 = 0.04 or the
    /// base colour).
    MetalRough {
        /// 0 for dielectrics, 1 for metals; times the blue channel of the texture.
        metallic: f32,
        /// Perceptual roughness in [0, 1], alpha = roughness^2; times the green channel of the texture.
        roughness: f32,
    },
    /// A Lambertian term with the base colour as albedo, and Phong's lobe around the mirror direction (Havran
    /// et al. 2005, section 5). With zero `specular` this is Lambert's law alone.
    Phong {
        /// Colour of the lobe (MTL `Ks`), linear, >= 0.
        specular: [f32; 3],
        /// Exponent of the cosine (MTL `Ns`), >= 0.
        exponent: f32,
    },
}

/// What a surface is made of. Colours are linear, Rec. 709 primaries. Textures are indices into
/// [`Scene::textures`](super::Scene::textures), each looked up at its own affine function of the vertex's `uv`.
///
/// Occlusion textures of glTF files are ignored on purpose: they hold the occlusion of ambient light, which
/// the lights with their shadow maps produce already, so it would be counted twice. Every triangle is visible
/// from both sides, and casts shadows from both, whatever `doubleSided` says: many files leave it out or have
/// inconsistent winding.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// How the surface reflects.
    pub shading: Shading,
    /// Albedo and alpha, in [0, 1]; times the vertex colour, times the texture.
    pub base_colour: [f32; 4],
    /// Albedo and alpha (sRGB).
    pub base_colour_texture: Option<usize>,
    /// From the vertex's `uv` to coordinates of the base colour's texture.
    pub base_colour_uv: Affine2,
    /// Normals in the tangent frame as in glTF: `2 t - 1`, green pointing up in the picture (against v). The
    /// frame follows from the derivatives of `uv`; tangents of files are not read.
    pub normal_texture: Option<usize>,
    /// From the vertex's `uv` to coordinates of the normal texture, which its axes follow.
    pub normal_uv: Affine2,
    /// Factor on x and y of the normal texture.
    pub normal_scale: f32,
    /// Roughness in green, metalness in blue (linear).
    pub metallic_roughness_texture: Option<usize>,
    /// From the vertex's `uv` to coordinates of that texture.
    pub metallic_roughness_uv: Affine2,
    /// Radiance that the surface emits, >= 0; times the texture. It does not light other surfaces. The
    /// renderer clamps it to 65504.
    pub emissive: [f32; 3],
    /// Emitted colour (sRGB).
    pub emissive_texture: Option<usize>,
    /// From the vertex's `uv` to coordinates of the emitted colour's texture.
    pub emissive_uv: Affine2,
    /// Where alpha is below this value the surface is absent, also from shadows. `None`: opaque, alpha
    /// unused.
    pub alpha_cutoff: Option<f32>,
}

impl Material {
    /// A surface that reflects by Lambert's law: albedo `colour`, linear, in [0, 1].
    pub fn lambert(colour: [f32; 3]) -> Self {
        Self::new(Shading::Phong { specular: [0.0; 3], exponent: 0.0 }, colour)
    }

    /// An opaque material without textures; `colour` is linear, in [0, 1].
    pub fn new(shading: Shading, colour: [f32; 3]) -> Self {
        Self {
            shading,
            base_colour: [colour[0], colour[1], colour[2], 1.0],
            base_colour_texture: None,
            base_colour_uv: Affine2::IDENTITY,
            normal_texture: None,
            normal_uv: Affine2::IDENTITY,
            normal_scale: 1.0,
            metallic_roughness_texture: None,
            metallic_roughness_uv: Affine2::IDENTITY,
            emissive: [0.0; 3],
            emissive_texture: None,
            emissive_uv: Affine2::IDENTITY,
            alpha_cutoff: None,
        }
    }
}
