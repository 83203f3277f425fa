//! The mapping of radiance to a screen: exposure, tone curve, and alpha where the background is transparent.

use super::exposure::{Exposure, ExposurePass};
use super::look::{self, Look, Tone};
use crate::gpu::{Array, Gpu, Timer};
use bytemuck::{Pod, Zeroable};

const TONE: &str = include_str!("../../../shaders/view/tone.wgsl");

/// The value that Reinhard's operator maps to white under a fixed exposure: forty times middle grey, as in
/// [`ToneCurve`](crate::picture::ToneCurve).
const FIXED_WHITE: f32 = 7.2;

/// Parameters of the tone mapping, for shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct ScreenUniform {
    size: [u32; 2],
    curve: u32,
    is_transparent: u32,
    fixed_scale: f32,
    fixed_white: f32,
}

/// The tone mapping pass.
pub(in crate::render) struct TonePass {
    exposure: ExposurePass,
    pipeline: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
    screen: ScreenUniform,
    screens: Array<ScreenUniform>,
}

impl TonePass {
    /// A pass from a buffer of `width * height` pixels to targets of `format`, which must be an sRGB format.
    pub fn new(gpu: &Gpu, radiance: &Array<[f32; 4]>, size: [u32; 2], format: wgpu::TextureFormat) -> Self {
        let pipeline = gpu.screen_pipeline("tone", TONE, format);
        let exposure = ExposurePass::new(gpu, radiance, pixels(size));
        let mut screens = Array::new(gpu, "screen", wgpu::BufferUsages::UNIFORM, 1);
        let screen = ScreenUniform { size, ..ScreenUniform::default() };
        screens.write(gpu, &[screen]);
        let group = group(gpu, &pipeline, &screens, radiance, &exposure.state);
        Self { exposure, pipeline, group, screen, screens }
    }

    /// Switches to another buffer; the exposure starts anew.
    pub fn resize(&mut self, gpu: &Gpu, radiance: &Array<[f32; 4]>, size: [u32; 2]) {
        self.exposure.resize(gpu, radiance, pixels(size));
        self.group = group(gpu, &self.pipeline, &self.screens, radiance, &self.exposure.state);
        self.screen.size = size;
        self.screens.write(gpu, &[self.screen]);
    }

    /// Sets the look.
    pub fn set(&mut self, gpu: &Gpu, look: &Look) {
        self.screen = ScreenUniform {
            size: self.screen.size,
            // The numbers are those of the shader.
            curve: match look.tone {
                Tone::Reinhard => 0,
                Tone::Srgb => 1,
                Tone::None => 2,
            },
            is_transparent: u32::from(look.is_transparent()),
            fixed_scale: match look.exposure {
                look::Exposure::Automatic => 0.0,
                look::Exposure::Stops(stops) => stops.exp2(),
            },
            fixed_white: FIXED_WHITE,
        };
        self.screens.write(gpu, &[self.screen]);
    }

    /// Maps the picture to `target`, `elapsed_s` after the previous one.
    pub fn encode(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        target: &wgpu::TextureView,
        elapsed_s: f64,
    ) {
        if self.screen.fixed_scale == 0.0 {
            self.exposure.encode(gpu, encoder, timer, elapsed_s);
        }
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("tone"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: None,
            timestamp_writes: timer.render("tone"),
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..3, 0..1);
    }
}

fn pixels([width, height]: [u32; 2]) -> usize {
    width as usize * height as usize
}

fn group(
    gpu: &Gpu,
    pipeline: &wgpu::RenderPipeline,
    screens: &Array<ScreenUniform>,
    radiance: &Array<[f32; 4]>,
    exposure: &Array<Exposure>,
) -> wgpu::BindGroup {
    gpu.bind_group(
        &pipeline.get_bind_group_layout(0),
        &[(0, screens.binding()), (1, radiance.binding()), (2, exposure.binding())],
    )
}

#[cfg(test)]
mod twin {
    use super::{Exposure, ScreenUniform};
    use lightcast_core::image::luminance;
    use lightcast_core::math::{linear_from_srgb, srgb_from_linear};

    /// The result of `fragment`, encoded as in the target.
    pub(super) fn fragment(
        [r, g, b, alpha]: [f32; 4],
        screen: &ScreenUniform,
        exposure: &Exposure,
    ) -> [f32; 4] {
        let (mut scale, mut white) = (screen.fixed_scale, screen.fixed_white);
        let mut backdrop = 0.25 * 0.18;
        if screen.fixed_scale == 0.0 {
            scale = (exposure.log_key - exposure.log_average).exp2();
            white = (scale * exposure.log_white.exp2()).max(1.0);
            backdrop = 0.25 * exposure.log_key.exp2();
        }
        let scaled = if screen.is_transparent == 0 {
            [r, g, b].map(|v| (scale * v + (1.0 - alpha) * backdrop).min(1e18))
        } else {
            [r, g, b].map(|v| (scale * (v / alpha.max(1e-6))).min(1e18))
        };
        let bright = luminance(scaled);
        let mapped = match screen.curve {
            0 => scaled.map(|v| v * (1.0 + bright / (white * white)) / (1.0 + bright)),
            1 => scaled,
            _ => scaled.map(|v| linear_from_srgb(v.clamp(0.0, 1.0))),
        };
        let [r, g, b] = mapped.map(|v| srgb_from_linear(v.clamp(0.0, 1.0)));
        [r, g, b, if screen.is_transparent == 0 { 1.0 } else { alpha }]
    }
}

#[cfg(test)]
mod tests {
    use super::super::exposure::{adaptation_rate, twin as exposure_twin};
    use super::super::look::Background;
    use super::*;
    use crate::gpu::layout::{assert_layout, assert_valid, members};
    use crate::gpu::{read_buffer, read_texture};

