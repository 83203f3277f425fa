use crate::gpu::Gpu;
use crate::picture::MapBackground;
use lightcast_core::image::PolarMap;
use lightcast_core::light::{Light, Prefixes};

const SHADER: &str = include_str!("../../shaders/inset.wgsl");

/// Distance from the window's edges in pixels.
const MARGIN_PX: u32 = 8;
/// Width of the inset as a fraction of the window's width, and of its height for a round map.
const PART: f64 = 0.3;

/// A small picture of the map with its lights in the lower left corner.
pub(super) struct Inset {
    map: PolarMap,
    most_lights: usize,
    background: Option<MapBackground>,
    joined: Vec<Light>,
    prefixes: Prefixes,
    pipeline: wgpu::RenderPipeline,
    shown: Option<Shown>,
}

struct Shown {
    texture: wgpu::Texture,
    bind_group: wgpu::BindGroup,
}

impl Inset {
    /// Shows lights on `map`, merged into at most `most_lights`, on targets of `format`.
    pub fn new(gpu: &Gpu, map: PolarMap, most_lights: usize, format: wgpu::TextureFormat) -> Self {
        let pipeline = gpu.screen_pipeline("inset", SHADER, format);
        Self {
            map,
            most_lights,
            background: None,
            joined: Vec::new(),
            prefixes: Prefixes::default(),
            pipeline,
            shown: None,
        }
    }

    /// Redraws the picture at the next [`Self::update`], in a size that suits a window of this size.
    pub fn resize(&mut self, window_px: [u32; 2]) {
        let width = width_px(window_px, self.map.shape.theta_max_rad());
        self.background = (width > 0).then(|| MapBackground::new(&self.map, width as usize));
        self.shown = None;
    }

    /// Shows another map from the next [`Self::update`] on. Its shape must be that of the previous map.
    pub fn set_map(&mut self, map: &PolarMap) {
        self.map.pixels.clone_from(&map.pixels);
        if let Some(background) = &mut self.background {
            *background = MapBackground::new(&self.map, background.width());
        }
    }

    /// Draws other lights on the map.
    pub fn update(&mut self, gpu: &Gpu, lights: &[Light]) {
        let Some(background) = &self.background else { return };
        self.prefixes.prefix(lights, self.most_lights, &mut self.joined);
        let canvas = background.draw(&self.joined);
        let size = wgpu::Extent3d {
            width: canvas.width as u32,
            height: canvas.height as u32,
            depth_or_array_layers: 1,
        };
        let shown = self.shown.get_or_insert_with(|| {
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("inset"),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba8UnormSrgb,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            });
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            let layout = self.pipeline.get_bind_group_layout(0);
            let bind_group = gpu.bind_group(&layout, &[(0, wgpu::BindingResource::TextureView(&view))]);
            Shown { texture, bind_group }
        });
        let places = (0..canvas.height).flat_map(|y| (0..canvas.width).map(move |x| (x, y)));
        let rgba: Vec<u8> = places
            .flat_map(|(x, y)| {
                let [r, g, b] = canvas.pixel(x, y);
                [r, g, b, 255]
            })
            .collect();
        gpu.queue.write_texture(
            shown.texture.as_image_copy(),
            &rgba,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * size.width),
                rows_per_image: None,
            },
            size,
        );
    }

    /// Draws it over the contents of `target`, a window of this size.
    pub fn draw(&self, gpu: &Gpu, target: &wgpu::TextureView, window_px: [u32; 2]) {
        let Some(shown) = &self.shown else { return };
        let (width, height) = (shown.texture.width(), shown.texture.height());
        let Some(top) = window_px[1].checked_sub(height + MARGIN_PX) else { return };
        if MARGIN_PX + width > window_px[0] {
            return;
        }
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("inset"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            })],
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &shown.bind_group, &[]);
        pass.set_viewport(MARGIN_PX as f32, top as f32, width as f32, height as f32, 0.0, 1.0);
        pass.set_scissor_rect(MARGIN_PX, top, width, height);
        pass.draw(0..3, 0..1);
        drop(pass);
        gpu.queue.submit([encoder.finish()]);
    }
}

/// Width of the inset in a window of this size; 0 where it does not fit.
fn width_px([width, height]: [u32; 2], theta_max_rad: f64) -> u32 {
    let is_round = theta_max_rad <= std::f64::consts::FRAC_PI_2 + 1e-9;
    let part = if is_round { PART * f64::from(width.min(height)) } else { PART * f64::from(width) };
    let room = width.min(height).saturating_sub(2 * MARGIN_PX);
    (part.round() as u32).min(room)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::image::PolarShape;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn it_is_as_wide_as_there_is_room() {
        assert_eq!(width_px([640, 480], PI), 192);
        assert_eq!(width_px([640, 480], FRAC_PI_2), 144);
        assert_eq!(width_px([1000, 40], PI), 24);
        assert_eq!((width_px([0, 0], PI), width_px([10, 500], PI)), (0, 0));
    }

    #[test]
    fn it_is_drawn_on_a_window_of_any_size() {
        let gpu = Gpu::noop();
        let format = wgpu::TextureFormat::Bgra8UnormSrgb;
        for shape in [PolarShape::sphere(36, 18), PolarShape::hemisphere(36, 9)] {
            let mut inset = Inset::new(&gpu, PolarMap::black(shape), 8, format);
            for window_px in [[640, 480], [1, 1], [300, 20], [17, 400]] {
                inset.resize(window_px);
                inset.update(&gpu, &[]);
                let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                    label: None,
                    size: wgpu::Extent3d {
                        width: window_px[0],
                        height: window_px[1],
                        depth_or_array_layers: 1,
                    },
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                    view_formats: &[],
                });
                let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
                inset.draw(&gpu, &view, window_px);
                gpu.check().unwrap();
            }
        }
    }
}
