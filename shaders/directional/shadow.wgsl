// Draws the casters into one tile of the shadow atlas: depth 0 is the caster nearest to the light, 1 the
// lowest.

@group(0) @binding(0) var<uniform> space: LightSpace;
@group(0) @binding(1) var<storage, read> tiles: array<vec4f>;
@group(0) @binding(2) var<storage, read> instances: array<Instance>;

@vertex
fn vertex(@location(0) position: vec3f, @builtin(instance_index) index: u32) -> @builtin(position) vec4f {
    return in_tile(position, index);
}

struct CutOut {
    @builtin(position) clip: vec4f,
    @location(0) uv: vec2f,
    @location(1) colour: vec4f,
}

// For materials with holes.
@vertex
fn vertex_cut_out(
    @location(0) position: vec3f,
    @location(2) uv: vec2f,
    @location(3) colour: vec4f,
    @builtin(instance_index) index: u32,
) -> CutOut {
    return CutOut(in_tile(position, index), uv, colour);
}

@fragment
fn fragment_cut_out(in: CutOut) {
    if base_colour(in.uv, in.colour).a < material.alpha_cutoff {
        discard;
    }
}

fn in_tile(position: vec3f, index: u32) -> vec4f {
    // One number encodes both tile and instance: base vertex and base instance are the only parameters of a
    // draw.
    let count = arrayLength(&instances);
    let world = instances[index % count].world_from_mesh * vec4f(position, 1.0);
    let basis = light_basis(tiles[index / count].xyz);
    let window = light_window(basis, space);
    let light = transpose(basis) * world.xyz;
    let across = (light.xy - window.centre) / window.half;
    // Rows of the tile rise with the second axis; clip space has its y upwards.
    return vec4f(across.x, -across.y, (window.top - light.z) / window.range, 1.0);
}
