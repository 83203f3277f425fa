// How a directional light sees the scene. Both the pass that draws the shadow maps and the one that reads them
// rebuild a light's projection from its direction alone (Havran et al. 2005, section 5.2.1): the extents below are
// all that they share. CPU twin: src/render/light_space.rs.

// Axis-aligned boxes about what casts and what receives shadows, and the atlas of square tiles.
struct LightSpace {
    caster_centre: vec3f,
    tile_px: f32,
    caster_half: vec3f,
    tiles_per_side: u32,
    receiver_centre: vec3f,
    receiver_half: vec3f,
}

// What a shadow map shows: a rectangle across the light, and a range of heights along it.
struct Window {
    centre: vec2f,
    half: vec2f,
    // Height of the caster nearest to the light, and how far below it the lowest lies.
    top: f32,
    range: f32,
}

// Right-handed axes across and towards a light, as columns (Duff et al. 2017, about +Y). They turn smoothly with the
// direction down to 30 degrees below the horizon, so that a moving light does not let its shadow map jump.
fn light_basis(d: vec3f) -> mat3x3f {
    let s = select(-1.0, 1.0, d.y > -0.5);
    let a = -1.0 / (s + d.y);
    let b = d.x * d.z * a;
    return mat3x3f(vec3f(1.0 + s * d.x * d.x * a, -s * d.x, s * b), vec3f(b, -d.z, s + d.z * d.z * a), d);
}

// The tightest window about what both boxes cover: shadows fall only where a caster and a receiver overlap. A border
// of two texels keeps neighbouring tiles out of the filters.
fn light_window(basis: mat3x3f, space: LightSpace) -> Window {
    let caster = transpose(basis) * space.caster_centre;
    let receiver = transpose(basis) * space.receiver_centre;
    let extent = transpose(mat3x3f(abs(basis[0]), abs(basis[1]), abs(basis[2])));
    let caster_half = extent * space.caster_half;
    let receiver_half = extent * space.receiver_half;
    let low = max(caster.xy - caster_half.xy, receiver.xy - receiver_half.xy);
    let high = min(caster.xy + caster_half.xy, receiver.xy + receiver_half.xy);
    let border = space.tile_px / (space.tile_px - 4.0);
    var window: Window;
    window.centre = 0.5 * (low + high);
    window.half = max(0.5 * (high - low) * border, vec2f(1e-6));
    window.top = caster.z + caster_half.z;
    // A little more than that, since depth 1 means that there is nothing.
    window.range = max(2.001 * caster_half.z, 1e-6);
    return window;
}
