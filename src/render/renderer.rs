use super::Options;
use super::budget::Quality;
use super::geometry::Geometry;
use super::light_space::LightSpace;
use super::lights::LightSets;
use super::material::Materials;
use super::region_pass::{Assignment, RegionPass, RegionSet};
use super::shade::{ShadePass, ShadeUniform};
use super::shadow::ShadowPass;
use super::surface::{CameraUniform, SurfacePass};
use super::tone::TonePass;
use crate::error::Result;
use crate::gpu::{Gpu, Timer};
use crate::scene::{Camera, Scene};
use bindings::{BindGroups, Buffers};
use glam::Mat4;
use lightcast_core::light::{Light, Regions};
use view::{clip_from_eye, pixel_offset};

pub use output::LightCounts;

mod bindings;
mod live;
mod output;
#[cfg(test)]
pub(super) mod read_back;
mod view;

/// Renders one scene, frame after frame, at one size.
pub struct Renderer {
    gpu: Gpu,
    /// As built; what is allocated follows them.
    options: Options,
    /// What of them the next frame uses.
    quality: Quality,
    scene: Scene,
    world_from_mesh: Vec<Mat4>,
    geometry: Geometry,
    materials: Materials,
    sets: LightSets,
    high: RegionSet,
    low: RegionSet,
    buffers: Buffers,
    region_pass: RegionPass,
    shadow_pass: ShadowPass,
    surface_pass: SurfacePass,
    shade_pass: ShadePass,
    tone_pass: TonePass,
    /// Where pictures that are read back are drawn.
    picture: wgpu::Texture,
    bind_groups: BindGroups,
    timer: Timer,
}

/// Format of pictures that are read back: 8-bit sRGB and alpha.
const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// What becomes of what the picture holds when a sample is added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Before {
    /// It is dropped: the sample starts the picture.
    Drop,
    /// It stays as it is.
    Keep,
    /// It is the mean of all samples before this one.
    Average,
}

impl Renderer {
    /// Puts `scene` on the device, posed as at time 0.
    ///
    /// # Errors
    /// Kind `Usage` for options that the device cannot do; for a scene that it cannot hold; those of the device.
    pub fn new(gpu: Gpu, scene: Scene, options: &Options) -> Result<Self> {
        Self::for_screen(gpu, scene, options, PICTURE_FORMAT)
    }

    /// [`Self::new`], to [`present`](Self::present) on targets of `format`, which must code as sRGB.
    ///
    /// # Errors
    /// As `new`.
    pub fn for_screen(
        gpu: Gpu,
        scene: Scene,
        options: &Options,
        format: wgpu::TextureFormat,
    ) -> Result<Self> {
        let limits = gpu.device.limits();
        options.check(&limits)?;
        let geometry = Geometry::new(&gpu, &scene)?;
        let surface_pass = SurfacePass::new(&gpu, options.width_px, options.height_px);
        let materials = Materials::new(&gpu, &scene)?;
        let shadow_pass = ShadowPass::new(&gpu, options.shadow_map_px, options.tiles_per_side());
        let high = RegionSet::new(&gpu, Regions::for_normals());
        let low = RegionSet::new(&gpu, cone_regions(options.cone_rad));
        let (region_pass, shade_pass) = (RegionPass::new(&gpu), ShadePass::new(&gpu, options.count_lights));
        let buffers = Buffers::new(&gpu, options, &high, &low);
        let sets = LightSets::default();
        let bind_groups = BindGroups::new(
            &gpu,
            &buffers,
            &geometry,
            &high,
            &low,
            &region_pass,
            &shadow_pass,
            &surface_pass,
            &shade_pass,
        );
        let size = [options.width_px, options.height_px];
        let tone_pass = TonePass::new(&gpu, &buffers.radiance, size, format);
        let picture = picture(&gpu, size, format);
        let timer = Timer::new(&gpu);
        let mut renderer = Self {
            gpu,
            options: *options,
            quality: Quality { lights: options.lights, shadow_maps: options.shadow_maps },
            scene,
            world_from_mesh: Vec::new(),
            geometry,
            materials,
            sets,
            high,
            low,
            buffers,
            region_pass,
            shadow_pass,
            surface_pass,
            shade_pass,
            tone_pass,
            picture,
            bind_groups,
            timer,
        };
        renderer.pose(0.0);
        renderer.gpu.check()?;
        Ok(renderer)
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
        &self.scene
    }

