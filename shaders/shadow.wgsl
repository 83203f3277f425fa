// Draws the casters into one tile of the shadow atlas: depth 0 is the caster nearest to the light, 1 the lowest.

struct Instance {
    world_from_mesh: mat4x4f,
    normal_from_mesh: mat4x4f,
}

@group(0) @binding(0) var<uniform> space: LightSpace;
@group(0) @binding(1) var<storage, read> tiles: array<vec4f>;
@group(0) @binding(2) var<storage, read> instances: array<Instance>;

@vertex
fn vertex(@location(0) position: vec3f, @builtin(instance_index) index: u32) -> @builtin(position) vec4f {
    // One number says which tile and which instance: base vertices and instances are all that a draw can carry.
    let count = arrayLength(&instances);
    let world = instances[index % count].world_from_mesh * vec4f(position, 1.0);
    let basis = light_basis(tiles[index / count].xyz);
    let window = light_window(basis, space);
    let light = transpose(basis) * world.xyz;
    let across = (light.xy - window.centre) / window.half;
    // Rows of the tile rise with the second axis; clip space has its y upwards.
    return vec4f(across.x, -across.y, (window.top - light.z) / window.range, 1.0);
}
