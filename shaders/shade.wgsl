// Sums the lights over every pixel: set H over its region of normals, set L inside the cone about the mirrored view
// (Havran et al. 2005, sections 4.1, 4.2 and 5.2). CPU twin: src/render/shade_twin.rs.

struct Shade {
    // To places relative to the eye.
    eye_from_clip: mat4x4f,
    eye: vec3f,
    // Factor for what this call adds.
    weight: f32,
    // Factor for what earlier calls left; 0 drops it, whatever it is.
    keep: f32,
    size: vec2u,
    // Number of lights in set H; set L follows it.
    high_count: u32,
    // Words between two regions' lists: of H, of L. 0: no regions, all lights of the set.
    high_stride: u32,
    low_stride: u32,
    low_first_word: u32,
    // Cells along a side of the cube-map tables; that of L follows that of H.
    table_side: u32,
    low_table_side: u32,
    // Cosine of half the cone's angle; above 1: no set L.
    cone_cosine: f32,
    // Comparisons for a soft shadow; 1: hard.
    soft_samples: u32,
    seed: u32,
    // Whether this is the first call of a frame that adds emission.
    has_emission: u32,
}

struct Light {
    direction: vec3f,
    spread_rad: f32,
    irradiance: vec3f,
    // Tile of the shadow atlas; NO_TILE: never in shadow.
    tile: u32,
}

const NO_TILE = 0xffffffffu;
// Side of the table of directional albedos: cosine of the view, roughness.
const ENERGY_SIDE = 32u;
// A facet nearly along the light would be lifted off all that casts shadows on it.
const MOST_BEND_BIAS_TEXELS = 8.0;

override COUNTS: bool = false;

@group(0) @binding(0) var<uniform> shade: Shade;
@group(0) @binding(1) var<uniform> space: LightSpace;
@group(0) @binding(2) var<storage, read> lights: array<Light>;
@group(0) @binding(3) var<storage, read> tiles: array<vec4f>;
@group(0) @binding(4) var<storage, read> region_tables: array<u32>;
@group(0) @binding(5) var<storage, read> region_lists: array<u32>;
@group(0) @binding(6) var atlas: texture_depth_2d;
@group(0) @binding(7) var depths: texture_depth_2d;
@group(0) @binding(8) var normals: texture_2d<u32>;
@group(0) @binding(9) var reflectances: texture_2d<u32>;
@group(0) @binding(10) var<storage, read> energies: array<f32>;
@group(0) @binding(11) var<storage, read_write> radiance: array<vec4f>;
// Pixels that show a surface, lights looked at, lights shaded.
@group(0) @binding(12) var<storage, read_write> counts: array<atomic<u32>, 3>;

fn octahedral_direction(packed: u32) -> vec3f {
    let p = unpack2x16snorm(packed);
    let z = 1.0 - abs(p.x) - abs(p.y);
    let folded = (1.0 - abs(p.yx)) * select(vec2f(-1.0), vec2f(1.0), p >= vec2f(0.0));
    return normalize(vec3f(select(folded, p, z >= 0.0), z));
}

// Mean over the cosines and roughnesses about: bilinear.
fn directional_albedo(n_v: f32, roughness: f32) -> f32 {
    let side = f32(ENERGY_SIDE);
    let at = clamp(vec2f(n_v, roughness) * side - 0.5, vec2f(0.0), vec2f(side - 1.0));
    let low = vec2u(at);
    let high = min(low + 1u, vec2u(ENERGY_SIDE - 1u));
    let f = at - vec2f(low);
    let first = mix(energies[low.y * ENERGY_SIDE + low.x], energies[low.y * ENERGY_SIDE + high.x], f.x);
    let second = mix(energies[high.y * ENERGY_SIDE + low.x], energies[high.y * ENERGY_SIDE + high.x], f.x);
    return mix(first, second, f.y);
}

// A number in [0, 1) that differs from pixel to pixel as evenly as can be (Jimenez 2014).
fn gradient_noise(pixel: vec2f) -> f32 {
    return fract(52.9829189 * fract(dot(pixel, vec2f(0.06711056, 0.00583715))));
}

