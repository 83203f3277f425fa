use super::written::Written;
use crate::error::Result;
use crate::files::{write_exr, write_png8, write_png8_with_alpha};
use crate::render::Renderer;
use crate::rt::Shutdown;
use crate::rt::fan_out::Every;
use crate::rt::link::Copied;
use crate::rt::stage::{Flow, Stage};
use crate::scene::Camera;
use lightcast_core::image::{Frame, Pixels};
use lightcast_core::light::LightList;
use std::path::{Path, PathBuf};

/// Renders lists into picture files with the numbers of the lists.
pub struct Render {
    renderer: Renderer,
    camera: Camera,
    samples: u32,
    folder: PathBuf,
    every: Every,
    /// Sequence number of the first list.
    first: Option<u64>,
    last_time_ns: Option<i64>,
    writer: PictureWriter,
    /// A picture takes minutes without a GPU: who interrupts does not wait for it, nor for the lists in the
    /// link.
    interrupted: Shutdown,
    written: Written,
}

/// Writes what a renderer has drawn.
#[derive(Default)]
pub struct PictureWriter {
    rgba8: Vec<[u8; 4]>,
    bytes: Vec<u8>,
    radiance: Vec<[f32; 4]>,
}

impl Render {
    /// Pictures of `samples` samples a pixel, of the lists that describe the first frame in every block of
    /// `every` sequence numbers: the same lists with which maps are drawn. They go to `folder`, which must
    /// exist. None follows once `interrupted` is requested, and one in progress is dropped.
    pub fn new(
        renderer: Renderer,
        camera: Camera,
        samples: u32,
        folder: PathBuf,
        every: u64,
        interrupted: &Shutdown,
    ) -> Self {
        let writer = PictureWriter::default();
        Self {
            renderer,
            camera,
            samples,
            folder,
            every: Every::new(every),
            first: None,
            last_time_ns: None,
            writer,
            interrupted: interrupted.clone(),
            written: Written::default(),
        }
    }
}

impl Stage for Render {
    type Input = LightList;
    type Output = ();

    /// The scene moves with the capture time of the lists, not with real time. Lists from before the first
    /// frame, with which a filter begins, are drawn only where every list is.
    fn step(&mut self, list: &LightList, (): &mut ()) -> Result<Flow> {
        if self.interrupted.is_requested() {
            return Ok(Flow::End);
        }
        self.written.saw(list);
        let first = *self.first.get_or_insert(list.stamp.sequence);
        if !self.every.is_due(list.sequence().filter(|&sequence| sequence >= first)) {
            return Ok(Flow::Send);
        }
        let time_ns = list.stamp.capture_time_ns;
        let elapsed_s = time_ns.saturating_sub(self.last_time_ns.unwrap_or(time_ns)) as f64 * 1e-9;
        self.last_time_ns = Some(time_ns);
        if self.renderer.scene().is_animated() {
            self.renderer.pose(time_ns as f64 * 1e-9);
        }
        let goes_on = || !self.interrupted.is_requested();
        if !self.renderer.draw_while(&list.lights, &self.camera, self.samples, goes_on)? {
            return Ok(Flow::End);
        }
        let path = self.folder.join(format!("frame_{:05}.png", list.stamp.sequence));
        self.writer.write(&mut self.renderer, elapsed_s, &path, false)?;
        self.written.count();
        Ok(Flow::Send)
    }

    fn finish(&mut self, is_complete: bool) -> Result<()> {
        if is_complete && !self.interrupted.is_requested() {
            self.written.tell(&self.folder);
        }
        Ok(())
    }
}

impl PictureWriter {
    /// Writes the picture drawn last: OpenEXR holds the radiance, black where nothing is seen; PNG the
    /// tone-mapped picture, its exposure adapted over `elapsed_s` since the last one. With a transparent
    /// background both have alpha: OpenEXR's colours are multiplied by it, those of PNG are not, as these
    /// formats specify.
    ///
    /// # Errors
    /// Those of the device; when the file cannot be written.
    pub fn write(
        &mut self,
        renderer: &mut Renderer,
        elapsed_s: f64,
        path: &Path,
        is_exr: bool,
    ) -> Result<()> {
        let [width, height] = renderer.size();
        let channels = if renderer.is_transparent() { 4 } else { 3 };
        if is_exr {
            renderer.read_radiance(&mut self.radiance)?;
            let samples = self.radiance.iter().flat_map(|pixel| &pixel[..channels]).copied();
            let frame = Frame {
                width,
                height,
                channels,
                pixels: Pixels::Radiance(samples.collect()),
                ..Frame::default()
            };
            write_exr(path, &frame, None, false)
        } else {
            renderer.read_picture(elapsed_s, &mut self.rgba8)?;
            self.bytes.clear();
            self.bytes.extend(self.rgba8.iter().flat_map(|pixel| &pixel[..channels]));
            let write = if channels == 4 { write_png8_with_alpha } else { write_png8 };
            write(path, width, height, &self.bytes)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::Gpu;
    use crate::render::{Background, Exposure, Look, Options, Tone};
    use crate::scene::Scene;
    use lightcast_core::light::Light;

    #[test]
    fn alpha_multiplies_the_colours_of_openexr_and_leaves_those_of_png_alone() {
        let Some(gpu) = Gpu::for_test() else { return };
        let options = Options { width_px: 40, height_px: 30, ..Options::default() };
        let mut renderer = Renderer::new(gpu, Scene::sphere_of_normals(64), &options).unwrap();
        let look =
            Look { background: Background::Transparent, exposure: Exposure::Stops(0.0), tone: Tone::Srgb };
        renderer.set_look(&look).unwrap();
        let light = Light { id: 0, direction: [0.0, 1.0, 0.0], irradiance: [0.9, 0.6, 0.3], spread_rad: 0.0 };
        let camera = renderer.default_camera();
        renderer.draw(&[light], &camera, 8).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let [exr, png] = ["a.exr", "a.png"].map(|name| folder.path().join(name));
        let mut writer = PictureWriter::default();
        writer.write(&mut renderer, 0.0, &exr, true).unwrap();
        writer.write(&mut renderer, 0.0, &png, false).unwrap();

        let png = ::image::open(&png).unwrap();
        assert_eq!(png.color(), ::image::ColorType::Rgba8);
        let png = png.into_rgba8();
        let exr = ::exr::prelude::read_first_rgba_layer_from_file(
            &exr,
            |size, _| vec![[0.0; 4]; size.area()],
            |pixels: &mut Vec<[f32; 4]>, at, (r, g, b, a): (f32, f32, f32, f32)| {
                pixels[at.y() * 40 + at.x()] = [r, g, b, a];
            },
        );
        let exr = exr.unwrap().layer_data.channel_data.pixels;
        let mut covered_in_part = 0;
        for (linear, coded) in exr.iter().zip(png.pixels()) {
            let alpha = linear[3];
            assert!((alpha * 255.0 - f32::from(coded.0[3])).abs() <= 1.0, "{linear:?} {coded:?}");
            if alpha == 0.0 {
                continue;
            }
            covered_in_part += usize::from(alpha < 1.0);
            for channel in 0..3 {
                let straight = (linear[channel] / alpha).clamp(0.0, 1.0);
                let expected = 255.0 * lightcast_core::math::srgb_from_linear(straight);
                let difference = (f32::from(coded.0[channel]) - expected).abs();
                assert!(difference <= 1.5, "{linear:?} {coded:?}");
            }
        }
        assert!(covered_in_part > 20, "{covered_in_part}");
    }
}
