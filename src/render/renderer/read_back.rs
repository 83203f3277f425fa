//! What the frame drawn last left on the device.

use super::{Buffers, Renderer};
use crate::gpu::{read_buffer, read_texture};
use crate::render::energy;
use crate::render::light_space::LightSpace;
use crate::render::lights::GpuLight;
use crate::render::shade::ShadeUniform;

/// Everything that the shading pass of the last sample read, and what it wrote.
pub(in crate::render) struct Frame {
    pub shade: ShadeUniform,
    pub space: LightSpace,
    pub lights: Vec<GpuLight>,
    pub tiles: Vec<[f32; 4]>,
    pub region_tables: Vec<u32>,
    pub region_lists: Vec<u32>,
    pub atlas: Vec<f32>,
    pub depths: Vec<f32>,
    pub normals: Vec<[u32; 4]>,
    pub reflectances: Vec<[u32; 4]>,
    pub energies: Vec<f32>,
    pub radiance: Vec<[f32; 4]>,
}

impl Renderer {
    /// Waits for the frame drawn last.
    pub(in crate::render) fn read_back(&self) -> Frame {
        let Buffers { shade, space, lists, .. } = &self.buffers;
        let (mut shades, mut spaces) = (Vec::new(), Vec::new());
        read_buffer(&self.gpu, shade.buffer(), 1, &mut shades).unwrap();
        read_buffer(&self.gpu, space.buffer(), 1, &mut spaces).unwrap();
        let mut frame = Frame {
            shade: shades[0],
            space: spaces[0],
            lights: self.sets.lights.clone(),
            tiles: self.sets.tiles.directions.clone(),
            region_tables: [self.high.regions.table(), self.low.regions.table()].concat(),
            region_lists: Vec::new(),
            atlas: Vec::new(),
            depths: Vec::new(),
            normals: Vec::new(),
            reflectances: Vec::new(),
            energies: energy::table(),
            radiance: Vec::new(),
        };
        let words = (lists.buffer().size() / 4) as usize;
        read_buffer(&self.gpu, lists.buffer(), words, &mut frame.region_lists).unwrap();
        let [depths, normals, reflectances] = self.surface_pass.views().map(wgpu::TextureView::texture);
        read_texture(&self.gpu, self.shadow_pass.atlas_view.texture(), &mut frame.atlas).unwrap();
        read_texture(&self.gpu, depths, &mut frame.depths).unwrap();
        read_texture(&self.gpu, normals, &mut frame.normals).unwrap();
        read_texture(&self.gpu, reflectances, &mut frame.reflectances).unwrap();
        self.read_radiance(&mut frame.radiance).unwrap();
        frame
    }
}
