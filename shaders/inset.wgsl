// A small picture in a corner of the screen: the viewport is as large as the picture, so that texels and
// pixels coincide.

@group(0) @binding(0) var picture: texture_2d<f32>;

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) texel: vec2f,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Corner {
    // One triangle that covers the viewport.
    let corner = vec2f(f32(index & 1u) * 2.0, f32(index >> 1u) * 2.0);
    let size = vec2f(textureDimensions(picture));
    return Corner(vec4f(corner.x * 2.0 - 1.0, 1.0 - corner.y * 2.0, 0.0, 1.0), corner * size);
}

@fragment
fn fragment(at: Corner) -> @location(0) vec4f {
    let last = textureDimensions(picture) - 1u;
    return textureLoad(picture, min(vec2u(at.texel), last), 0);
}
