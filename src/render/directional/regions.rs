//! Assigns lights to angular regions on the device.

use super::lights::GpuLight;
use crate::gpu::{Array, Gpu, Timer};
use bytemuck::{Pod, Zeroable};
use lightcast_core::light::Regions;

pub(super) const SHADER: &str = include_str!("../../../shaders/directional/regions.wgsl");

/// Words before the lights of a region's list: their number, and the factor for their power.
pub(super) const HEAD_WORDS: u32 = 2;

/// Which lights are assigned to which lists.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct Assignment {
    pub first_light: u32,
    pub light_count: u32,
    pub capacity: u32,
    pub first_word: u32,
}

impl Assignment {
    /// Number of words of a region's list.
    pub fn stride(&self) -> u32 {
        self.capacity + HEAD_WORDS
    }
}

/// The lists of one set of lights.
pub(super) struct RegionSet {
    pub regions: Regions,
    caps: Array<[f32; 4]>,
    assignment: Array<Assignment>,
}

impl RegionSet {
    pub fn new(gpu: &Gpu, regions: Regions) -> Self {
        let mut caps = Array::new(gpu, "region caps", wgpu::BufferUsages::STORAGE, regions.count());
        caps.write(gpu, regions.caps());
        Self { regions, caps, assignment: Array::new(gpu, "assignment", wgpu::BufferUsages::UNIFORM, 1) }
    }

    /// Sets which lights are assigned, and to which lists.
    pub fn set(&mut self, gpu: &Gpu, assignment: Assignment) {
        self.assignment.write(gpu, &[assignment]);
    }
}

/// The pass that builds the lists.
pub(super) struct RegionPass(wgpu::ComputePipeline);

impl RegionPass {
    pub fn new(gpu: &Gpu) -> Self {
        Self(gpu.compute_pipeline("regions", &[SHADER], &[], None))
    }

    pub fn bind_group(
        &self,
        gpu: &Gpu,
        set: &RegionSet,
        lights: &Array<GpuLight>,
        lists: &Array<u32>,
    ) -> wgpu::BindGroup {
        gpu.bind_group(
            &self.0.get_bind_group_layout(0),
            &[
                (0, set.assignment.binding()),
                (1, lights.binding()),
                (2, set.caps.binding()),
                (3, lists.binding()),
            ],
        )
    }

    /// Builds the lists of every set, each given by a bind group of [`Self::bind_group`].
    pub fn encode<'a>(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        sets: impl Iterator<Item = (&'a RegionSet, &'a wgpu::BindGroup)>,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("regions"),
            timestamp_writes: timer.compute("regions"),
        });
        pass.set_pipeline(&self.0);
        for (set, bind_group) in sets {
            pass.set_bind_group(0, bind_group, &[]);
            pass.dispatch_workgroups(set.regions.count() as u32, 1, 1);
        }
    }
}
