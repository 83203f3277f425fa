// Adds the light of a ground that reaches to the horizon on all sides, is lit evenly and not occluded. CPU
// twin: render::ambient::twin.

struct Ground {
    radiance: vec3f,
}

@group(1) @binding(0) var<uniform> ground: Ground;

// The irradiance divided by pi: the lower half of the sphere has the ground's radiance.
fn irradiance_over_pi(normal: vec3f) -> vec3f {
    return ground.radiance * (0.5 * (1.0 - normal.y));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= taken.size) || !shows_surface(pixel.xy) {
        return;
    }
    let s = seen_at(pixel.xy).surface;
    add_radiance(pixel.xy, s.diffuse * irradiance_over_pi(s.normal));
}
