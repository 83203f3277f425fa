//! Reads back the buffers of the frame drawn last.

use super::light_space::LightSpace;
use super::lights::GpuLight;
use super::shade::ShadeUniform;
use super::{Directional, energy};
use crate::gpu::{Gpu, read_buffer, read_texture};

/// Everything that the shading pass read besides what the view shows.
pub(in crate::render) struct DirectionalFrame {
    pub shade: ShadeUniform,
    pub space: LightSpace,
    pub lights: Vec<GpuLight>,
    pub tiles: Vec<[f32; 4]>,
    pub region_tables: Vec<u32>,
    pub region_lists: Vec<u32>,
    pub atlas: Vec<f32>,
    pub energies: Vec<f32>,
}

impl Directional {
    /// Waits for the frame drawn last.
    pub(in crate::render) fn read_back(&self, gpu: &Gpu) -> DirectionalFrame {
        let (buffers, passes) = (&self.buffers, &self.passes);
        let (mut shades, mut spaces) = (Vec::new(), Vec::new());
        read_buffer(gpu, buffers.shade.buffer(), 1, &mut shades).unwrap();
        read_buffer(gpu, buffers.space.buffer(), 1, &mut spaces).unwrap();
        let mut frame = DirectionalFrame {
            shade: shades[0],
            space: spaces[0],
            lights: self.sets.lights.clone(),
            tiles: self.sets.tiles.directions.clone(),
            region_tables: [passes.high.regions.table(), passes.low.regions.table()].concat(),
            region_lists: Vec::new(),
            atlas: Vec::new(),
            energies: energy::table(),
        };
        let words = (buffers.lists.buffer().size() / 4) as usize;
        read_buffer(gpu, buffers.lists.buffer(), words, &mut frame.region_lists).unwrap();
        read_texture(gpu, passes.shadow.atlas_view.texture(), &mut frame.atlas).unwrap();
        frame
    }
}
