// Sums the lights over every pixel: set H over its region of normals, set L inside the cone about the
// mirrored view (Havran et al. 2005, sections 4.1, 4.2 and 5.2). CPU twin:
// src/render/directional/shade_twin.rs.

struct Shade {
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
}

struct Light {
    direction: vec3f,
    spread_rad: f32,
    irradiance: vec3f,
    // Tile of the shadow atlas; NO_TILE: never in shadow.
    tile: u32,
}

// Side of the table of directional albedos: cosine of the view, roughness.
const ENERGY_SIDE = 32u;

override COUNTS: bool = false;

@group(1) @binding(0) var<uniform> shade: Shade;
@group(1) @binding(1) var<uniform> space: LightSpace;
@group(1) @binding(2) var<storage, read> lights: array<Light>;
@group(1) @binding(3) var<storage, read> tiles: array<vec4f>;
@group(1) @binding(4) var<storage, read> region_tables: array<u32>;
@group(1) @binding(5) var<storage, read> region_lists: array<u32>;
@group(1) @binding(6) var atlas: texture_depth_2d;
@group(1) @binding(7) var<storage, read> energies: array<f32>;
// Pixels that show a surface, lights considered, lights shaded.
@group(1) @binding(8) var<storage, read_write> counts: array<atomic<u32>, 3>;

// Bilinear interpolation over the neighbouring cosines and roughnesses.
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

// Part of its light that a point keeps if its triangle is turned farther from the light than its smoothed
// normal: all at the same angle, nothing where the triangle faces away, and a smooth transition between
// (Chiang, Li and Burley 2019, Taming the shadow terminator).
fn terminator(n_l: f32, face_l: f32, face_n: f32) -> f32 {
    let g = clamp(face_l / max(n_l * face_n, 1e-6), 0.0, 1.0);
    return g * (1.0 + g * (1.0 - g));
}

// Cell of a cube map that holds a vector, as in math::cube_cell.
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
    if any(pixel.xy >= taken.size) {
        return;
    }
    if !shows_surface(pixel.xy) {
        return;
    }
    let seen = seen_at(pixel.xy);
    let s = seen.surface;
    let position = seen.position;
    let view = seen.view;
    let mirrored = reflect(-view, s.normal);
    let face_n = dot(s.face, s.normal);
    let energy = directional_albedo(max(dot(s.normal, view), 0.0), max(s.gloss, 0.0));
    let is_glossy = any(s.specular > vec3f(0.0));
    let noise = gradient_noise(vec2f(pixel.xy)) + f32(taken.seed) * 0.61803399;

    var sum = vec3f(0.0);
    var looked_at = 0u;
    var shaded = 0u;

    // Set H: diffuse light everywhere, specular light outside the cone.
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
            // With a cone, set L covers the part of a wide light's lobe that reaches into it.
            let spread_rad = select(light.spread_rad, 0.0, shade.cone_cosine <= 1.0);
            reflectance += specular_reflectance(s, view, light.direction, spread_rad, energy);
        }
        let tile = select(NO_TILE, light.tile, s.receives);
        let lit = visibility(tile, disc_radius(light.spread_rad), position, s.face, s.bend, noise + 0.7548777 * f32(number));
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
            let tile = select(NO_TILE, light.tile, s.receives);
            let lit = visibility(tile, disc_radius(light.spread_rad), position, s.face, s.bend, noise + 0.7548777 * f32(number));
            sum += factor * terminator(n_l, face_l, face_n) * n_l * lit * light.irradiance * reflectance;
        }
    }
    add_radiance(pixel.xy, sum);
    if COUNTS {
        atomicAdd(&counts[0], 1u);
        atomicAdd(&counts[1], looked_at);
        atomicAdd(&counts[2], shaded);
    }
}
