//! Times of whole frames of a renderer, and of the passes that they are made of.

use super::median::median;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::render::{Options, Renderer};
use crate::scene::{Camera, Scene};
use lightcast_core::light::Light;
use std::time::{Duration, Instant};

/// Passes in the order of a frame, as [`Renderer::read_times`] names them, and whether they are only render
/// passes.
pub const PASSES: [(&str, bool); 5] =
    [("regions", false), ("shadow maps", true), ("surfaces", true), ("shade", false), ("tone", false)];

/// Frames of which the median is taken, if they are quick.
const MOST_FRAMES: usize = 31;
/// A frame that takes longer than this many budgets is measured once.
const SLOW_BUDGETS: u32 = 4;
/// The format of targets of [`Renderer::present`].
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// Medians over some frames.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameTime {
    /// From the call to the end of the device's work: lights, regions, shadow maps, picture, tone mapping.
    pub frame: Duration,
    /// GPU time of each of [`PASSES`] where the adapter measures it right.
    pub passes: [Option<Duration>; PASSES.len()],
    /// How many frames there were.
    pub frames: usize,
}

/// A renderer whose frames are timed, with its scene's own camera and one sample per pixel.
pub struct Timed {
    /// The renderer.
    pub renderer: Renderer,
    /// Its camera.
    pub camera: Camera,
    target: wgpu::TextureView,
    are_compute_times_right: bool,
}

impl Timed {
    /// Opens the device and puts `scene` on it.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn new(gpu: Gpu, scene: Scene, options: &Options) -> Result<Self> {
        let renderer = Renderer::for_screen(gpu, scene, options, FORMAT)?;
        let texture = renderer.gpu().device.create_texture(&wgpu::TextureDescriptor {
            label: Some("timed picture"),
            size: wgpu::Extent3d {
                width: options.width_px,
                height: options.height_px,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        });
        let target = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let camera = renderer.default_camera();
        let are_compute_times_right = !is_in_software(renderer.gpu());
        Ok(Self { renderer, camera, target, are_compute_times_right })
    }

    /// Times frames under these lights: the first does not count where frames are quick, as it may include
    /// set-up work; at least three count, until `budget` is spent; of slow frames (four budgets) only one.
    /// The renderer forgets what it drew before.
    ///
    /// # Errors
    /// Those of the device.
    pub fn measure(&mut self, lights: &[Light], budget: Duration) -> Result<FrameTime> {
        // One light makes drivers compile what they compile late.
        self.draw(&lights[..lights.len().min(1)])?;
        self.renderer.release_shadow_maps();
        let start = Instant::now();
        let (mut frames, mut passes) = (Vec::new(), [const { Vec::new() }; PASSES.len()]);
        let mut is_first = true;
        while frames.len() < 3 || (start.elapsed() < budget && frames.len() < MOST_FRAMES) {
            let frame = self.draw(lights)?;
            let times = self.renderer.read_times()?;
            if is_first && frame < Duration::from_secs(1) {
                is_first = false;
                continue;
            }
            is_first = false;
            frames.push(frame);
            for ((name, is_render), of_pass) in PASSES.into_iter().zip(&mut passes) {
                let time_ns = times.iter().find(|(known, _)| *known == name).map(|(_, ns)| *ns);
                of_pass.extend(time_ns.filter(|_| is_render || self.are_compute_times_right));
            }
            if frame > budget * SLOW_BUDGETS {
                break;
            }
        }
        Ok(FrameTime {
            frames: frames.len(),
            frame: median(&mut frames).unwrap_or_default(),
            passes: passes.map(|mut times_ns| median(&mut times_ns).map(Duration::from_nanos)),
        })
    }

    /// Draws a frame and waits for it.
    fn draw(&mut self, lights: &[Light]) -> Result<Duration> {
        let start = Instant::now();
        self.renderer.draw(lights, &self.camera, 1)?;
        self.renderer.present(&self.target, 0.0)?;
        self.renderer.gpu().wait()?;
        Ok(start.elapsed())
    }
}

/// Whether the adapter is a program on the CPU; Mesa's (lavapipe) times compute passes wrongly (see
/// [`crate::gpu::Timer`]).
pub fn is_in_software(gpu: &Gpu) -> bool {
    gpu.info.device_type == wgpu::DeviceType::Cpu
}

/// Lines above every table, with the adapter and driver.
pub fn heading(gpu: &Gpu) -> Vec<String> {
    let info = &gpu.info;
    let mut lines = vec![format!(
        "{} ({:?}, {:?}; driver {} {})",
        info.name, info.device_type, info.backend, info.driver, info.driver_info
    )];
    if is_in_software(gpu) {
        lines.push(
            "No GPU: a driver in software. Its times say what is dear, not how fast a GPU is; it measures no \
             compute passes (-)."
                .to_owned(),
        );
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_have_the_names_that_the_renderer_gives_them() {
        let Some(gpu) = Gpu::for_test() else { return };
        let has_timestamps = gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let options = Options { width_px: 32, height_px: 24, ..Options::default() };
        let mut timed = Timed::new(gpu, Scene::built_in(), &options).unwrap();
        let light = Light { id: 0, direction: [0.0, 1.0, 0.0], irradiance: [1.0; 3], spread_rad: 0.0 };
        let time = timed.measure(&[light], Duration::from_secs(1)).unwrap();
        assert!((3..=MOST_FRAMES).contains(&time.frames), "{}", time.frames);
        assert!(time.frame > Duration::ZERO);
        timed.draw(&[light]).unwrap();
        let names: Vec<&str> =
            timed.renderer.read_times().unwrap().into_iter().map(|(name, _)| name).collect();
        if has_timestamps {
            assert_eq!(names, PASSES.map(|(name, _)| name));
            let is_measured = time.passes.map(|time| time.is_some());
            let expected = PASSES.map(|(_, is_render)| is_render || timed.are_compute_times_right);
            assert_eq!(is_measured, expected);
        } else {
            assert!(names.is_empty());
        }
    }
}