    /// Moves the scene to where its animations have it at `time_s`.
    pub fn pose(&mut self, time_s: f64) {
        self.scene.pose(time_s, &mut self.world_from_mesh);
        self.geometry.pose(&self.gpu, &self.scene, &self.world_from_mesh);
    }

    /// The file's camera, or one that shows the whole scene.
    pub fn default_camera(&self) -> Camera {
        let aspect = self.options.width_px as f32 / self.options.height_px as f32;
        self.scene.camera.unwrap_or_else(|| {
            // A ground reaches far beyond what stands on it.
            let framed =
                if self.geometry.casters.is_empty() { self.geometry.all } else { self.geometry.casters };
            Camera::framing(&framed, aspect)
        })
    }

    /// Takes all shadow maps back, as a frame without lights does: which lights have one depends on the lists before.
    pub fn release_shadow_maps(&mut self) {
        self.sets.update(&[], &self.options);
    }

    /// Draws a frame: the mean of `samples` pictures from slightly different points of each pixel.
    ///
    /// # Errors
    /// Those of the device.
    pub fn draw(&mut self, lights: &[Light], camera: &Camera, samples: u32) -> Result<()> {
        self.timer.restart();
        let Quality { lights: most_lights, shadow_maps } = self.quality;
        let options = Options { lights: most_lights, shadow_maps, ..self.options };
        self.prepare(lights, &options);
        for sample in 0..samples.max(1) {
            let before = if sample == 0 { Before::Drop } else { Before::Keep };
            self.sample(camera, sample, samples.max(1), before, true, &options);
            self.pause(sample)?;
        }
        self.gpu.check()
    }

