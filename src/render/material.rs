//! Materials and their textures on the device.

use crate::error::{Error, Result};
use crate::gpu::{Gpu, UNIFORM};
use crate::scene::{Material, Scene, Shading, Texture, Wrap};
use bytemuck::{Pod, Zeroable};
use glam::Affine2;
use lightcast_core::math::{linear_from_srgb, srgb_from_linear};
use wgpu::util::{BufferInitDescriptor, DeviceExt, TextureDataOrder};

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct MaterialUniform {
    pub base_colour: [f32; 4],
    pub specular: [f32; 3],
    pub gloss: f32,
    pub emissive: [f32; 3],
    pub metallic: f32,
    pub normal_scale: f32,
    pub alpha_cutoff: f32,
    pub has_normal_map: u32,
    pub pad: u32,
    pub base_colour_uv: UvTransform,
    pub metallic_roughness_uv: UvTransform,
    pub normal_uv: UvTransform,
    pub emissive_uv: UvTransform,
}

/// From a vertex's texture coordinates to those of a texture.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct UvTransform {
    /// Where steps along u and v lead: two vectors.
    pub axes: [f32; 4],
    pub offset: [f32; 2],
    pub pad: [f32; 2],
}

impl From<Affine2> for UvTransform {
    fn from(transform: Affine2) -> Self {
        let axes = transform.matrix2.to_cols_array();
        Self { axes, offset: transform.translation.to_array(), pad: [0.0; 2] }
    }
}

impl From<&Material> for MaterialUniform {
    fn from(material: &Material) -> Self {
        let (specular, gloss, metallic) = match material.shading {
            Shading::MetalRough { metallic, roughness } => ([0.0; 3], roughness, metallic),
            // The sign distinguishes the models, so an exponent of 0 must still be negative.
            Shading::Phong { specular, exponent } => (specular, -exponent.max(1e-3), 0.0),
        };
        Self {
            base_colour: material.base_colour,
            specular,
            gloss,
            emissive: material.emissive,
            metallic,
            normal_scale: material.normal_scale,
            alpha_cutoff: material.alpha_cutoff.unwrap_or(-1.0),
            has_normal_map: u32::from(material.normal_texture.is_some()),
            pad: 0,
            base_colour_uv: material.base_colour_uv.into(),
            metallic_roughness_uv: material.metallic_roughness_uv.into(),
            normal_uv: material.normal_uv.into(),
            emissive_uv: material.emissive_uv.into(),
        }
    }
}

/// Layout of a material's bind group, as `shaders/scene.wgsl` declares it.
pub(super) fn layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    let stage = wgpu::ShaderStages::FRAGMENT;
    let texture = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: true },
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
    gpu.bind_group_layout(&[
        (0, stage, UNIFORM),
        (1, stage, sampler),
        (2, stage, texture),
        (3, stage, texture),
        (4, stage, texture),
        (5, stage, texture),
    ])
}

/// A bind group for each material of a scene.
pub(super) struct Materials(Vec<wgpu::BindGroup>);

impl Materials {
    /// # Errors
    /// When a texture is larger than the device supports.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let layout = layout(gpu);
        let textures =
            scene.textures.iter().map(|texture| upload(gpu, texture)).collect::<Result<Vec<_>>>()?;
        let white = Texture {
            width: 1,
            height: 1,
            rgba8: vec![255; 4],
            is_srgb: false,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
        };
        let white_view = upload(gpu, &white)?;
        let bind_groups = scene.materials.iter().map(|material| {
            let uniform = gpu.device.create_buffer_init(&BufferInitDescriptor {
                label: Some("material"),
                contents: bytemuck::bytes_of(&MaterialUniform::from(material)),
                usage: wgpu::BufferUsages::UNIFORM,
            });
            let maps = [
                material.base_colour_texture,
                material.metallic_roughness_texture,
                material.normal_texture,
                material.emissive_texture,
            ];
            // One sampler serves all textures of a material: no files are known that wrap them differently.
            let wrapped = maps.iter().flatten().next().map_or(&white, |&index| &scene.textures[index]);
            let sampler = sampler(gpu, wrapped);
            let view = |map: Option<usize>| {
                wgpu::BindingResource::TextureView(map.map_or(&white_view, |index| &textures[index]))
            };
            gpu.bind_group(
                &layout,
                &[
                    (0, uniform.as_entire_binding()),
                    (1, wgpu::BindingResource::Sampler(&sampler)),
                    (2, view(maps[0])),
                    (3, view(maps[1])),
                    (4, view(maps[2])),
                    (5, view(maps[3])),
                ],
            )
        });
        Ok(Self(bind_groups.collect()))
    }

    pub fn bind_group(&self, material: usize) -> &wgpu::BindGroup {
        &self.0[material]
    }
}

