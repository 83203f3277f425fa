//! Outputs of a renderer: pictures, radiance, counts and times.

use super::Renderer;
use crate::error::Result;
use crate::gpu::{PassTimes, read_buffer, read_texture};
use crate::render::directional::LightCounts;

impl Renderer {
    /// Maps the frame drawn last to `target`, `elapsed_s` after the previous one: the exposure adapts to the
    /// picture in about half a second.
    ///
    /// # Errors
    /// Those of the device.
    pub fn present(&mut self, target: &wgpu::TextureView, elapsed_s: f64) -> Result<()> {
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.view.tone.encode(&self.gpu, &mut encoder, &mut self.timer, target, elapsed_s);
        self.timer.resolve(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.check()
    }

    /// [`Self::present`] into memory: 8-bit sRGB and alpha for every pixel, row-major from the top. Alpha is
    /// 255 except where the background is transparent; colours are not premultiplied.
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_picture(&mut self, elapsed_s: f64, rgba8: &mut Vec<[u8; 4]>) -> Result<()> {
        let view = self.picture.create_view(&wgpu::TextureViewDescriptor::default());
        self.present(&view, elapsed_s)?;
        read_texture(&self.gpu, &self.picture, rgba8)?;
        if self.picture.format() == wgpu::TextureFormat::Bgra8UnormSrgb {
            rgba8.iter_mut().for_each(|texel| texel.swap(0, 2));
        }
        Ok(())
    }

    /// Whether the background is transparent: alpha is then the fraction of a pixel that shows a surface.
    pub fn is_transparent(&self) -> bool {
        self.view.is_transparent()
    }

    /// The picture as radiance: for every pixel, row-major from the top, linear RGB and the fraction of the
    /// pixel that shows a surface or a background with radiance (colours are not divided by it, that is,
    /// premultiplied).
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_radiance(&self, pixels: &mut Vec<[f32; 4]>) -> Result<()> {
        read_buffer(&self.gpu, self.view.seen.radiance.buffer(), self.options.pixels(), pixels)
    }

    /// Counts of the lights that pixels evaluated since the last call; zeros unless the options enable
    /// counts.
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_counts(&mut self) -> Result<LightCounts> {
        match &mut self.directional {
            Some(directional) => directional.read_counts(&self.gpu),
            None => Ok(LightCounts::default()),
        }
    }

    /// Waits for the frame drawn last: GPU times of its first 64 passes, empty where the adapter has no
    /// timestamps.
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_times(&mut self) -> Result<PassTimes> {
        self.timer.read(&self.gpu)
    }
}
