//! From radiance to a screen: Reinhard's global operator with log-average, key and white smoothed over time (Havran et
//! al. 2005, section 5.1), so that brightness does not flicker with what the camera sees.

use crate::gpu::{Array, Gpu, Timer};
use bytemuck::{Pod, Zeroable};

const HISTOGRAM: &str = include_str!("../../shaders/histogram.wgsl");
const ADAPT: &str = include_str!("../../shaders/adapt.wgsl");
const TONE: &str = include_str!("../../shaders/tone.wgsl");

const BINS: usize = 1024;
/// Pixels that one workgroup counts.
const PIXELS_PER_GROUP: usize = 256 * 16;
/// Workgroups along one axis that every device allows.
const GROUPS_PER_ROW: usize = 65_535;

/// Time after which the exposure has followed a change by all but 1/e, as quick as eyes that see by day.
const TIME_CONSTANT_S: f64 = 0.4;

/// State of the adaptation, in stops.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct Exposure {
    log_average: f32,
    log_key: f32,
    log_white: f32,
    started: u32,
}

/// Maps tones.
pub(super) struct TonePass {
    histogram: wgpu::ComputePipeline,
    adapt: wgpu::ComputePipeline,
    tone: wgpu::RenderPipeline,
    histogram_group: wgpu::BindGroup,
    adapt_group: wgpu::BindGroup,
    tone_group: wgpu::BindGroup,
    adaptation: Array<f32>,
    #[cfg(test)]
    exposure: Array<Exposure>,
    pixels: usize,
}

