// Starts a sample with the sum of earlier ones, the emission of surfaces, and the background where there is
// no surface; then the lightings add to it. CPU twin: src/render/view/seen_twin.rs, of the panorama
// src/render/view/background.rs.

struct Background {
    colour: vec3f,
    kind: u32,
    // Polar angle of the panorama's lower edge.
    rim_rad: f32,
}

const NOTHING = 0u;
const COLOUR = 1u;
const TAU = 6.28318531;

@group(1) @binding(0) var<uniform> background: Background;
// Columns are azimuth, rows the polar angle.
@group(1) @binding(1) var panorama: texture_2d<f32>;

// Across the seam the picture continues at the other edge; at the poles the last row is repeated.
fn panorama_texel(column: i32, row: i32) -> vec3f {
    let size = vec2i(textureDimensions(panorama));
    return textureLoad(panorama, vec2i((column + size.x) % size.x, clamp(row, 0, size.y - 1)), 0).rgb;
}

fn panorama_at(d: vec3f) -> vec3f {
    let theta = atan2(length(d.xz), d.y);
    if theta > background.rim_rad {
        return vec3f(0.0);
    }
    let size = vec2f(textureDimensions(panorama));
    // At the poles WGSL leaves atan2 undefined; every azimuth is right there.
    let is_pole = d.x == 0.0 && d.z == 0.0;
    let azimuth = select(atan2(d.z, select(d.x, 1.0, is_pole)), 0.0, is_pole);
    let at = vec2f(fract(azimuth / TAU), theta / background.rim_rad) * size - 0.5;
    let low = vec2i(floor(at));
    let f = at - floor(at);
    let first = mix(panorama_texel(low.x, low.y), panorama_texel(low.x + 1, low.y), f.x);
    let second = mix(panorama_texel(low.x, low.y + 1), panorama_texel(low.x + 1, low.y + 1), f.x);
    return mix(first, second, f.y);
}

// The background, with the coverage of the pixel.
fn behind(pixel: vec2u) -> vec4f {
    if background.kind == NOTHING {
        return vec4f(0.0);
    }
    if background.kind == COLOUR {
        return vec4f(background.colour, 1.0);
    }
    return vec4f(panorama_at(normalize(from_eye(pixel, 1.0))), 1.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= taken.size) {
        return;
    }
    let index = pixel.y * taken.size.x + pixel.x;
    // Not a product with 0, because the old value may be infinite.
    let before = select(taken.keep * radiance[index], vec4f(0.0), taken.keep == 0.0);
    var own = vec4f(0.0);
    if taken.has_emission != 0u {
        if shows_surface(pixel.xy) {
            let packed = textureLoad(normals, pixel.xy, 0);
            own = vec4f(unpack2x16float(packed.z), unpack2x16float(packed.w).x, 1.0);
        } else {
            own = behind(pixel.xy);
        }
    }
    radiance[index] = before + taken.weight * own;
}