    /// The reference: all `emitters` as lights with hard shadows and shadow maps of their own, added up over as many
    /// passes as that takes. `goes_on` is asked after every pass, with the emitters done so far; when it says no, the
    /// picture is of those. Returns whether it is of all.
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
        let batch = self.options.shadow_maps.max(1);
        let options = Options {
            lights: batch,
            culling: false,
            cone_rad: 0.0,
            soft_samples: 1,
            clusters: None,
            ..self.options
        };
        let mut done = 0;
        // A scene without light still shows what emits by itself.
        for lights in emitters.chunks(batch).chain(emitters.is_empty().then_some(&[][..])) {
            self.timer.restart();
            self.prepare(lights, &options);
            for sample in 0..samples.max(1) {
                let is_first = done == 0;
                let before = if is_first && sample == 0 { Before::Drop } else { Before::Keep };
                self.sample(camera, sample, samples.max(1), before, is_first, &options);
                self.pause(sample)?;
            }
            done += lights.len();
            self.gpu.wait()?;
            if !goes_on(done) && done < emitters.len() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Lets the device catch up after every so many samples: a queue of thousands of passes would fill its memory.
    fn pause(&self, sample: u32) -> Result<()> {
        if sample % 32 == 31 { self.gpu.wait() } else { Ok(()) }
    }

    /// Lights, their regions and shadow maps.
    fn prepare(&mut self, lights: &[Light], options: &Options) {
        let (gpu, buffers) = (&self.gpu, &mut self.buffers);
        self.sets.update(lights, options);
        buffers.lights.write(gpu, &self.sets.lights);
        buffers.tiles.write(gpu, &self.sets.tiles.directions);
        let casters = self.geometry.casters;
        let space = LightSpace::new(&casters, options.shadow_map_px, self.options.tiles_per_side());
        buffers.space.write(gpu, &[space]);
        let (high, low) = self.assignments(options);
        self.high.set(gpu, high);
        self.low.set(gpu, low);
        let words = low.first_word as usize + self.low.regions.count() * low.stride() as usize;
        self.buffers.lists.reserve(gpu, words);
        self.renew_bind_groups();

        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        if options.culling {
            let sets = [(&self.high, &self.bind_groups.high), (&self.low, &self.bind_groups.low)];
            let used = if self.sets.low_count() > 0 { 2 } else { 1 };
            self.region_pass.encode(&mut encoder, &mut self.timer, sets.into_iter().take(used));
        }
        if !casters.is_empty() {
            self.shadow_pass.encode(
                &mut encoder,
                &mut self.timer,
                &self.bind_groups.shadow,
                &self.geometry,
                &self.materials,
                self.sets.tiles.used(),
            );
        }
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Where the lists of both sets lie.
    fn assignments(&self, options: &Options) -> (Assignment, Assignment) {
        let high_count = self.sets.high_count as u32;
        let high =
            Assignment { first_light: 0, light_count: high_count, capacity: high_count, first_word: 0 };
        let low = Assignment {
            first_light: high_count,
            light_count: self.sets.low_count() as u32,
            capacity: options.region_lights.min(self.sets.low_count()) as u32,
            first_word: self.high.regions.count() as u32 * high.stride(),
        };
        (high, low)
    }

    /// One picture of the lights prepared last: the weight of `sample` among `samples` is added to what was there
    /// before.
    fn sample(
        &mut self,
        camera: &Camera,
        sample: u32,
        samples: u32,
        before: Before,
        has_emission: bool,
        options: &Options,
    ) {
        let size = [options.width_px, options.height_px];
        let clip_from_eye = clip_from_eye(camera, size, pixel_offset(sample, samples));
        let uniform = CameraUniform { clip_from_eye: clip_from_eye.as_mat4(), eye: camera.eye, pad: 0 };
        self.buffers.camera.write(&self.gpu, &[uniform]);
        let (high, low) = self.assignments(options);
        let has_low = self.sets.low_count() > 0 && options.culling;
        let shade = ShadeUniform {
            eye_from_clip: clip_from_eye.inverse().as_mat4(),
            eye: camera.eye,
            weight: 1.0 / samples as f32,
            keep: match before {
                Before::Drop => 0.0,
                Before::Keep => 1.0,
                Before::Average => (samples - 1) as f32 / samples as f32,
            },
            pad_0: 0,
            size,
            high_count: high.light_count,
            high_stride: if options.culling { high.stride() } else { 0 },
            low_stride: low.stride(),
            low_first_word: low.first_word,
            table_side: self.high.regions.side(),
            low_table_side: self.low.regions.side(),
            cone_cosine: if has_low { (0.5 * options.cone_rad).cos() as f32 } else { 2.0 },
            soft_samples: options.soft_samples,
            seed: sample,
            has_emission: u32::from(has_emission),
            pad_1: [0; 2],
        };
        self.buffers.shade.write(&self.gpu, &[shade]);
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.surface_pass.encode(
            &mut encoder,
            &mut self.timer,
            &self.bind_groups.surface,
            &self.geometry,
            &self.materials,
        );
        self.shade_pass.encode(&mut encoder, &mut self.timer, &self.bind_groups.shade, size);
        self.timer.resolve(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
    }

    fn renew_bind_groups(&mut self) {
        if self.bind_groups.generations != self.buffers.generations() {
            self.remake_bind_groups();
        }
    }

    fn remake_bind_groups(&mut self) {
        self.bind_groups = BindGroups::new(
            &self.gpu,
            &self.buffers,
            &self.geometry,
            &self.high,
            &self.low,
            &self.region_pass,
            &self.shadow_pass,
            &self.surface_pass,
            &self.shade_pass,
        );
    }
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

/// Regions of set L, for cones of `cone_rad`; without such a set just one.
fn cone_regions(cone_rad: f64) -> Regions {
    if cone_rad > 0.0 { Regions::for_cones(cone_rad) } else { Regions::new(1, 0.0) }
}