fn sampler(gpu: &Gpu, texture: &Texture) -> wgpu::Sampler {
    let mode = |wrap| match wrap {
        Wrap::Repeat => wgpu::AddressMode::Repeat,
        Wrap::MirroredRepeat => wgpu::AddressMode::MirrorRepeat,
        Wrap::ClampToEdge => wgpu::AddressMode::ClampToEdge,
    };
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("material"),
        address_mode_u: mode(texture.wrap_u),
        address_mode_v: mode(texture.wrap_v),
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        ..wgpu::SamplerDescriptor::default()
    })
}

fn upload(gpu: &Gpu, texture: &Texture) -> Result<wgpu::TextureView> {
    let most = gpu.device.limits().max_texture_dimension_2d;
    if texture.width > most || texture.height > most {
        return Err(Error::failed(format!(
            "a texture of {} x {} pixels; this device holds {most} along a side",
            texture.width, texture.height
        )));
    }
    let (levels, bytes) = mip_chain(texture);
    let format =
        if texture.is_srgb { wgpu::TextureFormat::Rgba8UnormSrgb } else { wgpu::TextureFormat::Rgba8Unorm };
    let descriptor = wgpu::TextureDescriptor {
        label: Some("material"),
        size: wgpu::Extent3d { width: texture.width, height: texture.height, depth_or_array_layers: 1 },
        mip_level_count: levels,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    };
    let made =
        gpu.device.create_texture_with_data(&gpu.queue, &descriptor, TextureDataOrder::LayerMajor, &bytes);
    Ok(made.create_view(&wgpu::TextureViewDescriptor::default()))
}

/// The mip chain of a texture down to one pixel: number of levels, and their bytes one after the other.
/// Colours are averaged as linear light. On a side of odd length the last pixel counts twice.
fn mip_chain(texture: &Texture) -> (u32, Vec<u8>) {
    let decode = |byte: usize| {
        let value = byte as f32 / 255.0;
        if texture.is_srgb { linear_from_srgb(value) } else { value }
    };
    let table: [f32; 256] = std::array::from_fn(decode);
    let encode = |value: f32| {
        let coded = if texture.is_srgb { srgb_from_linear(value) } else { value };
        (coded * 255.0 + 0.5) as u8
    };
    let (mut width, mut height) = (texture.width as usize, texture.height as usize);
    let mut bytes = texture.rgba8.clone();
    let (mut levels, mut start) = (1, 0);
    while width > 1 || height > 1 {
        let (half_width, half_height) = ((width / 2).max(1), (height / 2).max(1));
        let end = bytes.len();
        for y in 0..half_height {
            for x in 0..half_width {
                for channel in 0..4 {
                    let texel = |dx: usize, dy: usize| {
                        let (x, y) = ((2 * x + dx).min(width - 1), (2 * y + dy).min(height - 1));
                        bytes[start + 4 * (y * width + x) + channel]
                    };
                    let four = [texel(0, 0), texel(1, 0), texel(0, 1), texel(1, 1)];
                    bytes.push(if channel == 3 {
                        ((four.iter().map(|&byte| u32::from(byte)).sum::<u32>() + 2) / 4) as u8
                    } else {
                        encode(0.25 * four.iter().map(|&byte| table[byte as usize]).sum::<f32>())
                    });
                }
            }
        }
        (width, height, start) = (half_width, half_height, end);
        levels += 1;
    }
    (levels, bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halvings_average_light_not_codes() {
        let checks = |is_srgb| Texture {
            width: 4,
            height: 2,
            rgba8: (0..8)
                .flat_map(|i| if (i + i / 4) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] })
                .collect(),
            is_srgb,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
        };
        let (levels, bytes) = mip_chain(&checks(true));
        assert_eq!((levels, bytes.len()), (3, 4 * (8 + 2 + 1)));
        assert_eq!(bytes[32..], [188, 188, 188, 255].repeat(3), "half the light is sRGB code 188");
        assert_eq!(mip_chain(&checks(false)).1[32..36], [128, 128, 128, 255]);
    }
}
