//! What a camera sees, independent of the lighting: surfaces of every pixel, radiance, and the mapping to a
//! screen.
//!
//! A sample of the picture [starts](View::start) with its surfaces and what they emit; then lightings add
//! radiance to it through [`Seen`].

mod background;
mod camera;
mod exposure;
mod look;
#[cfg(test)]
mod look_tests;
mod seen;
#[cfg(test)]
pub(super) mod seen_twin;
mod start;
mod surface;
mod tone;

use super::world::World;
use crate::error::Result;
use crate::gpu::{Array, Gpu, Timer};
use crate::scene::Camera;
use background::BackgroundBindings;
use camera::{clip_from_eye, pixel_offset};
use seen::SampleUniform;
use start::StartPass;
use surface::{CameraUniform, SurfacePass};
use tone::TonePass;

pub use look::{Background, Exposure, Look, Tone};
pub(super) use seen::{SOURCE as SEEN, Seen};

/// What happens to the current picture when a sample is added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Before {
    /// It is discarded: the sample starts a new picture.
    Drop,
    /// It is kept unchanged.
    Keep,
    /// It is the mean of all samples before this one.
    Average,
}

/// One of the pictures, from slightly different points of each pixel, whose mean is a frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Its index.
    pub index: u32,
    /// How many there are.
    pub count: u32,
    pub before: Before,
    /// Whether it includes the emission of surfaces: where light is added in several passes, only the first
    /// does.
    pub has_emission: bool,
}

/// The picture that is being rendered.
pub(super) struct View {
    pub surfaces: SurfacePass,
    surface_group: wgpu::BindGroup,
    camera: Array<CameraUniform>,
    /// The data that lightings read and add to.
    pub seen: Seen,
    start: StartPass,
    background: BackgroundBindings,
    pub tone: TonePass,
    is_transparent: bool,
}

impl View {
    /// A view of this world for pictures of `size`, on targets of `format`, which must be an sRGB format.
    pub fn new(gpu: &Gpu, world: &World, size: [u32; 2], format: wgpu::TextureFormat) -> Self {
        let surfaces = SurfacePass::new(gpu, size);
        let camera = Array::new(gpu, "camera", wgpu::BufferUsages::UNIFORM, 1);
        let surface_group = surfaces.bind_group(gpu, &camera, &world.geometry.instances);
        let seen = Seen::new(gpu, &surfaces, size);
        let background = BackgroundBindings::new(gpu);
        let start = StartPass::new(gpu, &seen, &background);
        let tone = TonePass::new(gpu, &seen.radiance, size, format);
        Self { surfaces, surface_group, camera, seen, start, background, tone, is_transparent: false }
    }

    /// Changes the size. The current picture is lost, and the exposure starts anew.
    pub fn resize(&mut self, gpu: &Gpu, size: [u32; 2]) {
        self.surfaces.resize(gpu, size);
        self.seen.resize(gpu, &self.surfaces, size);
        self.tone.resize(gpu, &self.seen.radiance, size);
    }

    /// Sets the look from the next frame on.
    ///
    /// # Errors
    /// Kind `Usage` for a look that the device does not support.
    pub fn set_look(&mut self, gpu: &Gpu, look: &Look) -> Result<()> {
        look.check(&gpu.device.limits())?;
        self.background.set(gpu, &look.background);
        self.tone.set(gpu, look);
        self.is_transparent = look.is_transparent();
        Ok(())
    }

    /// Whether the picture has an alpha channel.
    pub fn is_transparent(&self) -> bool {
        self.is_transparent
    }

    /// Starts a sample of the view from `camera`: the lightings add their radiance after it.
    pub fn start(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        world: &World,
        camera: &Camera,
        sample: Sample,
    ) {
        let Sample { index, count, before, has_emission } = sample;
        let size = self.seen.size;
        let clip_from_eye = clip_from_eye(camera, size, pixel_offset(index, count));
        let uniform = CameraUniform { clip_from_eye: clip_from_eye.as_mat4(), eye: camera.eye, pad: 0 };
        self.camera.write(gpu, &[uniform]);
        let uniform = SampleUniform {
            eye_from_clip: clip_from_eye.inverse().as_mat4(),
            eye: camera.eye,
            weight: 1.0 / count as f32,
            keep: match before {
                Before::Drop => 0.0,
                Before::Keep => 1.0,
                Before::Average => (count - 1) as f32 / count as f32,
            },
            has_emission: u32::from(has_emission),
            size,
            seed: index,
            pad: [0; 3],
        };
        self.seen.sample.write(gpu, &[uniform]);
        self.surfaces.encode(encoder, timer, &self.surface_group, world);
        self.start.encode(encoder, timer, &self.seen, &self.background);
    }
}
