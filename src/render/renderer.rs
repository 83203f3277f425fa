use super::Options;
use super::budget::Quality;
use super::energy;
use super::geometry::Geometry;
use super::light_space::LightSpace;
use super::lights::{GpuLight, LightSets};
use super::material::Materials;
use super::region_pass::{Assignment, RegionPass, RegionSet};
use super::shade::{ShadePass, ShadeUniform};
use super::shadow::ShadowPass;
use super::surface::{CameraUniform, SurfacePass};
use super::tone::TonePass;
use crate::error::Result;
use crate::gpu::{Array, Gpu, PassTimes, Timer, read_buffer, read_texture};
use crate::light::{Light, Regions};
use crate::sampling::halton;
use crate::scene::{Camera, Scene};
use glam::dcamera::rh;
use glam::{DMat4, DVec3, Mat4};

mod live;
#[cfg(test)]
pub(super) mod read_back;

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

/// What pixels have looked at since the counts were last read, in all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightCounts {
    /// Pixels that show a surface.
    pub pixels: u32,
    /// Lights that they looked at.
    pub looked_at: u32,
    /// Lights that stand above their horizon, for which they looked into a shadow map.
    pub shaded: u32,
}

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

struct Buffers {
    camera: Array<CameraUniform>,
    space: Array<LightSpace>,
    lights: Array<GpuLight>,
    tiles: Array<[f32; 4]>,
    tables: Array<u32>,
    lists: Array<u32>,
    shade: Array<ShadeUniform>,
    energies: Array<f32>,
    radiance: Array<[f32; 4]>,
    counts: Array<u32>,
}

struct BindGroups {
    /// Generations of the buffers that can grow, when these were made.
    generations: [u64; 2],
    high: wgpu::BindGroup,
    low: wgpu::BindGroup,
    shadow: wgpu::BindGroup,
    surface: wgpu::BindGroup,
    shade: wgpu::BindGroup,
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
    /// passes as that takes. `progress` is called with the emitters done so far.
    ///
    /// # Errors
    /// Those of the device.
    pub fn draw_reference(
        &mut self,
        emitters: &[Light],
        camera: &Camera,
        samples: u32,
        mut progress: impl FnMut(usize),
    ) -> Result<()> {
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
            progress(done);
        }
        Ok(())
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

