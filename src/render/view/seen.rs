//! The part of a view that lightings read, and the radiance to which they add.

use super::surface::SurfacePass;
use crate::gpu::{Array, Gpu, READ_WRITE, UNIFORM};
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};

/// Source that every lighting prepends to its own: the bindings of group 0, and functions that read and add.
pub(in crate::render) const SOURCE: &str = include_str!("../../../shaders/view/seen.wgsl");

/// Side of a workgroup of the shaders that [`Seen::dispatch`] runs.
const GROUP: u32 = 8;

/// One sample of every pixel.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::render) struct SampleUniform {
    pub eye_from_clip: Mat4,
    pub eye: Vec3,
    pub weight: f32,
    pub keep: f32,
    pub has_emission: u32,
    pub size: [u32; 2],
    pub seed: u32,
    pub pad: [u32; 3],
}

/// Surfaces and radiance as shaders bind them, group 0 of every lighting.
pub(in crate::render) struct Seen {
    layout: wgpu::BindGroupLayout,
    group: wgpu::BindGroup,
    pub sample: Array<SampleUniform>,
    pub radiance: Array<[f32; 4]>,
    pub size: [u32; 2],
}

impl Seen {
    pub fn new(gpu: &Gpu, surfaces: &SurfacePass, size: [u32; 2]) -> Self {
        use wgpu::{BindingType, BufferUsages as Usage, TextureSampleType};
        let texture = |sample_type| BindingType::Texture {
            sample_type,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let stage = wgpu::ShaderStages::COMPUTE;
        let layout = gpu.bind_group_layout(&[
            (0, stage, UNIFORM),
            (1, stage, texture(TextureSampleType::Depth)),
            (2, stage, texture(TextureSampleType::Uint)),
            (3, stage, texture(TextureSampleType::Uint)),
            (4, stage, READ_WRITE),
        ]);
        let sample = Array::new(gpu, "sample", Usage::UNIFORM | Usage::COPY_SRC, 1);
        let radiance = radiance(gpu, size);
        let group = group(gpu, &layout, &sample, surfaces, &radiance);
        Self { layout, group, sample, radiance, size }
    }

    /// Adapts to the new size of the surfaces; the current picture is lost.
    pub fn resize(&mut self, gpu: &Gpu, surfaces: &SurfacePass, size: [u32; 2]) {
        self.size = size;
        self.radiance = radiance(gpu, size);
        self.group = group(gpu, &self.layout, &self.sample, surfaces, &self.radiance);
    }

    /// Layout of group 0, for a lighting's pipeline.
    pub fn layout(&self) -> &wgpu::BindGroupLayout {
        &self.layout
    }

    /// Runs the current pipeline with one invocation per pixel in workgroups of 8 x 8, and with this as
    /// group 0.
    pub fn dispatch(&self, pass: &mut wgpu::ComputePass) {
        let [width, height] = self.size;
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(width.div_ceil(GROUP), height.div_ceil(GROUP), 1);
    }
}

fn radiance(gpu: &Gpu, [width, height]: [u32; 2]) -> Array<[f32; 4]> {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    Array::new(gpu, "radiance", usage, width as usize * height as usize)
}

fn group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    sample: &Array<SampleUniform>,
    surfaces: &SurfacePass,
    radiance: &Array<[f32; 4]>,
) -> wgpu::BindGroup {
    let [depths, normals, reflectances] = surfaces.views().map(wgpu::BindingResource::TextureView);
    let resources =
        [(0, sample.binding()), (1, depths), (2, normals), (3, reflectances), (4, radiance.binding())];
    gpu.bind_group(layout, &resources)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_layout, assert_valid, members};

    #[test]
    fn the_shader_is_valid_and_its_struct_lies_as_it_is_written() {
        assert_valid("seen", SOURCE);
        assert_layout(
            SOURCE,
            "Sample",
            size_of::<SampleUniform>(),
            members!(SampleUniform: eye_from_clip, eye, weight, keep, has_emission, size, seed),
        );
    }
}
