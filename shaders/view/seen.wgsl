// The parts of a view that a lighting reads, and how it adds its light; every lighting puts this file before
// its own. CPU twin: src/render/view/seen_twin.rs.

// The picture that is taken: one sample of every pixel.
struct Sample {
    // To positions relative to the eye.
    eye_from_clip: mat4x4f,
    eye: vec3f,
    // Factor for the light that this sample adds.
    weight: f32,
    // Factor for the sum of earlier samples; 0 drops it, whatever it is.
    keep: f32,
    // Whether surfaces count and emit in this pass: once for every sample, however often light is added.
    has_emission: u32,
    size: vec2u,
    seed: u32,
}

struct Surface {
    normal: vec3f,
    // Normal of the triangle.
    face: vec3f,
    diffuse: vec3f,
    specular: vec3f,
    // Metal-rough: the roughness, 0 to 1. Phong: minus the exponent.
    gloss: f32,
    // Angle between the triangle and its smoothed normal, before a normal map.
    bend: f32,
    // Whether shadows fall on it.
    receives: bool,
}

struct Seen {
    position: vec3f,
    // Towards the eye.
    view: vec3f,
    surface: Surface,
}

@group(0) @binding(0) var<uniform> taken: Sample;
@group(0) @binding(1) var depths: texture_depth_2d;
@group(0) @binding(2) var normals: texture_2d<u32>;
@group(0) @binding(3) var reflectances: texture_2d<u32>;
// Linear RGB, and the coverage of the pixel.
@group(0) @binding(4) var<storage, read_write> radiance: array<vec4f>;

fn octahedral_direction(packed: u32) -> vec3f {
    let p = unpack2x16snorm(packed);
    let z = 1.0 - abs(p.x) - abs(p.y);
    let folded = (1.0 - abs(p.yx)) * select(vec2f(-1.0), vec2f(1.0), p >= vec2f(0.0));
    return normalize(vec3f(select(folded, p, z >= 0.0), z));
}

fn shows_surface(pixel: vec2u) -> bool {
    return textureLoad(depths, pixel, 0) > 0.0;
}

// Position relative to the eye of a depth behind the centre of a pixel.
fn from_eye(pixel: vec2u, depth: f32) -> vec3f {
    let ndc = (vec2f(pixel) + 0.5) / vec2f(taken.size) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let homogeneous = taken.eye_from_clip * vec4f(ndc, depth, 1.0);
    return homogeneous.xyz / homogeneous.w;
}

// The data of a pixel that shows a surface.
fn seen_at(pixel: vec2u) -> Seen {
    let packed_normals = textureLoad(normals, pixel, 0);
    let packed = textureLoad(reflectances, pixel, 0);
    var s: Surface;
    s.normal = octahedral_direction(packed_normals.x);
    s.face = octahedral_direction(packed_normals.y);
    s.diffuse = vec3f(unpack2x16float(packed.x), unpack2x16float(packed.y).x);
    s.specular = vec3f(unpack2x16float(packed.y).y, unpack2x16float(packed.z));
    s.gloss = unpack2x16float(packed.w).x;
    s.bend = unpack2x16float(packed.w).y;
    s.receives = unpack2x16float(packed_normals.w).y > 0.0;
    let place = from_eye(pixel, textureLoad(depths, pixel, 0));
    return Seen(taken.eye + place, normalize(-place), s);
}

// Adds light that a pixel's surface sends to the eye.
fn add_radiance(pixel: vec2u, light: vec3f) {
    let index = pixel.y * taken.size.x + pixel.x;
    radiance[index] += vec4f(taken.weight * light, 0.0);
}