impl TonePass {
    /// From a buffer of `width * height` pixels to targets of `format`, which must code as sRGB.
    pub fn new(
        gpu: &Gpu,
        radiance: &Array<[f32; 4]>,
        [width, height]: [u32; 2],
        format: wgpu::TextureFormat,
    ) -> Self {
        use wgpu::BufferUsages as Usage;
        let histogram = gpu.compute_pipeline("histogram", &[HISTOGRAM], &[]);
        let adapt = gpu.compute_pipeline("adapt", &[ADAPT], &[]);
        let module = gpu.shader("tone", &[TONE]);
        let tone = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("tone"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let bins: Array<u32> = Array::new(gpu, "histogram", Usage::STORAGE, BINS);
        let adaptation = Array::new(gpu, "adaptation", Usage::UNIFORM, 1);
        let exposure: Array<Exposure> = Array::new(gpu, "exposure", Usage::STORAGE | Usage::COPY_SRC, 1);
        let mut screen: Array<[u32; 2]> = Array::new(gpu, "screen", Usage::UNIFORM, 1);
        screen.write(gpu, &[[width, height]]);
        let histogram_group = gpu
            .bind_group(&histogram.get_bind_group_layout(0), &[(0, radiance.binding()), (1, bins.binding())]);
        let adapt_group = gpu.bind_group(
            &adapt.get_bind_group_layout(0),
            &[(0, adaptation.binding()), (1, bins.binding()), (2, exposure.binding())],
        );
        let tone_group = gpu.bind_group(
            &tone.get_bind_group_layout(0),
            &[(0, screen.binding()), (1, radiance.binding()), (2, exposure.binding())],
        );
        let pixels = width as usize * height as usize;
        Self {
            histogram,
            adapt,
            tone,
            histogram_group,
            adapt_group,
            tone_group,
            adaptation,
            #[cfg(test)]
            exposure,
            pixels,
        }
    }

    /// Maps the picture to `target`, `elapsed_s` after the one before; the first sets the exposure at once.
    pub fn encode(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        target: &wgpu::TextureView,
        elapsed_s: f64,
    ) {
        self.adaptation.write(gpu, &[adaptation_rate(elapsed_s)]);
        let groups = self.pixels.div_ceil(PIXELS_PER_GROUP);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("exposure"),
            timestamp_writes: timer.compute("tone"),
        });
        pass.set_pipeline(&self.histogram);
        pass.set_bind_group(0, &self.histogram_group, &[]);
        pass.dispatch_workgroups(
            groups.min(GROUPS_PER_ROW) as u32,
            groups.div_ceil(GROUPS_PER_ROW) as u32,
            1,
        );
        pass.set_pipeline(&self.adapt);
        pass.set_bind_group(0, &self.adapt_group, &[]);
        pass.dispatch_workgroups(1, 1, 1);
        drop(pass);
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
        pass.set_pipeline(&self.tone);
        pass.set_bind_group(0, &self.tone_group, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// Share of the way that the exposure goes in so much time. Time that runs backwards stands still.
fn adaptation_rate(elapsed_s: f64) -> f32 {
    (1.0 - (-elapsed_s.max(0.0) / TIME_CONSTANT_S).exp()) as f32
}

#[cfg(test)]
mod twin {
    use super::{BINS, Exposure};
    use lightcast_core::image::luminance;

    pub(super) fn histogram(radiance: &[[f32; 4]]) -> Vec<u32> {
        let mut bins = vec![0; BINS];
        for &[r, g, b, alpha] in radiance {
            let luminance = luminance([r, g, b]);
            if alpha > 0.0 && luminance > 0.0 {
                let place = ((luminance / alpha).log2() + 24.0) * (BINS as f32 / 48.0);
                bins[place.clamp(0.0, BINS as f32 - 1.0) as usize] += 1;
            }
        }
        bins
    }

    pub(super) fn adapt(bins: &[u32], rate: f32, exposure: &mut Exposure) {
        let count: u32 = bins.iter().sum();
        if count == 0 {
            return;
        }
        let dark_count = (0.01 * count as f32) as u32;
        let (mut mean, mut below) = (0.0, 0);
        let (mut darkest, mut brightest) = (-24.0, -24.0);
        for (bin, &pixels) in bins.iter().enumerate() {
            let stop = -24.0 + (bin as f32 + 0.5) * (48.0 / BINS as f32);
            mean += stop * (pixels as f32 / count as f32);
            if below <= dark_count {
                darkest = stop;
            }
            if below < count - dark_count {
                brightest = stop;
            }
            below += pixels;
        }
        let range = f32::max(brightest - darkest, 1e-3);
        let key = 0.18f32.log2() + 2.0 * ((2.0 * mean - darkest - brightest) / range).clamp(-1.0, 1.0);
        if exposure.started == 0 {
            *exposure = Exposure { log_average: mean, log_key: key, log_white: brightest, started: 1 };
            return;
        }
        exposure.log_average += rate * (mean - exposure.log_average);
        exposure.log_key += rate * (key - exposure.log_key);
        exposure.log_white += rate * (brightest - exposure.log_white);
    }

    /// Linear, in [0, 1].
    pub(super) fn screen([r, g, b, alpha]: [f32; 4], exposure: &Exposure) -> [f32; 3] {
        let scale = (exposure.log_key - exposure.log_average).exp2();
        let scaled =
            [r, g, b].map(|v| (scale * v + (1.0 - alpha) * 0.25 * exposure.log_key.exp2()).min(1e18));
        let bright = luminance(scaled);
        let white = (scale * exposure.log_white.exp2()).max(1.0);
        scaled.map(|v| v * (1.0 + bright / (white * white)) / (1.0 + bright))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_layout, assert_valid, members};
    use crate::gpu::{read_buffer, read_texture};

    #[test]
    fn the_shaders_are_valid_and_their_structs_lie_as_they_are_written() {
        for (name, source) in [("histogram", HISTOGRAM), ("adapt", ADAPT), ("tone", TONE)] {
            assert_valid(name, source);
        }
        for source in [ADAPT, TONE] {
            let exposure = members!(Exposure: log_average, log_key, log_white, started);
            assert_layout(source, "Exposure", size_of::<Exposure>(), exposure);
        }
        assert_layout(ADAPT, "Adaptation", 4, &[("rate", 0)]);
        assert_layout(TONE, "Screen", 8, &[("size", 0)]);
    }

    #[test]
    fn the_exposure_follows_a_change_by_all_but_a_part_in_e_in_its_time_constant() {
        let mut exposure = Exposure::default();
        let bins = |place: usize| {
            let mut bins = vec![0; BINS];
            bins[place] = 1000;
            bins
        };
        twin::adapt(&bins(500), 1.0, &mut exposure);
        let before = exposure.log_average;
        for _ in 0..10 {
            twin::adapt(&bins(600), adaptation_rate(0.1 * TIME_CONSTANT_S), &mut exposure);
        }
        let step = 100.0 * 48.0 / 1024.0;
        assert!(((exposure.log_average - before) / step - (1.0 - (-1.0f32).exp())).abs() < 1e-4);
        twin::adapt(&bins(900), adaptation_rate(-5.0), &mut exposure);
        assert!(((exposure.log_average - before) / step - (1.0 - (-1.0f32).exp())).abs() < 1e-4);
    }

    /// Pixels from 2^-30 to 2^30, some of them in part or without a surface, some black.
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

    #[test]
    fn the_shaders_equal_their_twins() {
        let Some(gpu) = Gpu::for_test() else { return };
        let pixels = pixels(10_239);
        let size = [128, 80];
        let usage = wgpu::BufferUsages::STORAGE;
        let mut radiance = Array::new(&gpu, "radiance", usage, pixels.len());
        radiance.write(&gpu, &pixels);
        let format = wgpu::TextureFormat::Rgba8UnormSrgb;
        let mut pass = TonePass::new(&gpu, &radiance, size, format);
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut expected = Exposure::default();
        for elapsed_s in [0.0, 0.04, 0.04] {
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            pass.encode(&gpu, &mut encoder, &mut Timer::new(&gpu), &view, elapsed_s);
            gpu.queue.submit([encoder.finish()]);
            twin::adapt(&twin::histogram(&pixels), adaptation_rate(elapsed_s), &mut expected);
            let mut found = Vec::new();
            read_buffer(&gpu, pass.exposure.buffer(), 1, &mut found).unwrap();
            let Exposure { log_average, log_key, log_white, started } = found[0];
            assert!((log_average - expected.log_average).abs() < 2e-3, "{log_average} {expected:?}");
            assert!((log_key - expected.log_key).abs() < 2e-3, "{log_key} {expected:?}");
            // The percentile may fall into the next bin, as logarithms differ in the last place.
            assert!((log_white - expected.log_white).abs() < 0.05, "{log_white} {expected:?}");
            assert_eq!(started, 1);
            // The rest of the pictures must not depend on such a bin.
            expected = found[0];
        }
        let mut screen: Vec<[u8; 4]> = Vec::new();
        read_texture(&gpu, &texture, &mut screen).unwrap();
        for (&pixel, found) in pixels.iter().zip(&screen) {
            let linear = twin::screen(pixel, &expected);
            for channel in 0..3 {
                let v = linear[channel].clamp(0.0, 1.0);
                let coded = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
                assert!(
                    (coded * 255.0 - f32::from(found[channel])).abs() < 1.0,
                    "{pixel:?} {found:?} {linear:?}"
                );
            }
        }
    }
}
