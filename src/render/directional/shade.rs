//! Sums the lights at every pixel.

use super::light_space;
use crate::gpu::{Gpu, READ_ONLY, READ_WRITE, Timer, UNIFORM};
use crate::render::view::{SEEN, Seen};
use bytemuck::{Pod, Zeroable};

const BRDF: &str = include_str!("../../../shaders/brdf.wgsl");
const VISIBILITY: &str = include_str!("../../../shaders/directional/visibility.wgsl");
const SHADER: &str = include_str!("../../../shaders/directional/shade.wgsl");

/// Sources in the order in which they are concatenated.
pub(super) const SOURCES: [&str; 5] = [SEEN, BRDF, light_space::SOURCE, VISIBILITY, SHADER];

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::render) struct ShadeUniform {
    pub high_count: u32,
    pub high_stride: u32,
    pub low_stride: u32,
    pub low_first_word: u32,
    pub table_side: u32,
    pub low_table_side: u32,
    pub cone_cosine: f32,
    pub soft_samples: u32,
}

/// The pass that shades pixels.
pub(super) struct ShadePass {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    counts: bool,
}

impl ShadePass {
    /// A pass for views of this layout. With `counts` it also counts the lights that it evaluates, which
    /// costs time.
    pub fn new(gpu: &Gpu, view: &wgpu::BindGroupLayout, counts: bool) -> Self {
        let atlas = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Depth,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let types =
            [UNIFORM, UNIFORM, READ_ONLY, READ_ONLY, READ_ONLY, READ_ONLY, atlas, READ_ONLY, READ_WRITE];
        let numbered: Vec<_> =
            (0..).zip(types).map(|(number, ty)| (number, wgpu::ShaderStages::COMPUTE, ty)).collect();
        let layout = gpu.bind_group_layout(&numbered);
        let constants = [("COUNTS", f64::from(u8::from(counts)))];
        let groups = gpu.pipeline_layout(&[view, &layout]);
        let pipeline = gpu.compute_pipeline("shade", &SOURCES, &constants, Some(&groups));
        Self { pipeline, layout, counts }
    }

    /// Bindings in the order of the shader.
    pub fn bind_group(&self, gpu: &Gpu, resources: [wgpu::BindingResource; 9]) -> wgpu::BindGroup {
        let numbered: Vec<_> = (0..).zip(resources).collect();
        gpu.bind_group(&self.layout, &numbered)
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
        seen: &Seen,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("shade"),
            timestamp_writes: timer.compute("shade"),
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(1, bind_group, &[]);
        seen.dispatch(&mut pass);
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
            members!(ShadeUniform: high_count, high_stride, low_stride, low_first_word, table_side,
                low_table_side, cone_cosine, soft_samples),
        );
        let light = members!(GpuLight: direction, spread_rad, irradiance, tile);
        assert_layout(&source, "Light", size_of::<GpuLight>(), light);
        let regions = super::super::regions::SHADER;
        assert_valid("regions", regions);
        assert_layout(regions, "Light", size_of::<GpuLight>(), light);
        type Assignment = super::super::regions::Assignment;
        assert_layout(
            regions,
            "Assignment",
            size_of::<Assignment>(),
            members!(Assignment: first_light, light_count, capacity, first_word),
        );
    }
}
