//! Automatic exposure of a picture: log-average, key and white (Reinhard et al. 2002 and 2003) smoothed over
//! time (Havran et al. 2005, section 5.1), so that brightness does not flicker with what the camera sees.

use crate::gpu::{Array, Gpu, Timer};
use bytemuck::{Pod, Zeroable};

const HISTOGRAM: &str = include_str!("../../../shaders/view/histogram.wgsl");
const ADAPT: &str = include_str!("../../../shaders/view/adapt.wgsl");

const BINS: usize = 1024;
/// Pixels that one workgroup counts.
const PIXELS_PER_GROUP: usize = 256 * 16;
/// Most workgroups along one axis that every device supports.
const GROUPS_PER_ROW: usize = 65_535;

/// Time after which the exposure has adapted to a change except for 1/e, as fast as human eyes in daylight.
const TIME_CONSTANT_S: f64 = 0.4;

/// State of the adaptation, in stops.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Exposure {
    pub log_average: f32,
    pub log_key: f32,
    pub log_white: f32,
    pub started: u32,
}

/// The pass that measures pictures.
pub(super) struct ExposurePass {
    histogram: wgpu::ComputePipeline,
    adapt: wgpu::ComputePipeline,
    histogram_group: wgpu::BindGroup,
    adapt_group: wgpu::BindGroup,
    adaptation: Array<f32>,
    bins: Array<u32>,
    pub state: Array<Exposure>,
    pixels: usize,
}

impl ExposurePass {
    /// A pass for a buffer of `pixels` pixels.
    pub fn new(gpu: &Gpu, radiance: &Array<[f32; 4]>, pixels: usize) -> Self {
        use wgpu::BufferUsages as Usage;
        let histogram = gpu.compute_pipeline("histogram", &[HISTOGRAM], &[], None);
        let adapt = gpu.compute_pipeline("adapt", &[ADAPT], &[], None);
        let bins = Array::new(gpu, "histogram", Usage::STORAGE, BINS);
        let adaptation = Array::new(gpu, "adaptation", Usage::UNIFORM, 1);
        let state = Array::new(gpu, "exposure", Usage::STORAGE | Usage::COPY_SRC, 1);
        let histogram_group = histogram_group(gpu, &histogram, radiance, &bins);
        let adapt_group = gpu.bind_group(
            &adapt.get_bind_group_layout(0),
            &[(0, adaptation.binding()), (1, bins.binding()), (2, state.binding())],
        );
        Self { histogram, adapt, histogram_group, adapt_group, adaptation, bins, state, pixels }
    }

    /// Switches to another buffer; the exposure starts anew.
    pub fn resize(&mut self, gpu: &Gpu, radiance: &Array<[f32; 4]>, pixels: usize) {
        self.histogram_group = histogram_group(gpu, &self.histogram, radiance, &self.bins);
        self.pixels = pixels;
        self.state.write(gpu, &[Exposure::default()]);
    }

    /// Adapts to the picture, `elapsed_s` after the previous one; the first picture sets the exposure at
    /// once.
    pub fn encode(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
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
    }
}

fn histogram_group(
    gpu: &Gpu,
    histogram: &wgpu::ComputePipeline,
    radiance: &Array<[f32; 4]>,
    bins: &Array<u32>,
) -> wgpu::BindGroup {
    let layout = histogram.get_bind_group_layout(0);
    gpu.bind_group(&layout, &[(0, radiance.binding()), (1, bins.binding())])
}

/// Fraction of a change to which the exposure adapts in `elapsed_s`. Negative times count as 0.
pub(super) fn adaptation_rate(elapsed_s: f64) -> f32 {
    (1.0 - (-elapsed_s.max(0.0) / TIME_CONSTANT_S).exp()) as f32
}

#[cfg(test)]
pub(super) mod twin {
    use super::{BINS, Exposure};
    use lightcast_core::image::luminance;

    pub fn histogram(radiance: &[[f32; 4]]) -> Vec<u32> {
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

    pub fn adapt(bins: &[u32], rate: f32, exposure: &mut Exposure) {
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_layout, assert_valid, members};

    #[test]
    fn the_shaders_are_valid_and_their_structs_lie_as_they_are_written() {
        assert_valid("histogram", HISTOGRAM);
        assert_valid("adapt", ADAPT);
        let exposure = members!(Exposure: log_average, log_key, log_white, started);
        assert_layout(ADAPT, "Exposure", size_of::<Exposure>(), exposure);
        assert_layout(ADAPT, "Adaptation", 4, &[("rate", 0)]);
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
}
