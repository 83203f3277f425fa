// Radiance to a screen: exposure and a tone curve. The target encodes the result as sRGB. CPU twin:
// render::view::tone::twin::fragment.

struct Exposure {
    log_average: f32,
    log_key: f32,
    log_white: f32,
    started: u32,
}

struct Screen {
    size: vec2u,
    // REINHARD, SRGB, or none.
    curve: u32,
    // Whether the background is left out and alpha holds the coverage of the pixel.
    is_transparent: u32,
    // Factor on radiance, and the value that becomes white; a factor of 0: both come from the picture.
    fixed_scale: f32,
    fixed_white: f32,
}

@group(0) @binding(0) var<uniform> screen: Screen;
@group(0) @binding(1) var<storage, read> radiance: array<vec4f>;
@group(0) @binding(2) var<storage, read> exposure: Exposure;

const REINHARD = 0u;
const SRGB = 1u;
// Radiance behind the scene, in log-averages.
const BACKDROP = 0.25;
// The value that a log-average is mapped to where the picture does not determine it.
const MIDDLE_GREY = 0.18;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    // One triangle that covers the screen.
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// Reinhard's global operator (2002, equation 4).
fn reinhard(scaled: vec3f, white: f32) -> vec3f {
    let luminance = dot(scaled, vec3f(0.2126, 0.7152, 0.0722));
    return scaled * (1.0 + luminance / (white * white)) / (1.0 + luminance);
}

// As math::linear_from_srgb: undoes the target's encoding in advance.
fn linear_from_srgb(coded: vec3f) -> vec3f {
    return select(pow((coded + 0.055) / 1.055, vec3f(2.4)), coded / 12.92, coded <= vec3f(0.04045));
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = min(vec2u(position.xy), screen.size - 1u);
    let seen = radiance[pixel.y * screen.size.x + pixel.x];
    var scale = screen.fixed_scale;
    var white = screen.fixed_white;
    var backdrop = BACKDROP * MIDDLE_GREY;
    if screen.fixed_scale == 0.0 {
        scale = exp2(exposure.log_key - exposure.log_average);
        white = max(scale * exp2(exposure.log_white), 1.0);
        backdrop = BACKDROP * exp2(exposure.log_key);
    }
    var scaled = scale * seen.rgb + (1.0 - seen.a) * backdrop;
    if screen.is_transparent != 0u {
        // PNG files store colours that are not multiplied by alpha.
        scaled = scale * (seen.rgb / max(seen.a, 1e-6));
    }
    // This is so far above white that it makes no difference, and its square is still finite.
    scaled = min(scaled, vec3f(1e18));
    let alpha = select(1.0, seen.a, screen.is_transparent != 0u);
    if screen.curve == REINHARD {
        return vec4f(reinhard(scaled, white), alpha);
    }
    let clipped = clamp(scaled, vec3f(0.0), vec3f(1.0));
    if screen.curve == SRGB {
        return vec4f(clipped, alpha);
    }
    return vec4f(linear_from_srgb(clipped), alpha);
}
