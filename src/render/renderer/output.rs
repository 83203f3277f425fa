//! What comes out of a renderer: pictures, radiance, counts and times.

use super::Renderer;
use crate::error::Result;
use crate::gpu::{PassTimes, read_buffer, read_texture};

/// What pixels have looked at since the counts were last read, in all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightCounts {
    /// Pixels that show a surface.
    pub pixels: u32,
    /// Lights that they looked at.
    pub looked_at: u32,
    /// Lights that stand above their horizon, for which they looked into a shadow map.
    pub shaded: u32,
}

impl Renderer {
    /// Maps the frame drawn last to `target`, `elapsed_s` after the one before: the exposure follows what is seen in
    /// about half a second.
    ///
    /// # Errors
    /// Those of the device.
    pub fn present(&mut self, target: &wgpu::TextureView, elapsed_s: f64) -> Result<()> {
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.tone_pass.encode(&self.gpu, &mut encoder, &mut self.timer, target, elapsed_s);
        self.timer.resolve(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.check()
    }

    /// [`Self::present`] into memory: 8-bit sRGB for every pixel, row-major from the top.
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_picture(&mut self, elapsed_s: f64, rgb8: &mut Vec<u8>) -> Result<()> {
        let view = self.picture.create_view(&wgpu::TextureViewDescriptor::default());
        self.present(&view, elapsed_s)?;
        let mut texels: Vec<[u8; 4]> = Vec::new();
        read_texture(&self.gpu, &self.picture, &mut texels)?;
        rgb8.clear();
        let is_bgra = self.picture.format() == wgpu::TextureFormat::Bgra8UnormSrgb;
        let places = if is_bgra { [2, 1, 0] } else { [0, 1, 2] };
        rgb8.extend(texels.iter().flat_map(|texel| places.map(|place| texel[place])));
        Ok(())
    }

    /// The picture as radiance: for every pixel, row-major from the top, linear RGB and the share of it that shows a
    /// surface (colours are not divided by it).
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_radiance(&self, pixels: &mut Vec<[f32; 4]>) -> Result<()> {
        read_buffer(&self.gpu, self.buffers.radiance.buffer(), self.options.pixels(), pixels)
    }

    /// What pixels looked at since the last call; zeros unless the options ask for counts.
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_counts(&mut self) -> Result<LightCounts> {
        if !self.shade_pass.counts() {
            return Ok(LightCounts::default());
        }
        let mut counts = Vec::new();
        read_buffer(&self.gpu, self.buffers.counts.buffer(), 3, &mut counts)?;
        self.buffers.counts.write(&self.gpu, &[0; 3]);
        Ok(LightCounts { pixels: counts[0], looked_at: counts[1], shaded: counts[2] })
    }

    /// Waits for the frame drawn last: GPU time of its passes, of the first 64 of them, empty where the adapter does not
    /// measure.
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_times(&mut self) -> Result<PassTimes> {
        self.timer.read(&self.gpu)
    }
}
