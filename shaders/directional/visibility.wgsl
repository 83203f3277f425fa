// How much of a light reaches a point: soft shadows from the atlas (Havran et al. 2005, section 5.2). A part
// of the shading pass. CPU twin: src/render/directional/shade_twin.rs.

const NO_TILE = 0xffffffffu;
// Without this limit, a facet nearly parallel to the light would be lifted off everything that casts shadows
// on it.
const MOST_BEND_BIAS_TEXELS = 8.0;

// A position at which a shadow map is read: the tile's window, the receiver as seen from the light, and its
// plane.
struct Lookup {
    window: Window,
    // Corner of the tile in texels, and texels per unit across the light.
    corner: vec2f,
    texels: vec2f,
    receiver: vec3f,
    // How the height of the receiver's plane changes across the light.
    slope: vec2f,
    bias: f32,
}

// Height of the caster at a texel over the receiver's plane at the texel's centre; positive: it hides the
// receiver.
fn caster_over_plane(at: Lookup, texel: vec2f) -> f32 {
    let inside = clamp(texel, vec2f(0.0), vec2f(space.tile_px - 1.0));
    let depth = textureLoad(atlas, vec2i(at.corner + inside), 0);
    if depth >= 1.0 {
        return -1.0; // no caster
    }
    let across = (inside + 0.5) / at.texels + at.window.centre - at.window.half;
    let plane = at.receiver.z + dot(at.slope, across - at.receiver.xy);
    return at.window.top - depth * at.window.range - plane - at.bias;
}

// Share of the light that passes: four comparisons, weighted bilinearly. Outside the window nothing casts
// shadows.
fn compare(at: Lookup, across: vec2f) -> f32 {
    let texel = (across - at.window.centre + at.window.half) * at.texels - 0.5;
    if any(texel < vec2f(-0.5)) || any(texel > vec2f(space.tile_px - 0.5)) {
        return 1.0;
    }
    let corner = floor(texel);
    let f = texel - corner;
    let lit = vec4f(
        select(1.0, 0.0, caster_over_plane(at, corner) > 0.0),
        select(1.0, 0.0, caster_over_plane(at, corner + vec2f(1.0, 0.0)) > 0.0),
        select(1.0, 0.0, caster_over_plane(at, corner + vec2f(0.0, 1.0)) > 0.0),
        select(1.0, 0.0, caster_over_plane(at, corner + vec2f(1.0, 1.0)) > 0.0),
    );
    return mix(mix(lit.x, lit.y, f.x), mix(lit.z, lit.w, f.x), f.y);
}

// Tangent of the angular radius of a disc whose RMS angle is `spread_rad`; near a right angle and beyond it
// the disc is the whole sky, and the search in a shadow map is limited anyway.
fn disc_radius(spread_rad: f32) -> f32 {
    return 1.41421356 * tan(min(spread_rad, 1.5));
}

// Points of a disc of radius 1, evenly spread (Vogel 1979).
fn disc_point(index: u32, count: u32, turn: f32) -> vec2f {
    let angle = 2.39996323 * f32(index) + 2.0 * PI * fract(turn);
    return sqrt((f32(index) + 0.5) / f32(count)) * vec2f(cos(angle), sin(angle));
}

// By how many texels a caster must stand over a receiver's plane to hide it. The rasteriser moves corners by
// 1/256 pixel, which steep triangles turn into height. Neighbouring triangles of a curved surface rise over
// the plane of this one: at an angle b between them by tan(a + b) - tan(a) per texel, which is approximately
// b (1 + tan^2 a). Near their edge b is twice the angle `bend` between the triangle and the smoothed normal;
// flat surfaces have none, and get no bias.
fn bias_texels(slope: f32, bend: f32) -> f32 {
    return 0.25 + slope / 64.0 + min(2.0 * bend * (1.0 + slope * slope), MOST_BEND_BIAS_TEXELS);
}

// Share of a light that reaches `position` past the casters of a tile. `radius` is the tangent of the light's
// angular radius: the width of the penumbra grows with the distance of the occluder (Fernando 2005).
fn visibility(tile: u32, radius: f32, position: vec3f, face: vec3f, bend: f32, turn: f32) -> f32 {
    if tile == NO_TILE {
        return 1.0;
    }
    let direction = tiles[tile].xyz;
    let basis = light_basis(direction);
    var at: Lookup;
    at.window = light_window(basis, space);
    at.corner = vec2f(f32(tile % space.tiles_per_side), f32(tile / space.tiles_per_side)) * space.tile_px;
    at.texels = 0.5 * space.tile_px / at.window.half;
    at.receiver = transpose(basis) * position;
    // Every texel is compared with the receiver's plane at the texel's own centre, so that a plane never
    // shadows itself, however flat the light; steeper than this the light adds next to nothing.
    let n = transpose(basis) * face;
    at.slope = -n.xy / max(n.z, 0.01);
    at.bias = bias_texels(length(at.slope), bend) * max(1.0 / at.texels.x, 1.0 / at.texels.y) + 1e-5 * at.window.range;
    let above = at.window.top - at.receiver.z;
    if above <= at.bias {
        return 1.0;
    }
    let reach = min(above * radius, 0.5 * min(at.window.half.x, at.window.half.y));
    if shade.soft_samples <= 1u || reach * max(at.texels.x, at.texels.y) < 0.5 {
        return compare(at, at.receiver.xy);
    }
    var height = 0.0;
    var found = 0.0;
    for (var i = 0u; i < shade.soft_samples; i++) {
        let across = at.receiver.xy + reach * disc_point(i, shade.soft_samples, turn);
        let texel = floor((across - at.window.centre + at.window.half) * at.texels);
        if all(texel >= vec2f(0.0)) && all(texel < vec2f(space.tile_px)) {
            let over = caster_over_plane(at, texel);
            height += max(over, 0.0);
            found += select(0.0, 1.0, over > 0.0);
        }
    }
    if found == 0.0 {
        return 1.0;
    }
    // The penumbra, but not sharper than the map itself.
    let penumbra = clamp(height / found * radius, min(0.5 / max(at.texels.x, at.texels.y), reach), reach);
    var lit = 0.0;
    for (var i = 0u; i < shade.soft_samples; i++) {
        lit += compare(at, at.receiver.xy + penumbra * disc_point(i, shade.soft_samples, turn));
    }
    return lit / f32(shade.soft_samples);
}
