//! Lighting by many directional lights (Havran et al. 2005, sections 4 and 5; METHODS section 8): sets of
//! lights, their angular regions, a shadow atlas, and the pass that sums the lights over a view.

mod bindings;
#[cfg(test)]
mod culling_tests;
mod energy;
#[cfg(test)]
mod exact_shadow;
mod light_space;
mod lights;
mod options;
#[cfg(test)]
mod read_back;
#[cfg(test)]
mod region_tests;
mod regions;
mod shade;
#[cfg(test)]
mod shade_tests;
#[cfg(test)]
mod shade_twin;
mod shadow;
#[cfg(test)]
mod shadow_tests;
#[cfg(test)]
mod soft_shadow_tests;
mod tiles;

use super::view::Seen;
use super::world::World;
use crate::error::Result;
use crate::gpu::{Gpu, Timer, read_buffer};
use bindings::{BindGroups, Buffers, Passes};
use light_space::LightSpace;
use lightcast_core::light::{Light, Regions};
use lights::LightSets;
pub use options::DirectionalOptions;
use regions::{Assignment, RegionPass, RegionSet};
use shade::{ShadePass, ShadeUniform};
use shadow::ShadowPass;

#[cfg(test)]
pub(super) use read_back::DirectionalFrame;

/// Total numbers of lights that pixels evaluated since the counts were last read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightCounts {
    /// Pixels that show a surface.
    pub pixels: u32,
    /// Lights that they read.
    pub looked_at: u32,
    /// Lights above their horizon, for which they sampled a shadow map.
    pub shaded: u32,
}

/// The lighting.
pub(super) struct Directional {
    sets: LightSets,
    buffers: Buffers,
    passes: Passes,
    bind_groups: BindGroups,
}

impl Directional {
    /// Reserves resources according to `options`, to light views of this world with the layout of `seen`.
    pub fn new(gpu: &Gpu, world: &World, seen: &Seen, options: &DirectionalOptions) -> Self {
        let passes = Passes {
            high: RegionSet::new(gpu, Regions::for_normals()),
            low: RegionSet::new(gpu, cone_regions(options.cone_rad)),
            regions: RegionPass::new(gpu),
            shadow: ShadowPass::new(gpu, options.shadow_map_px, options.tiles_per_side()),
            shade: ShadePass::new(gpu, seen.layout(), options.count_lights),
        };
        let buffers = Buffers::new(gpu, options, &passes.high, &passes.low);
        let bind_groups = BindGroups::new(gpu, &buffers, &passes, &world.geometry.instances);
        Self { sets: LightSets::default(), buffers, passes, bind_groups }
    }

    /// Releases all shadow maps, as a frame without lights does: which lights have one depends on earlier
    /// lists.
    pub fn release_shadow_maps(&mut self, options: &DirectionalOptions) {
        self.sets.update(&[], options);
    }

    /// Prepares lights, their regions and shadow maps, until the next call. `options` may request less than
    /// was reserved.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        timer: &mut Timer,
        lights: &[Light],
        world: &World,
        options: &DirectionalOptions,
    ) {
        let buffers = &mut self.buffers;
        self.sets.update(lights, options);
        buffers.lights.write(gpu, &self.sets.lights);
        buffers.tiles.write(gpu, &self.sets.tiles.directions);
        let casters = world.geometry.casters;
        let tiles_per_side = self.passes.shadow.tiles_per_side;
        buffers.space.write(gpu, &[LightSpace::new(&casters, options.shadow_map_px, tiles_per_side)]);
        let (high, low) = self.assignments(options);
        self.passes.high.set(gpu, high);
        self.passes.low.set(gpu, low);
        self.buffers.shade.write(gpu, &[self.uniform(options, high, low)]);
        let words = low.first_word as usize + self.passes.low.regions.count() * low.stride() as usize;
        self.buffers.lists.reserve(gpu, words);
        if self.bind_groups.generations != self.buffers.generations() {
            let instances = &world.geometry.instances;
            self.bind_groups = BindGroups::new(gpu, &self.buffers, &self.passes, instances);
        }
        let Passes { high, low, regions, shadow, .. } = &self.passes;
        let groups = &self.bind_groups;
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        if options.culling {
            let sets = [(high, &groups.high), (low, &groups.low)];
            let used = if self.sets.low_count() > 0 { 2 } else { 1 };
            regions.encode(&mut encoder, timer, sets.into_iter().take(used));
        }
        if !casters.is_empty() {
            shadow.encode(&mut encoder, timer, &groups.shadow, world, self.sets.tiles.used());
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Adds the prepared light to a sample of a view.
    pub fn shade(&self, encoder: &mut wgpu::CommandEncoder, timer: &mut Timer, seen: &Seen) {
        self.passes.shade.encode(encoder, timer, &self.bind_groups.shade, seen);
    }

    /// Counts of the lights that pixels evaluated since the last call; zeros unless the options enable
    /// counts.
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_counts(&mut self, gpu: &Gpu) -> Result<LightCounts> {
        if !self.passes.shade.counts() {
            return Ok(LightCounts::default());
        }
        let mut counts = Vec::new();
        read_buffer(gpu, self.buffers.counts.buffer(), 3, &mut counts)?;
        self.buffers.counts.write(gpu, &[0; 3]);
        Ok(LightCounts { pixels: counts[0], looked_at: counts[1], shaded: counts[2] })
    }

    /// Positions of the lists of both sets in the buffer.
    fn assignments(&self, options: &DirectionalOptions) -> (Assignment, Assignment) {
        let high_count = self.sets.high_count as u32;
        let high =
            Assignment { first_light: 0, light_count: high_count, capacity: high_count, first_word: 0 };
        let low = Assignment {
            first_light: high_count,
            light_count: self.sets.low_count() as u32,
            capacity: options.region_lights.min(self.sets.low_count()) as u32,
            first_word: self.passes.high.regions.count() as u32 * high.stride(),
        };
        (high, low)
    }

    fn uniform(&self, options: &DirectionalOptions, high: Assignment, low: Assignment) -> ShadeUniform {
        let has_low = self.sets.low_count() > 0 && options.culling;
        ShadeUniform {
            high_count: high.light_count,
            high_stride: if options.culling { high.stride() } else { 0 },
            low_stride: low.stride(),
            low_first_word: low.first_word,
            table_side: self.passes.high.regions.side(),
            low_table_side: self.passes.low.regions.side(),
            cone_cosine: if has_low { (0.5 * options.cone_rad).cos() as f32 } else { 2.0 },
            soft_samples: options.soft_samples,
        }
    }
}

/// Regions of set L, for cones of `cone_rad`; a single one without such a set.
fn cone_regions(cone_rad: f64) -> Regions {
    if cone_rad > 0.0 { Regions::for_cones(cone_rad) } else { Regions::new(1, 0.0) }
}