// Where a shadow map is read: the tile's window, the receiver seen from the light, and its plane.
struct Lookup {
    window: Window,
    // Corner of the tile in texels, texels for a unit across the light.
    corner: vec2f,
    texels: vec2f,
    receiver: vec3f,
    // How the height of the receiver's plane changes across the light.
    slope: vec2f,
    bias: f32,
}

// Height of the caster at a texel over the receiver's plane at the texel's centre; positive: it hides the receiver.
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

// Share of the light that passes: four comparisons, weighted bilinearly. Outside of the window nothing casts.
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

// Tangent of the angular radius of a disc whose RMS angle is `spread_rad`; near a right angle and beyond it the disc is
// the sky, which the search in a shadow map is cut to anyway.
fn disc_radius(spread_rad: f32) -> f32 {
    return 1.41421356 * tan(min(spread_rad, 1.5));
}

// Points of a disc of radius 1, evenly spread (Vogel 1979).
fn disc_point(index: u32, count: u32, turn: f32) -> vec2f {
    let angle = 2.39996323 * f32(index) + 2.0 * PI * fract(turn);
    return sqrt((f32(index) + 0.5) / f32(count)) * vec2f(cos(angle), sin(angle));
}

// By how many texels a caster must stand over a receiver's plane to hide it. The rasteriser moves corners by 1/256
// pixel, which steep triangles turn into height. Neighbouring triangles of a curved surface rise over the plane of
// this one: at an angle b between them by tan(a + b) - tan(a) a texel, which is b (1 + tan^2 a) nearly. Near their edge
// b is twice the angle `bend` between the triangle and the smoothed normal; flat things have none, and gain no bias.
fn bias_texels(slope: f32, bend: f32) -> f32 {
    return 0.25 + slope / 64.0 + min(2.0 * bend * (1.0 + slope * slope), MOST_BEND_BIAS_TEXELS);
}

// How much of its light a point keeps whose triangle is turned from the light more than its smoothed normal says: all
// at the same angle, nothing where the triangle turns away, and no edge between (Chiang, Li and Burley 2019,
// Taming the shadow terminator).
fn terminator(n_l: f32, face_l: f32, face_n: f32) -> f32 {
    let g = clamp(face_l / max(n_l * face_n, 1e-6), 0.0, 1.0);
    return g * (1.0 + g * (1.0 - g));
}

// Share of a light that reaches `position` past the casters of a tile. `radius` is the tangent of the light's angular
// radius: the penumbra is as wide as what hides the light is far (Fernando 2005).
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
    // Every texel is compared with the receiver's plane at the texel's own centre, so that a plane never shadows
    // itself, however flat the light; steeper than this the light adds next to nothing.
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

