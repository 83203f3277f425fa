use super::ambient::Ambient;
use super::budget::Quality;
use super::directional::{Directional, DirectionalOptions};
use super::options::{Lightings, Options};
use super::view::{Before, Look, Sample, View};
use super::world::World;
use crate::error::Result;
use crate::gpu::{Gpu, Timer};
use crate::scene::{Camera, Scene};
use lightcast_core::light::Light;

mod live;
mod output;

/// Renders one scene, frame after frame, at one size: a view, and the lightings that add radiance to it.
pub struct Renderer {
    gpu: Gpu,
    /// The options as built; they determine what is allocated.
    options: Options,
    /// The part of them that the next frame uses.
    quality: Quality,
    world: World,
    view: View,
    /// `None`: this lighting adds nothing.
    directional: Option<Directional>,
    ambient: Option<Ambient>,
    /// The render target of pictures that are read back.
    picture: wgpu::Texture,
    timer: Timer,
}

/// Format of pictures that are read back: 8-bit sRGB and alpha.
const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

impl Renderer {
    /// Uploads `scene` to the device, posed as at time 0.
    ///
    /// # Errors
    /// Kind `Usage` for options that the device does not support; for a scene that it cannot hold; those of
    /// the device.
    pub fn new(gpu: Gpu, scene: Scene, options: &Options) -> Result<Self> {
        Self::for_screen(gpu, scene, options, PICTURE_FORMAT)
    }

