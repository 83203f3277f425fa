use crate::error::Result;
use crate::files::{write_exr, write_png8, write_png8_with_alpha};
use crate::render::Renderer;
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
    /// `every` sequence numbers: the same lists with which maps are drawn. They go to `folder`, which must exist.
    pub fn new(renderer: Renderer, camera: Camera, samples: u32, folder: PathBuf, every: u64) -> Self {
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
        }
    }
}

impl Stage for Render {
    type Input = LightList;
    type Output = ();

    /// The scene moves with the capture time of the lists, not with real time. Lists from before the first
    /// frame, with which a filter begins, are drawn only where every list is.
    fn step(&mut self, list: &LightList, (): &mut ()) -> Result<Flow> {
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
        self.renderer.draw(&list.lights, &self.camera, self.samples)?;
        let path = self.folder.join(format!("frame_{:05}.png", list.stamp.sequence));
        self.writer.write(&mut self.renderer, elapsed_s, &path, false)?;
        Ok(Flow::Send)
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
