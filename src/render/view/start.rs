use super::background::BackgroundBindings;
use super::seen::{self, Seen};
use crate::gpu::{Gpu, Timer};

/// The pass that starts a sample: it combines the picture of earlier samples, the emission of surfaces, and
/// the background.
pub(super) struct StartPass(wgpu::ComputePipeline);

const SOURCES: [&str; 2] = [seen::SOURCE, include_str!("../../../shaders/view/start.wgsl")];

impl StartPass {
    pub fn new(gpu: &Gpu, seen: &Seen, background: &BackgroundBindings) -> Self {
        let layout = gpu.pipeline_layout(&[seen.layout(), &background.layout]);
        Self(gpu.compute_pipeline("start", &SOURCES, &[], Some(&layout)))
    }

    pub fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        seen: &Seen,
        background: &BackgroundBindings,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("start"),
            // It is measured with the lightings: together they compute the radiance.
            timestamp_writes: timer.compute("shade"),
        });
        pass.set_pipeline(&self.0);
        pass.set_bind_group(1, &background.group, &[]);
        seen.dispatch(&mut pass);
    }
}

#[cfg(test)]
mod tests {
    use super::super::background::BackgroundUniform;
    use super::*;
    use crate::gpu::layout::{assert_layout, assert_valid, members};

    #[test]
    fn the_shader_is_valid_and_its_struct_lies_as_it_is_written() {
        let source = SOURCES.concat();
        assert_valid("start", &source);
        assert_layout(
            &source,
            "Background",
            size_of::<BackgroundUniform>(),
            members!(BackgroundUniform: colour, kind, rim_rad),
        );
    }
}