    /// [`Self::new`], to [`present`](Self::present) on targets of `format`, which must be an sRGB format.
    ///
    /// # Errors
    /// As `new`.
    pub fn for_screen(
        gpu: Gpu,
        scene: Scene,
        options: &Options,
        format: wgpu::TextureFormat,
    ) -> Result<Self> {
        options.check(&gpu.device.limits())?;
        let size = [options.width_px, options.height_px];
        let world = World::new(&gpu, scene)?;
        let view = View::new(&gpu, &world, size, format);
        let Lightings { directional, ambient } = options.lighting;
        let directional =
            directional.then(|| Directional::new(&gpu, &world, &view.seen, &options.directional));
        let ambient = (ambient && options.ground_albedo > 0.0)
            .then(|| Ambient::new(&gpu, &view.seen, options.ground_albedo));
        let picture = picture(&gpu, size, format);
        let timer = Timer::new(&gpu);
        gpu.check()?;
        Ok(Self {
            gpu,
            options: *options,
            quality: Quality {
                lights: options.directional.lights,
                shadow_maps: options.directional.shadow_maps,
            },
            world,
            view,
            directional,
            ambient,
            picture,
            timer,
        })
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Columns and rows of the picture.
    pub fn size(&self) -> [usize; 2] {
        [self.options.width_px as usize, self.options.height_px as usize]
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.world.scene
    }

    /// Poses the scene by its animations at `time_s`.
    pub fn pose(&mut self, time_s: f64) {
        self.world.pose(&self.gpu, time_s);
    }

    /// The file's camera, or one that shows the whole scene.
    pub fn default_camera(&self) -> Camera {
        self.world.default_camera(self.options.width_px as f32 / self.options.height_px as f32)
    }

    /// Sets the look from the next frame on; until the first call it is the default look.
    ///
    /// # Errors
    /// Kind `Usage` for a look that the device does not support.
    pub fn set_look(&mut self, look: &Look) -> Result<()> {
        self.view.set_look(&self.gpu, look)
    }

    /// Releases all shadow maps, as a frame without lights does: which lights have one depends on earlier
    /// lists.
    pub fn release_shadow_maps(&mut self) {
        if let Some(directional) = &mut self.directional {
            directional.release_shadow_maps(&self.options.directional);
        }
    }

    /// Draws a frame: the mean of `samples` pictures from slightly different points of each pixel.
    ///
    /// # Errors
    /// Those of the device.
    pub fn draw(&mut self, lights: &[Light], camera: &Camera, samples: u32) -> Result<()> {
        self.begin(lights);
        let count = samples.max(1);
        for index in 0..count {
            self.sample(camera, nth(index, count));
            self.pause(index)?;
        }
        self.gpu.check()
    }

    /// [`Self::draw`], which asks `goes_on` after every sample; when it returns false, the picture is not
    /// complete. Returns whether it is. It waits for the device as often, so that little of what was asked
    /// for before is still to be drawn.
    ///
    /// # Errors
    /// Those of the device.
    pub fn draw_while(
        &mut self,
        lights: &[Light],
        camera: &Camera,
        samples: u32,
        goes_on: impl Fn() -> bool,
    ) -> Result<bool> {
        self.begin(lights);
        let count = samples.max(1);
        for index in 0..count {
            self.sample(camera, nth(index, count));
            self.gpu.wait()?;
            if !goes_on() && index + 1 < count {
                return Ok(false);
            }
        }
        self.gpu.check().map(|()| true)
    }

    fn begin(&mut self, lights: &[Light]) {
        self.timer.restart();
        let Quality { lights: most_lights, shadow_maps } = self.quality;
        let options = DirectionalOptions { lights: most_lights, shadow_maps, ..self.options.directional };
        self.prepare(lights, &options);
    }

    /// The reference: all `emitters` as lights with hard shadows and their own shadow maps, summed over as
    /// many passes as needed. `goes_on` is called after every pass with the number of emitters done so far;
    /// when it returns false, the picture has only those. Returns whether the picture has all emitters.
    ///
    /// # Errors
    /// Those of the device.
    pub fn draw_reference(
        &mut self,
        emitters: &[Light],
        camera: &Camera,
        samples: u32,
        mut goes_on: impl FnMut(usize) -> bool,
    ) -> Result<bool> {
        let batch = self.options.directional.shadow_maps.max(1);
        let options = DirectionalOptions {
            lights: batch,
            culling: false,
            cone_rad: 0.0,
            soft_samples: 1,
            clusters: None,
            ..self.options.directional
        };
        let count = samples.max(1);
        let mut done = 0;
        // A scene without light still shows emissive surfaces.
        for lights in emitters.chunks(batch).chain(emitters.is_empty().then_some(&[][..])) {
            self.timer.restart();
            self.prepare(lights, &options);
            for index in 0..count {
                let is_first = done == 0;
                let before = if is_first && index == 0 { Before::Drop } else { Before::Keep };
                self.sample(camera, Sample { index, count, before, has_emission: is_first });
                self.pause(index)?;
            }
            done += lights.len();
            self.gpu.wait()?;
            if !goes_on(done) && done < emitters.len() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Waits for the device after a number of samples: a queue of thousands of passes would fill its memory.
    fn pause(&self, sample: u32) -> Result<()> {
        if sample % 32 == 31 { self.gpu.wait() } else { Ok(()) }
    }

    /// Sets the lights of the samples that follow.
    fn prepare(&mut self, lights: &[Light], options: &DirectionalOptions) {
        if let Some(directional) = &mut self.directional {
            directional.prepare(&self.gpu, &mut self.timer, lights, &self.world, options);
        }
        if let Some(ambient) = &mut self.ambient {
            ambient.prepare(&self.gpu, lights);
        }
    }

    /// Adds a sample, under the lights prepared last, to the picture.
    fn sample(&mut self, camera: &Camera, sample: Sample) {
        let (gpu, timer) = (&self.gpu, &mut self.timer);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.view.start(gpu, &mut encoder, timer, &self.world, camera, sample);
        if let Some(directional) = &self.directional {
            directional.shade(&mut encoder, timer, &self.view.seen);
        }
        if let Some(ambient) = &self.ambient {
            ambient.shade(&mut encoder, timer, &self.view.seen);
        }
        timer.resolve(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
    }
}

/// One of the samples of a picture that takes the place of the last one.
fn nth(index: u32, count: u32) -> Sample {
    let before = if index == 0 { Before::Drop } else { Before::Keep };
    Sample { index, count, before, has_emission: true }
}

/// The texture of pictures that are read back.
fn picture(gpu: &Gpu, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

#[cfg(test)]
impl Renderer {
    /// Waits for the frame drawn last: the surfaces of its last sample, and its lights.
    pub(super) fn read_back(
        &self,
    ) -> (super::view::seen_twin::SeenFrame, super::directional::DirectionalFrame) {
        let directional = self.directional.as_ref().expect("the tests that read back have it");
        (self.view.read_back(&self.gpu), directional.read_back(&self.gpu))
    }
}
