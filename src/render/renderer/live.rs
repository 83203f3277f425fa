//! What a live view needs beyond [`Renderer::draw`]: a quality that changes from frame to frame, progressive
//! refinement of a static picture, and a size that follows the window.

use super::{Renderer, picture};
use crate::error::Result;
use crate::render::budget::Quality;
use crate::render::options::Options;
use crate::render::view::{Before, Sample};
use crate::scene::Camera;

impl Renderer {
    /// The options, which determine what was reserved.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Sets the numbers of lights of set H and of shadow maps from the next [`draw`](Self::draw) on: at least
    /// one light, and at most what the options reserved.
    pub fn set_quality(&mut self, quality: Quality) {
        self.quality = Quality {
            lights: quality.lights.clamp(1, self.options.directional.lights),
            shadow_maps: quality.shadow_maps.min(self.options.directional.shadow_maps),
        };
    }

    /// Adds one more sample to the picture drawn last, of the same lights and scene from the same camera,
    /// which is then the mean of `drawn + 1` samples. `drawn` is the number of samples that it holds, at
    /// least 1.
    ///
    /// # Errors
    /// Those of the device.
    pub fn refine(&mut self, camera: &Camera, drawn: u32) -> Result<()> {
        self.timer.restart();
        let index = drawn.max(1);
        let count = index.saturating_add(1);
        self.sample(camera, Sample { index, count, before: Before::Average, has_emission: true });
        self.gpu.check()
    }

    /// Changes the size of the picture. The current picture is lost, and the exposure starts anew.
    ///
    /// # Errors
    /// Kind `Usage` for a size that the device does not support.
    pub fn resize(&mut self, width_px: u32, height_px: u32) -> Result<()> {
        let options = Options { width_px, height_px, ..self.options };
        options.check(&self.gpu.device.limits())?;
        self.options = options;
        let size = [width_px, height_px];
        self.view.resize(&self.gpu, size);
        self.picture = picture(&self.gpu, size, self.picture.format());
        self.gpu.check()
    }
}
