//! What a live view needs beyond [`Renderer::draw`]: a quality that changes from frame to frame, a picture that gets
//! better while nothing moves, and a size that follows the window.

use super::{Before, Renderer, picture};
use crate::error::Result;
use crate::gpu::Array;
use crate::render::Options;
use crate::render::budget::Quality;
use crate::render::surface::SurfacePass;
use crate::render::tone::TonePass;
use crate::scene::Camera;

impl Renderer {
    /// What was reserved.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Lights of set H and shadow maps from the next [`draw`](Self::draw) on: at least one light, and at most what the
    /// options reserved.
    pub fn set_quality(&mut self, quality: Quality) {
        self.quality = Quality {
            lights: quality.lights.clamp(1, self.options.lights),
            shadow_maps: quality.shadow_maps.min(self.options.shadow_maps),
        };
    }

    /// Adds one more sample to the picture drawn last, of the same lights and scene from the same camera, which is then
    /// the mean of `drawn + 1` samples. `drawn` is the number of samples that it holds, at least 1.
    ///
    /// # Errors
    /// Those of the device.
    pub fn refine(&mut self, camera: &Camera, drawn: u32) -> Result<()> {
        self.timer.restart();
        let options = self.options;
        let drawn = drawn.max(1);
        self.sample(camera, drawn, drawn.saturating_add(1), Before::Average, true, &options);
        self.gpu.check()
    }

    /// Changes the size of the picture. What was drawn is lost, and the exposure starts anew.
    ///
    /// # Errors
    /// Kind `Usage` for a size that the device cannot do.
    pub fn resize(&mut self, width_px: u32, height_px: u32) -> Result<()> {
        let options = Options { width_px, height_px, ..self.options };
        options.check(&self.gpu.device.limits())?;
        self.options = options;
        let (gpu, size) = (&self.gpu, [width_px, height_px]);
        let format = self.picture.format();
        self.surface_pass = SurfacePass::new(gpu, width_px, height_px);
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        self.buffers.radiance = Array::new(gpu, "radiance", usage, options.pixels());
        self.tone_pass = TonePass::new(gpu, &self.buffers.radiance, size, format);
        self.picture = picture(gpu, size, format);
        self.remake_bind_groups();
        self.gpu.check()
    }
}
