// The data of a scene on the device, for the passes that draw it.

struct Instance {
    world_from_mesh: mat4x4f,
    normal_from_mesh: mat4x4f,
    // Whether shadows fall on it.
    receives: u32,
}

// From a vertex's texture coordinates to those of a texture.
struct UvTransform {
    // Where steps along u and v lead: two vectors.
    axes: vec4f,
    offset: vec2f,
}

struct Material {
    base_colour: vec4f,
    // Phong only: reflectance of the lobe.
    specular: vec3f,
    // Phong: minus the exponent. Metal-rough: the roughness.
    gloss: f32,
    emissive: vec3f,
    metallic: f32,
    normal_scale: f32,
    // Pixels with less alpha are discarded; negative: none.
    alpha_cutoff: f32,
    has_normal_map: u32,
    base_colour_uv: UvTransform,
    metallic_roughness_uv: UvTransform,
    normal_uv: UvTransform,
    emissive_uv: UvTransform,
}

@group(1) @binding(0) var<uniform> material: Material;
@group(1) @binding(1) var texture_sampler: sampler;
@group(1) @binding(2) var base_colour_map: texture_2d<f32>;
@group(1) @binding(3) var metallic_roughness_map: texture_2d<f32>;
@group(1) @binding(4) var normal_map: texture_2d<f32>;
@group(1) @binding(5) var emissive_map: texture_2d<f32>;

fn transformed(uv: vec2f, by: UvTransform) -> vec2f {
    return by.axes.xy * uv.x + by.axes.zw * uv.y + by.offset;
}

fn base_colour(uv: vec2f, colour: vec4f) -> vec4f {
    let place = transformed(uv, material.base_colour_uv);
    return material.base_colour * colour * textureSample(base_colour_map, texture_sampler, place);
}
