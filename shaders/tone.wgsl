// Radiance to a screen: Reinhard's global operator (2002, equations 2 and 4). The target codes the result as sRGB.
// CPU twin: render::tone::twin::screen.

struct Exposure {
    log_average: f32,
    log_key: f32,
    log_white: f32,
    started: u32,
}

struct Screen {
    size: vec2u,
}

@group(0) @binding(0) var<uniform> screen: Screen;
@group(0) @binding(1) var<storage, read> radiance: array<vec4f>;
@group(0) @binding(2) var<storage, read> exposure: Exposure;

// Radiance behind the scene, in log-averages.
const BACKDROP = 0.25;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    // One triangle that covers the screen.
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = min(vec2u(position.xy), screen.size - 1u);
    let seen = radiance[pixel.y * screen.size.x + pixel.x];
    let scale = exp2(exposure.log_key - exposure.log_average);
    // As far above white as makes no difference, and its square is still a number.
    let scaled = min(scale * seen.rgb + (1.0 - seen.a) * BACKDROP * exp2(exposure.log_key), vec3f(1e18));
    let luminance = dot(scaled, vec3f(0.2126, 0.7152, 0.0722));
    let white = max(scale * exp2(exposure.log_white), 1.0);
    return vec4f(scaled * (1.0 + luminance / (white * white)) / (1.0 + luminance), 1.0);
}