    #[test]
    fn the_shader_is_valid_and_its_structs_lie_as_they_are_written() {
        assert_valid("tone", TONE);
        let exposure = members!(Exposure: log_average, log_key, log_white, started);
        assert_layout(TONE, "Exposure", size_of::<Exposure>(), exposure);
        assert_layout(
            TONE,
            "Screen",
            size_of::<ScreenUniform>(),
            members!(ScreenUniform: size, curve, is_transparent, fixed_scale, fixed_white),
        );
    }

    /// Pixels from 2^-30 to 2^30, some of them partly or not covered by a surface, some black.
    fn pixels(count: usize) -> Vec<[f32; 4]> {
        (0..count)
            .map(|i| {
                let value = (60.0 * (i as f32 / count as f32) - 30.0).exp2();
                let alpha = [1.0, 0.5, 0.0, 1.0][i % 4];
                [value * alpha, 0.5 * value * alpha, if i % 7 == 0 { 0.0 } else { value * alpha }, alpha]
            })
            .chain([[0.0, 0.0, 0.0, 1.0]])
            .collect()
    }

    const SIZE: [u32; 2] = [128, 80];

    fn target(gpu: &Gpu) -> wgpu::Texture {
        gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: SIZE[0], height: SIZE[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8UnormSrgb,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    }

    /// Compares every pixel with the twin under this exposure; draws first if the exposure is fixed.
    fn assert_shown(
        gpu: &Gpu,
        pass: &mut TonePass,
        texture: &wgpu::Texture,
        pixels: &[[f32; 4]],
        exposure: Option<&Exposure>,
    ) {
        let mut screen: Vec<[u8; 4]> = Vec::new();
        if exposure.is_none() {
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            pass.encode(gpu, &mut encoder, &mut Timer::new(gpu), &view, 0.0);
            gpu.queue.submit([encoder.finish()]);
        }
        read_texture(gpu, texture, &mut screen).unwrap();
        for (&pixel, found) in pixels.iter().zip(&screen) {
            let expected = twin::fragment(pixel, &pass.screen, exposure.unwrap_or(&Exposure::default()));
            for channel in 0..4 {
                let difference = expected[channel] * 255.0 - f32::from(found[channel]);
                assert!(difference.abs() < 1.0, "{:?} {pixel:?} {found:?} {expected:?}", pass.screen);
            }
        }
    }

    #[test]
    fn the_shaders_equal_their_twins() {
        let Some(gpu) = Gpu::for_test() else { return };
        let pixels = pixels(10_239);
        let mut radiance = Array::new(&gpu, "radiance", wgpu::BufferUsages::STORAGE, pixels.len());
        radiance.write(&gpu, &pixels);
        let texture = target(&gpu);
        let mut pass = TonePass::new(&gpu, &radiance, SIZE, texture.format());
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut expected = Exposure::default();
        for elapsed_s in [0.0, 0.04, 0.04] {
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            pass.encode(&gpu, &mut encoder, &mut Timer::new(&gpu), &view, elapsed_s);
            gpu.queue.submit([encoder.finish()]);
            let bins = exposure_twin::histogram(&pixels);
            exposure_twin::adapt(&bins, adaptation_rate(elapsed_s), &mut expected);
            let mut found = Vec::new();
            read_buffer(&gpu, pass.exposure.state.buffer(), 1, &mut found).unwrap();
            let Exposure { log_average, log_key, log_white, started } = found[0];
            assert!((log_average - expected.log_average).abs() < 2e-3, "{log_average} {expected:?}");
            assert!((log_key - expected.log_key).abs() < 2e-3, "{log_key} {expected:?}");
            // The percentile may fall into the next bin, because logarithms differ in the last place.
            assert!((log_white - expected.log_white).abs() < 0.05, "{log_white} {expected:?}");
            assert_eq!(started, 1);
            // The rest of the pictures must not depend on such a bin.
            expected = found[0];
        }
        assert_shown(&gpu, &mut pass, &texture, &pixels, Some(&expected));
    }

    #[test]
    fn every_curve_under_a_given_exposure_equals_its_twin() {
        let Some(gpu) = Gpu::for_test() else { return };
        let pixels = pixels(10_239);
        let mut radiance = Array::new(&gpu, "radiance", wgpu::BufferUsages::STORAGE, pixels.len());
        radiance.write(&gpu, &pixels);
        let texture = target(&gpu);
        let mut pass = TonePass::new(&gpu, &radiance, SIZE, texture.format());
        for tone in [Tone::Reinhard, Tone::Srgb, Tone::None] {
            for background in [Background::Grey, Background::Transparent] {
                for stops in [-3.0, 0.0, 2.0] {
                    let exposure = look::Exposure::Stops(stops);
                    pass.set(&gpu, &Look { background: background.clone(), exposure, tone });
                    assert_shown(&gpu, &mut pass, &texture, &pixels, None);
                }
            }
        }
    }

    #[test]
    fn plain_curves_show_what_they_say() {
        let screen = |curve| ScreenUniform { curve, fixed_scale: 2.0, ..ScreenUniform::default() };
        let shown =
            |curve, v: f32| twin::fragment([v, v, v, 1.0], &screen(curve), &Exposure::default())[0] * 255.0;
        // Half of the maximum light is code 188 in sRGB.
        assert!((shown(1, 0.25) - 187.5).abs() < 0.1, "{}", shown(1, 0.25));
        assert!((shown(2, 0.25) - 127.5).abs() < 1e-3, "{}", shown(2, 0.25));
        assert!((shown(1, 3.0) - 255.0).abs() < 1e-3 && (shown(2, 3.0) - 255.0).abs() < 1e-3);
    }
}
