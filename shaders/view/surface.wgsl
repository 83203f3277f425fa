// Draws the visible surface of every pixel: normals, reflectances and emission. Depth is reversed: 0 is
// infinitely far.

struct Camera {
    // From positions relative to the eye.
    clip_from_eye: mat4x4f,
    eye: vec3f,
}

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> instances: array<Instance>;

struct Varyings {
    @builtin(position) clip: vec4f,
    // Position relative to the eye.
    @location(0) from_eye: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) colour: vec4f,
    @location(4) @interpolate(flat) receives: u32,
}

@vertex
fn vertex(
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) colour: vec4f,
    @builtin(instance_index) index: u32,
) -> Varyings {
    let world = instances[index].world_from_mesh * vec4f(position, 1.0);
    var out: Varyings;
    out.from_eye = world.xyz - camera.eye;
    out.clip = camera.clip_from_eye * vec4f(out.from_eye, 1.0);
    out.normal = (instances[index].normal_from_mesh * vec4f(normal, 0.0)).xyz;
    out.uv = uv;
    out.colour = colour;
    out.receives = instances[index].receives;
    return out;
}

struct Surface {
    // Octahedral shading normal, octahedral normal of the triangle (both towards the eye); emission as
    // halves, and 1 where the surface receives shadows.
    @location(0) normals: vec4u,
    // Diffuse and specular reflectance, gloss, and the angle between the normal and the triangle's, as
    // halves.
    @location(1) reflectances: vec4u,
}

// Cigolle et al. 2014: the sphere folded onto the square.
fn octahedral(n: vec3f) -> u32 {
    let p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    let folded = (1.0 - abs(p.yx)) * select(vec2f(-1.0), vec2f(1.0), p >= vec2f(0.0));
    return pack2x16snorm(select(folded, p, n.z >= 0.0));
}

// Normal map without tangents in the mesh: the texture's axes come from screen derivatives.
fn mapped_normal(n: vec3f, sample: vec3f, dp_dx: vec3f, dp_dy: vec3f, duv_dx: vec2f, duv_dy: vec2f) -> vec3f {
    let across_y = cross(dp_dy, n);
    let across_x = cross(n, dp_dx);
    let tangent = across_y * duv_dx.x + across_x * duv_dy.x;
    let bitangent = across_y * duv_dx.y + across_x * duv_dy.y;
    let longest = max(dot(tangent, tangent), dot(bitangent, bitangent));
    if longest <= 0.0 {
        return n;
    }
    let scale = inverseSqrt(longest);
    let bent = (2.0 * sample - 1.0) * vec3f(material.normal_scale, material.normal_scale, 1.0);
    // In the file's convention the second axis points up in the picture, against v.
    return tangent * scale * bent.x - bitangent * scale * bent.y + n * bent.z;
}

@fragment
fn fragment(in: Varyings) -> Surface {
    // Derivatives and samples first: they need all four pixels of a quad.
    let dp_dx = dpdx(in.from_eye);
    let dp_dy = dpdy(in.from_eye);
    let normal_uv = transformed(in.uv, material.normal_uv);
    let duv_dx = dpdx(normal_uv);
    let duv_dy = dpdy(normal_uv);
    let base = base_colour(in.uv, in.colour);
    let metal_rough_uv = transformed(in.uv, material.metallic_roughness_uv);
    let metal_rough = textureSample(metallic_roughness_map, texture_sampler, metal_rough_uv);
    let normal_sample = textureSample(normal_map, texture_sampler, normal_uv).xyz;
    let emissive_uv = transformed(in.uv, material.emissive_uv);
    // Halves cannot hold larger values.
    let emission = min(material.emissive * textureSample(emissive_map, texture_sampler, emissive_uv).xyz, vec3f(65504.0));
    if base.a < material.alpha_cutoff {
        discard;
    }

    // Scaled, so that the products are within the range of floats for scenes of any size.
    let longest = max(abs(dp_dx), abs(dp_dy));
    let scale = 1.0 / max(max(longest.x, max(longest.y, longest.z)), 1e-37);
    var face = cross(scale * dp_dx, scale * dp_dy);
    let area = dot(face, face);
    // A triangle seen edge-on has no usable derivatives; the normals of its vertices are better.
    face = select(normalize(in.normal), face * inverseSqrt(max(area, 1e-30)), area > 1e-12);
    face = select(face, -face, dot(face, in.from_eye) > 0.0);
    var normal = normalize(in.normal);
    // Angle between the triangle and the smoothed normal, for small angles.
    let bend = min(distance(normal, face), distance(normal, -face));
    if material.has_normal_map != 0u {
        normal = normalize(mapped_normal(normal, normal_sample, dp_dx, dp_dy, duv_dx, duv_dy));
    }
    // Back sides are shaded like front sides.
    normal = select(normal, -normal, dot(normal, face) < 0.0);

    var diffuse = base.rgb;
    var specular = material.specular;
    var gloss = material.gloss;
    if gloss >= 0.0 {
        let metallic = clamp(material.metallic * metal_rough.b, 0.0, 1.0);
        diffuse = base.rgb * (1.0 - metallic);
        specular = mix(vec3f(0.04), base.rgb, metallic);
        gloss = clamp(material.gloss * metal_rough.g, 0.0, 1.0);
    }
    var out: Surface;
    out.normals = vec4u(
        octahedral(normal),
        octahedral(face),
        pack2x16float(emission.rg),
        pack2x16float(vec2f(emission.b, f32(in.receives))),
    );
    out.reflectances = vec4u(
        pack2x16float(diffuse.rg),
        pack2x16float(vec2f(diffuse.b, specular.r)),
        pack2x16float(specular.gb),
        pack2x16float(vec2f(gloss, bend)),
    );
    return out;
}
