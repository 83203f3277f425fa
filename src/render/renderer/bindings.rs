//! The buffers of a renderer, and the bind groups that give them to its passes.

use crate::gpu::{Array, Gpu};
use crate::render::geometry::Geometry;
use crate::render::light_space::LightSpace;
use crate::render::lights::GpuLight;
use crate::render::region_pass::{RegionPass, RegionSet};
use crate::render::shade::{ShadePass, ShadeUniform};
use crate::render::shadow::ShadowPass;
use crate::render::surface::{CameraUniform, SurfacePass};
use crate::render::{Options, energy};

pub(super) struct Buffers {
    pub camera: Array<CameraUniform>,
    pub space: Array<LightSpace>,
    pub lights: Array<GpuLight>,
    pub tiles: Array<[f32; 4]>,
    pub tables: Array<u32>,
    pub lists: Array<u32>,
    pub shade: Array<ShadeUniform>,
    pub energies: Array<f32>,
    pub radiance: Array<[f32; 4]>,
    pub counts: Array<u32>,
}

pub(super) struct BindGroups {
    /// Generations of the buffers that can grow, when these were made.
    pub generations: [u64; 2],
    pub high: wgpu::BindGroup,
    pub low: wgpu::BindGroup,
    pub shadow: wgpu::BindGroup,
    pub surface: wgpu::BindGroup,
    pub shade: wgpu::BindGroup,
}

impl Buffers {
    pub fn new(gpu: &Gpu, options: &Options, high: &RegionSet, low: &RegionSet) -> Self {
        use wgpu::BufferUsages as Usage;
        let mut tables = Array::new(gpu, "region tables", Usage::STORAGE, 1);
        tables.write(gpu, &[high.regions.table(), low.regions.table()].concat());
        let mut energies =
            Array::new(gpu, "directional albedos", Usage::STORAGE, energy::SIDE * energy::SIDE);
        energies.write(gpu, &energy::table());
        Self {
            camera: Array::new(gpu, "camera", Usage::UNIFORM, 1),
            space: Array::new(gpu, "light space", Usage::UNIFORM | Usage::COPY_SRC, 1),
            lights: Array::new(gpu, "lights", Usage::STORAGE, options.lights),
            tiles: Array::new(gpu, "tiles", Usage::STORAGE, options.shadow_maps),
            tables,
            lists: Array::new(gpu, "region lists", Usage::STORAGE | Usage::COPY_SRC, 1),
            shade: Array::new(gpu, "shade", Usage::UNIFORM | Usage::COPY_SRC, 1),
            energies,
            radiance: Array::new(gpu, "radiance", Usage::STORAGE | Usage::COPY_SRC, options.pixels()),
            counts: Array::new(gpu, "counts", Usage::STORAGE | Usage::COPY_SRC, 3),
        }
    }

    /// Of the buffers whose length follows the list of lights.
    pub fn generations(&self) -> [u64; 2] {
        [self.lights.generation(), self.lists.generation()]
    }
}

impl BindGroups {
    #[expect(clippy::too_many_arguments, reason = "all that a renderer has, before there is one")]
    pub fn new(
        gpu: &Gpu,
        buffers: &Buffers,
        geometry: &Geometry,
        high: &RegionSet,
        low: &RegionSet,
        region_pass: &RegionPass,
        shadow_pass: &ShadowPass,
        surface_pass: &SurfacePass,
        shade_pass: &ShadePass,
    ) -> Self {
        let [depths, normals, reflectances] = surface_pass.views().map(wgpu::BindingResource::TextureView);
        Self {
            generations: buffers.generations(),
            high: region_pass.bind_group(gpu, high, &buffers.lights, &buffers.lists),
            low: region_pass.bind_group(gpu, low, &buffers.lights, &buffers.lists),
            shadow: shadow_pass.bind_group(gpu, &buffers.space, &buffers.tiles, &geometry.instances),
            surface: surface_pass.bind_group(gpu, &buffers.camera, &geometry.instances),
            shade: shade_pass.bind_group(
                gpu,
                [
                    buffers.shade.binding(),
                    buffers.space.binding(),
                    buffers.lights.binding(),
                    buffers.tiles.binding(),
                    buffers.tables.binding(),
                    buffers.lists.binding(),
                    wgpu::BindingResource::TextureView(&shadow_pass.atlas_view),
                    depths,
                    normals,
                    reflectances,
                    buffers.energies.binding(),
                    buffers.radiance.binding(),
                    buffers.counts.binding(),
                ],
            ),
        }
    }
}
