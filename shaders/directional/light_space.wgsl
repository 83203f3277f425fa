// How a directional light sees the scene. Both the pass that draws the shadow maps and the one that reads
// them rebuild a light's projection from its direction alone (Havran et al. 2005, section 5.2.1): the extents
// below are the only data that they share. CPU twin: src/render/directional/light_space.rs.

// Axis-aligned box around the shadow casters, and the atlas of square tiles.
struct LightSpace {
    caster_centre: vec3f,
    tile_px: f32,
    caster_half: vec3f,
    tiles_per_side: u32,
}

// The extent of a shadow map: a rectangle across the light, and a range of heights along it.
struct Window {
    centre: vec2f,
    half: vec2f,
    // Height of the caster nearest to the light, and how far below it the lowest lies.
    top: f32,
    range: f32,
}

// Right-handed axes across and towards a light, as columns (Duff et al. 2017, about +Y). They turn smoothly
// with the direction down to 30 degrees below the horizon, so that the shadow map of a moving light does not
// jump.
fn light_basis(d: vec3f) -> mat3x3f {
    let s = select(-1.0, 1.0, d.y > -0.5);
    let a = -1.0 / (s + d.y);
    let b = d.x * d.z * a;
    return mat3x3f(vec3f(1.0 + s * d.x * d.x * a, -s * d.x, s * b), vec3f(b, -d.z, s + d.z * d.z * a), d);
}

// The tightest window around the box: outside it nothing casts shadows. A border of two texels keeps
// neighbouring tiles out of the filters.
fn light_window(basis: mat3x3f, space: LightSpace) -> Window {
    let caster = transpose(basis) * space.caster_centre;
    let extent = transpose(mat3x3f(abs(basis[0]), abs(basis[1]), abs(basis[2])));
    let half = extent * space.caster_half;
    let border = space.tile_px / (space.tile_px - 4.0);
    var window: Window;
    window.centre = caster.xy;
    window.half = max(half.xy * border, vec2f(1e-6));
    // Geometry in the plane of the box's top must not be clipped by rounding, and depth 1 means that there is
    // no caster.
    let margin = 1e-3 * half.z + 1e-6 * (abs(caster.z) + half.x + half.y);
    window.top = caster.z + half.z + margin;
    window.range = max(2.0 * (half.z + margin), 1e-6);
    return window;
}
