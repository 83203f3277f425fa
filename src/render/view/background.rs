//! The background, visible where there is no surface, on the device.

use super::look::Background;
use crate::gpu::{Array, Gpu, UNIFORM};
use bytemuck::{Pod, Zeroable};
use lightcast_core::image::PolarMap;

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct BackgroundUniform {
    pub colour: [f32; 3],
    pub kind: u32,
    pub rim_rad: f32,
    pub pad: [u32; 3],
}

/// Kinds, as the shader numbers them.
const NOTHING: u32 = 0;
const COLOUR: u32 = 1;
const PANORAMA: u32 = 2;

/// Group 1 of the pass that starts a sample.
pub(super) struct BackgroundBindings {
    pub layout: wgpu::BindGroupLayout,
    pub group: wgpu::BindGroup,
}

impl BackgroundBindings {
    /// Bindings for an empty background.
    pub fn new(gpu: &Gpu) -> Self {
        let panorama = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: false },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let stage = wgpu::ShaderStages::COMPUTE;
        let layout = gpu.bind_group_layout(&[(0, stage, UNIFORM), (1, stage, panorama)]);
        let group = group(gpu, &layout, &Background::Grey);
        Self { layout, group }
    }

    /// Sets the background from the next sample on.
    pub fn set(&mut self, gpu: &Gpu, background: &Background) {
        self.group = group(gpu, &self.layout, background);
    }
}

fn group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, background: &Background) -> wgpu::BindGroup {
    let none = BackgroundUniform { kind: NOTHING, ..BackgroundUniform::default() };
    let (uniform, texture) = match background {
        Background::Grey | Background::Transparent => (none, texture(gpu, [1, 1], &[[0.0; 4]])),
        Background::Colour(colour) => {
            let uniform = BackgroundUniform { colour: *colour, kind: COLOUR, ..none };
            (uniform, texture(gpu, [1, 1], &[[0.0; 4]]))
        }
        Background::Panorama(map) => {
            let rim_rad = map.shape.theta_max_rad() as f32;
            (BackgroundUniform { kind: PANORAMA, rim_rad, ..none }, panorama(gpu, map))
        }
    };
    let mut buffer = Array::new(gpu, "background", wgpu::BufferUsages::UNIFORM, 1);
    buffer.write(gpu, &[uniform]);
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    gpu.bind_group(layout, &[(0, buffer.binding()), (1, wgpu::BindingResource::TextureView(&view))])
}

fn panorama(gpu: &Gpu, map: &PolarMap) -> wgpu::Texture {
    let texels: Vec<[f32; 4]> = map.pixels.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
    texture(gpu, [map.shape.columns() as u32, map.shape.rows() as u32], &texels)
}

/// 32-bit floats: a sun is brighter than half floats can represent.
fn texture(gpu: &Gpu, [width, height]: [u32; 2], texels: &[[f32; 4]]) -> wgpu::Texture {
    let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("background"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(width * size_of::<[f32; 4]>() as u32),
        rows_per_image: None,
    };
    gpu.queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(texels), layout, size);
    texture
}

/// CPU twin of the look-up of `shaders/view/start.wgsl`.
#[cfg(test)]
pub(super) mod twin {
    use glam::Vec3;
    use lightcast_core::image::PolarMap;
    use std::f32::consts::TAU;

    pub fn panorama_at(map: &PolarMap, d: Vec3) -> Vec3 {
        let (columns, rows) = (map.shape.columns() as i32, map.shape.rows() as i32);
        let theta = d.truncate().with_y(d.z).length().atan2(d.y);
        let rim = map.shape.theta_max_rad() as f32;
        if theta > rim {
            return Vec3::ZERO;
        }
        let turn = d.z.atan2(d.x) / TAU;
        let (x, y) = ((turn - turn.floor()) * columns as f32 - 0.5, theta / rim * rows as f32 - 0.5);
        let texel = |column: i32, row: i32| {
            let (column, row) = (column.rem_euclid(columns), row.clamp(0, rows - 1));
            Vec3::from(map.pixels[(row * columns + column) as usize])
        };
        let (column, row) = (x.floor() as i32, y.floor() as i32);
        let (u, v) = (x - x.floor(), y - y.floor());
        let first = texel(column, row).lerp(texel(column + 1, row), u);
        first.lerp(texel(column, row + 1).lerp(texel(column + 1, row + 1), u), v)
    }
}
