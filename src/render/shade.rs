//! The sum of the lights over every pixel.

use super::light_space;
use crate::gpu::{Gpu, Timer};
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};

const BRDF: &str = include_str!("../../shaders/brdf.wgsl");
const SHADER: &str = include_str!("../../shaders/shade.wgsl");

/// Sources in the order in which they are joined.
pub(super) const SOURCES: [&str; 3] = [light_space::SOURCE, BRDF, SHADER];

/// Side of a workgroup.
const GROUP: u32 = 8;

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct ShadeUniform {
    pub eye_from_clip: Mat4,
    pub eye: Vec3,
    pub weight: f32,
    pub keep: f32,
    pub pad_0: u32,
    pub size: [u32; 2],
    pub high_count: u32,
    pub high_stride: u32,
    pub low_stride: u32,
    pub low_first_word: u32,
    pub table_side: u32,
    pub low_table_side: u32,
    pub cone_cosine: f32,
    pub soft_samples: u32,
    pub seed: u32,
    pub has_emission: u32,
    pub pad_1: [u32; 2],
}

/// Shades pixels.
pub(super) struct ShadePass {
    pipeline: wgpu::ComputePipeline,
    counts: bool,
}

impl ShadePass {
    /// With `counts` it also adds up what it looks at, which costs time.
    pub fn new(gpu: &Gpu, counts: bool) -> Self {
        let constants = [("COUNTS", f64::from(u8::from(counts)))];
        Self { pipeline: gpu.compute_pipeline("shade", &SOURCES, &constants), counts }
    }

    /// Bindings in the order of the shader.
    pub fn bind_group(&self, gpu: &Gpu, resources: [wgpu::BindingResource; 13]) -> wgpu::BindGroup {
        let numbered: Vec<_> = (0..).zip(resources).collect();
        gpu.bind_group(&self.pipeline.get_bind_group_layout(0), &numbered)
    }

    /// Whether it counts.
    pub fn counts(&self) -> bool {
        self.counts
    }

    pub fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        bind_group: &wgpu::BindGroup,
        [width, height]: [u32; 2],
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("shade"),
            timestamp_writes: timer.compute("shade"),
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, bind_group, &[]);
        pass.dispatch_workgroups(width.div_ceil(GROUP), height.div_ceil(GROUP), 1);
    }
}

#[cfg(test)]
mod tests {
    use super::super::lights::GpuLight;
    use super::*;
    use crate::gpu::layout::{assert_layout, assert_valid, members};

    #[test]
    fn the_shader_is_valid_and_its_structs_lie_as_they_are_written() {
        let source = SOURCES.concat();
        assert_valid("shade", &source);
        assert_layout(
            &source,
            "Shade",
            size_of::<ShadeUniform>(),
            members!(ShadeUniform: eye_from_clip, eye, weight, keep, size, high_count, high_stride, low_stride,
                low_first_word, table_side, low_table_side, cone_cosine, soft_samples, seed, has_emission),
        );
        let light = members!(GpuLight: direction, spread_rad, irradiance, tile);
        assert_layout(&source, "Light", size_of::<GpuLight>(), light);
        let regions = super::super::region_pass::SHADER;
        assert_valid("regions", regions);
        assert_layout(regions, "Light", size_of::<GpuLight>(), light);
        type Assignment = super::super::region_pass::Assignment;
        assert_layout(
            regions,
            "Assignment",
            size_of::<Assignment>(),
            members!(Assignment: first_light, light_count, capacity, first_word),
        );
    }
}
