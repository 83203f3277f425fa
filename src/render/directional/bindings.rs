//! The buffers of the lighting, and the bind groups that pass them to its passes.

use super::DirectionalOptions;
use super::energy;
use super::light_space::LightSpace;
use super::lights::GpuLight;
use super::regions::{RegionPass, RegionSet};
use super::shade::{ShadePass, ShadeUniform};
use super::shadow::ShadowPass;
use crate::gpu::{Array, Gpu};
use crate::render::geometry::Instance;

pub(super) struct Buffers {
    pub space: Array<LightSpace>,
    pub lights: Array<GpuLight>,
    pub tiles: Array<[f32; 4]>,
    pub tables: Array<u32>,
    pub lists: Array<u32>,
    pub shade: Array<ShadeUniform>,
    pub energies: Array<f32>,
    pub counts: Array<u32>,
}

pub(super) struct BindGroups {
    /// Generations of the growable buffers at the time when these bind groups were created.
    pub generations: [u64; 2],
    pub high: wgpu::BindGroup,
    pub low: wgpu::BindGroup,
    pub shadow: wgpu::BindGroup,
    pub shade: wgpu::BindGroup,
}

/// The passes for which the bind groups are created.
pub(super) struct Passes {
    pub high: RegionSet,
    pub low: RegionSet,
    pub regions: RegionPass,
    pub shadow: ShadowPass,
    pub shade: ShadePass,
}

impl Buffers {
    pub fn new(gpu: &Gpu, options: &DirectionalOptions, high: &RegionSet, low: &RegionSet) -> Self {
        use wgpu::BufferUsages as Usage;
        let mut tables = Array::new(gpu, "region tables", Usage::STORAGE, 1);
        tables.write(gpu, &[high.regions.table(), low.regions.table()].concat());
        let mut energies =
            Array::new(gpu, "directional albedos", Usage::STORAGE, energy::SIDE * energy::SIDE);
        energies.write(gpu, &energy::table());
        Self {
            space: Array::new(gpu, "light space", Usage::UNIFORM | Usage::COPY_SRC, 1),
            lights: Array::new(gpu, "lights", Usage::STORAGE, options.lights),
            tiles: Array::new(gpu, "tiles", Usage::STORAGE, options.shadow_maps),
            tables,
            lists: Array::new(gpu, "region lists", Usage::STORAGE | Usage::COPY_SRC, 1),
            shade: Array::new(gpu, "shade", Usage::UNIFORM | Usage::COPY_SRC, 1),
            energies,
            counts: Array::new(gpu, "counts", Usage::STORAGE | Usage::COPY_SRC, 3),
        }
    }

    /// Generations of the buffers whose length depends on the list of lights.
    pub fn generations(&self) -> [u64; 2] {
        [self.lights.generation(), self.lists.generation()]
    }
}

impl BindGroups {
    pub fn new(gpu: &Gpu, buffers: &Buffers, passes: &Passes, instances: &Array<Instance>) -> Self {
        let Buffers { lights, lists, .. } = buffers;
        Self {
            generations: buffers.generations(),
            high: passes.regions.bind_group(gpu, &passes.high, lights, lists),
            low: passes.regions.bind_group(gpu, &passes.low, lights, lists),
            shadow: passes.shadow.bind_group(gpu, &buffers.space, &buffers.tiles, instances),
            shade: passes.shade.bind_group(
                gpu,
                [
                    buffers.shade.binding(),
                    buffers.space.binding(),
                    lights.binding(),
                    buffers.tiles.binding(),
                    buffers.tables.binding(),
                    lists.binding(),
                    wgpu::BindingResource::TextureView(&passes.shadow.atlas_view),
                    buffers.energies.binding(),
                    buffers.counts.binding(),
                ],
            ),
        }
    }
}