// Cell of a cube map that holds a vector, as math::cube_cell.
fn cube_cell(d: vec3f, side: u32) -> u32 {
    let magnitude = abs(d);
    var face = 0u;
    var m = magnitude.x;
    var across = vec2f(select(-d.z, d.z, d.x < 0.0), -d.y);
    if magnitude.z >= magnitude.x && magnitude.z >= magnitude.y {
        face = select(4u, 5u, d.z < 0.0);
        m = magnitude.z;
        across = vec2f(select(d.x, -d.x, d.z < 0.0), -d.y);
    } else if magnitude.y >= magnitude.x {
        face = select(2u, 3u, d.y < 0.0);
        m = magnitude.y;
        across = vec2f(d.x, select(d.z, -d.z, d.y < 0.0));
    } else {
        face = select(0u, 1u, d.x < 0.0);
    }
    let half = 0.5 * f32(side);
    let cell = min(vec2u(half + across * (half / max(m, 1e-30))), vec2u(side - 1u));
    return (face * side + cell.y) * side + cell.x;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= shade.size) {
        return;
    }
    let index = pixel.y * shade.size.x + pixel.x;
    let before = select(shade.keep * radiance[index], vec4f(0.0), shade.keep == 0.0);
    let depth = textureLoad(depths, pixel.xy, 0);
    if depth <= 0.0 {
        radiance[index] = before;
        return;
    }
    let packed_normals = textureLoad(normals, pixel.xy, 0);
    let packed = textureLoad(reflectances, pixel.xy, 0);
    var s: Surface;
    s.normal = octahedral_direction(packed_normals.x);
    s.face = octahedral_direction(packed_normals.y);
    s.diffuse = vec3f(unpack2x16float(packed.x), unpack2x16float(packed.y).x);
    s.specular = vec3f(unpack2x16float(packed.y).y, unpack2x16float(packed.z));
    s.gloss = unpack2x16float(packed.w).x;
    s.bend = unpack2x16float(packed.w).y;
    let ndc = (vec2f(pixel.xy) + 0.5) / vec2f(shade.size) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let homogeneous = shade.eye_from_clip * vec4f(ndc, depth, 1.0);
    let from_eye = homogeneous.xyz / homogeneous.w;
    let position = shade.eye + from_eye;
    let view = normalize(-from_eye);
    let mirrored = reflect(-view, s.normal);
    let face_n = dot(s.face, s.normal);
    let energy = directional_albedo(max(dot(s.normal, view), 0.0), max(s.gloss, 0.0));
    let is_glossy = any(s.specular > vec3f(0.0));
    let noise = gradient_noise(vec2f(pixel.xy)) + f32(shade.seed) * 0.61803399;

    var sum = vec3f(0.0);
    var looked_at = 0u;
    var shaded = 0u;

    // Set H: diffuse light everywhere, specular light outside of the cone.
    var first = 0u;
    var count = shade.high_count;
    var factor = 1.0;
    if shade.high_stride > 0u {
        first = region_tables[cube_cell(s.normal, shade.table_side)] * shade.high_stride;
        count = region_lists[first];
        factor = bitcast<f32>(region_lists[first + 1u]);
    }
    looked_at += count;
    for (var i = 0u; i < count; i++) {
        var number = i;
        if shade.high_stride > 0u {
            number = region_lists[first + 2u + i];
        }
        let light = lights[number];
        let n_l = dot(s.normal, light.direction);
        let face_l = dot(s.face, light.direction);
        if n_l <= 0.0 || face_l <= 0.0 {
            continue;
        }
        shaded += 1u;
        var reflectance = diffuse_reflectance(s, view, light.direction);
        if is_glossy && dot(mirrored, light.direction) < shade.cone_cosine {
            // With a cone the part of a wide light's lobe that reaches into it is what set L is there for.
            let spread_rad = select(light.spread_rad, 0.0, shade.cone_cosine <= 1.0);
            reflectance += specular_reflectance(s, view, light.direction, spread_rad, energy);
        }
        let lit = visibility(light.tile, disc_radius(light.spread_rad), position, s.face, s.bend, noise + 0.7548777 * f32(number));
        sum += factor * terminator(n_l, face_l, face_n) * n_l * lit * light.irradiance * reflectance;
    }

    // Set L: specular light inside the cone.
    if is_glossy && shade.cone_cosine <= 1.0 {
        let table = 6u * shade.table_side * shade.table_side;
        first = shade.low_first_word + region_tables[table + cube_cell(mirrored, shade.low_table_side)] * shade.low_stride;
        count = region_lists[first];
        factor = bitcast<f32>(region_lists[first + 1u]);
        looked_at += count;
        for (var i = 0u; i < count; i++) {
            let number = region_lists[first + 2u + i];
            let light = lights[shade.high_count + number];
            let n_l = dot(s.normal, light.direction);
            let face_l = dot(s.face, light.direction);
            if dot(mirrored, light.direction) < shade.cone_cosine || n_l <= 0.0 || face_l <= 0.0 {
                continue;
            }
            shaded += 1u;
            let reflectance = specular_reflectance(s, view, light.direction, light.spread_rad, energy);
            let lit = visibility(light.tile, disc_radius(light.spread_rad), position, s.face, s.bend, noise + 0.7548777 * f32(number));
            sum += factor * terminator(n_l, face_l, face_n) * n_l * lit * light.irradiance * reflectance;
        }
    }
    var alpha = 0.0;
    if shade.has_emission != 0u {
        sum += vec3f(unpack2x16float(packed_normals.z), unpack2x16float(packed_normals.w).x);
        alpha = 1.0;
    }
    radiance[index] = before + shade.weight * vec4f(sum, alpha);
    if COUNTS {
        atomicAdd(&counts[0], 1u);
        atomicAdd(&counts[1], looked_at);
        atomicAdd(&counts[2], shaded);
    }
}
