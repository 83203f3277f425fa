use crate::error::{Error, Result};
use crate::gpu::Gpu;
use std::sync::Arc;
use winit::window::Window;

/// The window as a render target.
pub(super) struct Screen {
    instance: wgpu::Instance,
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    format: wgpu::TextureFormat,
    /// Whether the surface was suboptimal for the last picture.
    is_suboptimal: bool,
}

impl Screen {
    /// A screen and the device that draws on it; configure it before use.
    ///
    /// # Errors
    /// Those of the device; when the window is not supported by it.
    pub fn new(instance: wgpu::Instance, window: Arc<Window>) -> Result<(Self, Gpu)> {
        let surface = surface(&instance, &window)?;
        let gpu = Gpu::open(&instance, Some(&surface))?;
        let format = gpu.surface_format(&surface)?;
        Ok((Self { instance, window, surface, format, is_suboptimal: false }, gpu))
    }

    /// Texture format of pictures for it.
    pub fn format(&self) -> wgpu::TextureFormat {
        self.format
    }

    /// Adapts to the size of the window, which must not be 0.
    pub fn configure(&self, gpu: &Gpu, [width, height]: [u32; 2]) {
        self.surface.configure(
            &gpu.device,
            &wgpu::SurfaceConfiguration {
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                format: self.format,
                color_space: wgpu::SurfaceColorSpace::default(),
                width,
                height,
                present_mode: wgpu::PresentMode::Fifo,
                alpha_mode: wgpu::CompositeAlphaMode::Auto,
                view_formats: Vec::new(),
                desired_maximum_frame_latency: 2,
            },
        );
    }

    /// The next surface texture to draw on; `None` where this frame is to be skipped: the window is occluded,
    /// or has just changed and the surface with it.
    ///
    /// # Errors
    /// When the device was lost, or the surface can no longer be used.
    pub fn next(&mut self, gpu: &Gpu, size: [u32; 2]) -> Result<Option<wgpu::SurfaceTexture>> {
        use wgpu::CurrentSurfaceTexture as Current;
        if std::mem::take(&mut self.is_suboptimal) {
            self.configure(gpu, size);
        }
        match self.surface.get_current_texture() {
            Current::Success(texture) => return Ok(Some(texture)),
            Current::Suboptimal(texture) => {
                // Some displays always report this; they are drawn on anyway.
                self.is_suboptimal = true;
                return Ok(Some(texture));
            }
            Current::Timeout | Current::Occluded => {}
            Current::Outdated => self.configure(gpu, size),
            Current::Lost => {
                gpu.check()?;
                self.surface = surface(&self.instance, &self.window)?;
                self.configure(gpu, size);
            }
            Current::Validation => {}
        }
        gpu.check()?;
        Ok(None)
    }
}

fn surface(instance: &wgpu::Instance, window: &Arc<Window>) -> Result<wgpu::Surface<'static>> {
    instance
        .create_surface(window.clone())
        .map_err(|error| Error::failed("the window cannot be drawn on").because(error))
}