    /// Maps the frame drawn last to `target`, `elapsed_s` after the one before: the exposure follows what is seen in
    /// about half a second.
    ///
    /// # Errors
    /// Those of the device.
    pub fn present(&mut self, target: &wgpu::TextureView, elapsed_s: f64) -> Result<()> {
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.tone_pass.encode(&self.gpu, &mut encoder, &mut self.timer, target, elapsed_s);
        self.timer.resolve(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.check()
    }

    /// [`Self::present`] into memory: 8-bit sRGB for every pixel, row-major from the top.
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_picture(&mut self, elapsed_s: f64, rgb8: &mut Vec<u8>) -> Result<()> {
        let view = self.picture.create_view(&wgpu::TextureViewDescriptor::default());
        self.present(&view, elapsed_s)?;
        let mut texels: Vec<[u8; 4]> = Vec::new();
        read_texture(&self.gpu, &self.picture, &mut texels)?;
        rgb8.clear();
        let is_bgra = self.picture.format() == wgpu::TextureFormat::Bgra8UnormSrgb;
        let places = if is_bgra { [2, 1, 0] } else { [0, 1, 2] };
        rgb8.extend(texels.iter().flat_map(|texel| places.map(|place| texel[place])));
        Ok(())
    }

    /// The picture as radiance: for every pixel, row-major from the top, linear RGB and the share of it that shows a
    /// surface (colours are not divided by it).
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_radiance(&self, pixels: &mut Vec<[f32; 4]>) -> Result<()> {
        read_buffer(&self.gpu, self.buffers.radiance.buffer(), self.options.pixels(), pixels)
    }

    /// What pixels looked at since the last call; zeros unless the options ask for counts.
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_counts(&mut self) -> Result<LightCounts> {
        if !self.shade_pass.counts() {
            return Ok(LightCounts::default());
        }
        let mut counts = Vec::new();
        read_buffer(&self.gpu, self.buffers.counts.buffer(), 3, &mut counts)?;
        self.buffers.counts.write(&self.gpu, &[0; 3]);
        Ok(LightCounts { pixels: counts[0], looked_at: counts[1], shaded: counts[2] })
    }

    /// Waits for the frame drawn last: GPU time of its passes, of the first 64 of them, empty where the adapter does not
    /// measure.
    ///
    /// # Errors
    /// Those of the device.
    pub fn read_times(&mut self) -> Result<PassTimes> {
        self.timer.read(&self.gpu)
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

/// Where in the pixel a sample looks, from its middle: points of Halton's sequence, the middle alone for one.
fn pixel_offset(sample: u32, samples: u32) -> [f64; 2] {
    if samples == 1 {
        return [0.0; 2];
    }
    [2, 3].map(|base| halton(u64::from(sample) + 1, base) - 0.5)
}

/// From places relative to the eye, along the axes of the world, so that scenes far from the origin keep their digits.
/// Reversed depth without a far plane; `offset_px` moves what is seen by parts of a pixel.
fn clip_from_eye(camera: &Camera, [width, height]: [u32; 2], offset_px: [f64; 2]) -> DMat4 {
    let aspect = f64::from(width) / f64::from(height);
    let clip_from_view = rh::proj::directx::perspective_infinite_reverse(
        f64::from(camera.vertical_fov_rad),
        aspect,
        f64::from(camera.near),
    );
    let offset =
        DVec3::new(2.0 * offset_px[0] / f64::from(width), 2.0 * offset_px[1] / f64::from(height), 0.0);
    DMat4::from_translation(offset) * clip_from_view * DMat4::from_mat3(camera.view_from_world().as_dmat3())
}

impl Buffers {
    fn new(gpu: &Gpu, options: &Options, high: &RegionSet, low: &RegionSet) -> Self {
        use wgpu::BufferUsages as Usage;
        let mut tables = Array::new(gpu, "region tables", Usage::STORAGE, 1);
        tables.write(gpu, &[high.regions.table(), low.regions.table()].concat());
        let mut energies =
            Array::new(gpu, "directional albedos", Usage::STORAGE, energy::SIDE * energy::SIDE);
        energies.write(gpu, &energy::table());
        Self {
            camera: Array::new(gpu, "camera", Usage::UNIFORM, 1),
            space: Array::new(gpu, "light space", Usage::UNIFORM | Usage::COPY_SRC, 1),
            lights: Array::new(gpu, "lights", Usage::STORAGE, options.lights),
            tiles: Array::new(gpu, "tiles", Usage::STORAGE, options.shadow_maps),
            tables,
            lists: Array::new(gpu, "region lists", Usage::STORAGE | Usage::COPY_SRC, 1),
            shade: Array::new(gpu, "shade", Usage::UNIFORM | Usage::COPY_SRC, 1),
            energies,
            radiance: Array::new(gpu, "radiance", Usage::STORAGE | Usage::COPY_SRC, options.pixels()),
            counts: Array::new(gpu, "counts", Usage::STORAGE | Usage::COPY_SRC, 3),
        }
    }

    /// Of the buffers whose length follows the list of lights.
    fn generations(&self) -> [u64; 2] {
        [self.lights.generation(), self.lists.generation()]
    }
}

impl BindGroups {
    #[expect(clippy::too_many_arguments, reason = "all that a renderer has, before there is one")]
    fn new(
        gpu: &Gpu,
        buffers: &Buffers,
        geometry: &Geometry,
        high: &RegionSet,
        low: &RegionSet,
        region_pass: &RegionPass,
        shadow_pass: &ShadowPass,
        surface_pass: &SurfacePass,
        shade_pass: &ShadePass,
    ) -> Self {
        let [depths, normals, reflectances] = surface_pass.views().map(wgpu::BindingResource::TextureView);
        Self {
            generations: buffers.generations(),
            high: region_pass.bind_group(gpu, high, &buffers.lights, &buffers.lists),
            low: region_pass.bind_group(gpu, low, &buffers.lights, &buffers.lists),
            shadow: shadow_pass.bind_group(gpu, &buffers.space, &buffers.tiles, &geometry.instances),
            surface: surface_pass.bind_group(gpu, &buffers.camera, &geometry.instances),
            shade: shade_pass.bind_group(
                gpu,
                [
                    buffers.shade.binding(),
                    buffers.space.binding(),
                    buffers.lights.binding(),
                    buffers.tiles.binding(),
                    buffers.tables.binding(),
                    buffers.lists.binding(),
                    wgpu::BindingResource::TextureView(&shadow_pass.atlas_view),
                    depths,
                    normals,
                    reflectances,
                    buffers.energies.binding(),
                    buffers.radiance.binding(),
                    buffers.counts.binding(),
                ],
            ),
        }
    }
}
