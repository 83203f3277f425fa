mod look;
mod stream;
mod values;
mod window;

use super::lights::SamplerName;
use super::panorama::{map_shape, read_panorama};
use super::progress::Progress;
use super::resolution::Resolution;
use super::signals::SignalWatch;
use crate::compare::{self, AnyExtractor, Inversion};
use crate::config::Config;
use crate::error::{Error, Result};
use crate::gpu::{Backend, Gpu};
use crate::render::{self, Options, Renderer, emitters};
use crate::rt::Shutdown;
use crate::rt::stage::{self as stages, Stage};
use crate::scene::{Camera, Scene, Shading};
use crate::service::{Ends, Input as ServiceInput, ListReader, Service};
use crate::stage::{Files, PictureWriter, Render};
use crate::wire::ListFile;
use clap::ValueEnum;
use glam::Vec3;
use lightcast_core::image::PolarMap;
use lightcast_core::light::{Light, LightList};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;
use values::{Input, Target, field_of_view, milliseconds, vector};

pub(super) use stream::run_stream;

/// Render a scene under captured light.
///
/// INPUT is one of
///   a panorama of the whole sphere, OpenEXR or Radiance HDR;
///   light lists, one JSON object a line, as `run` and `lights` write them (.jsonl, .json);
///   a configuration of a sequence, as for `run` (.toml);
///   the address of a server (ws://HOST:PORT); `watch --render` does the same with more to choose.
///
/// The picture goes to a file, .png for people or .exr for linear radiance; for several lists name a folder, which
/// gets frame_NUMBER.png. Without --output a window opens, if there is a display; there lists arrive at their own pace,
/// and the newest is shown. Its keys:
///   drag left, right   turn round the scene, move sideways (Shift and left does that too)
///   wheel              go nearer or away
///   Space              freeze the lights, or let them go on
///   i, t               show or hide the map of the lights, the timings in the title
///   +, -               more or fewer lights, up to --lights
///   r, s, h or F1      back to the first camera, save picture_N.png, print the keys
///   q, Escape          close
///
/// Without --scene it shows a built-in scene. Any Vulkan adapter will do, one in software too.
///
/// Examples:
///   lightcast render garden.hdr --output garden.png --scene bunny.glb --ground
///   lightcast render config/replay.toml --output frames/ --every 10
///   lightcast render config/replay.toml --budget 16
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// A panorama, light lists, a configuration or a server.
    input: PathBuf,

    /// Picture file (.png, .exr), or folder for numbered pictures (made if it does not exist). Default: a window.
    #[arg(long, short, value_name = "FILE|FOLDER")]
    output: Option<PathBuf>,

    /// Window: time that a frame may take; fewer lights and shadow maps than given keep to it.
    #[arg(long, value_name = "MILLISECONDS", conflicts_with = "output", value_parser = milliseconds)]
    budget: Option<f64>,

    /// Scene: glTF (.gltf, .glb), OBJ or PLY. Default: a built-in one.
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,

    /// Put a ground under the scene, which catches shadows.
    #[arg(long, requires = "scene")]
    ground: bool,

    /// Size of the picture.
    #[arg(long, value_name = "COLUMNSxROWS", default_value = "640x480")]
    size: Resolution,

    /// Lights that shine on everything; more join them.
    #[arg(long, value_name = "N", default_value_t = 72)]
    lights: usize,

    /// Lights taken from a panorama for what glossy surfaces mirror (where the scene has any).
    #[arg(long, value_name = "N", default_value_t = 1152)]
    glossy_lights: usize,

    /// How a panorama becomes lights.
    #[arg(long, value_enum, default_value_t = SamplerName::Refined)]
    sampler: SamplerName,

    /// Join lights with similar directions to at most so many.
    #[arg(long, value_name = "N")]
    clusters: Option<usize>,

    /// Shadow maps, for the lights of most power; the others borrow the nearest.
    #[arg(long, value_name = "N", default_value_t = 72)]
    shadow_maps: usize,

    /// Side of a shadow map in texels.
    #[arg(long, value_name = "TEXELS", default_value_t = 256)]
    shadow_map_size: u32,

    /// Comparisons for the edge of a soft shadow; 1: hard shadows.
    #[arg(long, value_name = "N", default_value_t = 8)]
    soft_samples: u32,

    /// Samples of a pixel, for smooth edges [default: 4; in a window 1, more while nothing moves].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    samples: Option<u32>,

    /// Take the upper half of a panorama only.
    #[arg(long)]
    hemisphere: bool,

    /// Size of the polar map that a panorama is averaged to [default: 360x180, with --hemisphere 360x90].
    #[arg(long, value_name = "COLUMNSxROWS")]
    resolution: Option<Resolution>,

    /// Take every pixel of the polar map as a light, with hard shadows: slow, the reference for all else.
    #[arg(long)]
    reference: bool,

    /// Camera: x,y,z of the eye. Default: the scene's own camera, or one that shows all of it.
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    eye: Option<Vec3>,

    /// Camera: x,y,z of what it looks at.
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    target: Option<Vec3>,

    /// Camera: vertical field of view in degrees.
    #[arg(long, value_name = "DEGREES", value_parser = field_of_view)]
    fov: Option<f32>,

    /// Time of the scene's animation in seconds, for a single picture.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    time: f64,

    /// Render the list of the first frame in every N sequence numbers; `run --picture-every N` draws the same frames,
    /// and gives them the same numbers.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    every: u64,

    #[command(flatten)]
    look: look::Look,

    /// Graphics interface. OpenGL is for trials: some of its drivers draw wrong pictures without an error.
    #[arg(long, value_enum, default_value_t = BackendName::Vulkan)]
    backend: BackendName,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum BackendName {
    Vulkan,
    Gl,
}

/// Samples of a pixel in pictures that nobody watches growing better.
const SAMPLES: u32 = 4;

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let Some(output) = &arguments.output else { return window::run(arguments) };
    let target = Target::of(output)?;
    match Input::of(&arguments.input) {
        Input::Panorama => render_panorama(arguments, &target),
        Input::Lists => render_lists(arguments, &target),
        Input::Configuration => render_sequence(arguments, &target),
        Input::Server => stream::render(arguments, &target, stream::server(arguments)?),
    }
}

fn backend(arguments: &Arguments) -> Backend {
    match arguments.backend {
        BackendName::Vulkan => Backend::Vulkan,
        BackendName::Gl => Backend::Gl,
    }
}

fn options(arguments: &Arguments) -> Options {
    let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    Options {
        width_px: side(arguments.size.columns),
        height_px: side(arguments.size.rows),
        lights: arguments.lights,
        shadow_maps: arguments.shadow_maps,
        shadow_map_px: arguments.shadow_map_size,
        soft_samples: arguments.soft_samples,
        clusters: arguments.clusters,
        lighting: arguments.look.lighting(),
        ground_albedo: arguments.look.ground_albedo(),
        ..Options::default()
    }
}

fn renderer(arguments: &Arguments) -> Result<Renderer> {
    let scene = scene(arguments)?;
    let gpu = Gpu::open(&Gpu::instance(backend(arguments)), None)?;
    tracing::info!("{} ({:?}, {})", gpu.info.name, gpu.info.backend, gpu.info.driver_info);
    let mut renderer = Renderer::new(gpu, scene, &options(arguments))?;
    renderer.set_look(&look(arguments)?)?;
    renderer.pose(arguments.time);
    Ok(renderer)
}

fn look(arguments: &Arguments) -> Result<render::Look> {
    let is_panorama = Input::of(&arguments.input) == Input::Panorama;
    arguments.look.of_pictures(is_panorama.then_some(arguments.input.as_path()))
}

fn samples(arguments: &Arguments) -> u32 {
    arguments.samples.unwrap_or(SAMPLES)
}

fn scene(arguments: &Arguments) -> Result<Scene> {
    let mut scene = match &arguments.scene {
        Some(path) => load_scene(path, arguments.ground)?,
        None => Scene::built_in(),
    };
    arguments.look.set_roles(&mut scene)?;
    Ok(scene)
}

/// A scene file, with warnings of what it has that is not shown.
pub(super) fn load_scene(path: &Path, on_ground: bool) -> Result<Scene> {
    let mut scene = Scene::load(path)?;
    for note in &scene.notes {
        tracing::warn!("{}: {note}", path.display());
    }
    if on_ground {
        scene.add_ground();
    }
    Ok(scene)
}

fn camera(arguments: &Arguments, renderer: &Renderer) -> Result<Camera> {
    let mut camera = renderer.default_camera();
    let reach = camera.eye.distance(camera.target);
    camera.eye = arguments.eye.unwrap_or(camera.eye);
    camera.target = arguments.target.unwrap_or(camera.target);
    camera.vertical_fov_rad = arguments.fov.map_or(camera.vertical_fov_rad, f32::to_radians);
    if arguments.eye.is_some() || arguments.target.is_some() {
        let forward = camera.target - camera.eye;
        if forward.length() < 1e-6 * reach {
            return Err(Error::usage(
                "--eye and --target are the same point; a camera has to look somewhere",
            ));
        }
        camera.up = Vec3::Y;
        // Somebody who goes close wants to see it.
        camera.near = 1e-3 * forward.length().min(reach);
    }
    Ok(camera)
}

fn render_panorama(arguments: &Arguments, target: &Target) -> Result<()> {
    let Target::File { path, is_exr } = target else {
        return Err(Error::usage("a panorama gives one picture; name a .png or .exr file").at(target.name()));
    };
    let map = read_panorama(&arguments.input, map_shape(arguments.resolution, arguments.hemisphere)?)?;
    let mut renderer = renderer(arguments)?;
    let camera = camera(arguments, &renderer)?;
    if arguments.reference {
        let lights = emitters(&map);
        let progress = Progress::of(Some(lights.len() as u64), "emitters");
        renderer.draw_reference(&lights, &camera, samples(arguments), |done| {
            progress.set_position(done as u64);
            true
        })?;
        progress.finish();
    } else {
        let lights = lights_of_map(arguments, renderer.scene(), &map)?;
        renderer.draw(&lights, &camera, samples(arguments))?;
    }
    PictureWriter::default().write(&mut renderer, 0.0, path, *is_exr)
}

/// A surface that mirrors anything needs set L.
fn lights_of_map(arguments: &Arguments, scene: &Scene, map: &PolarMap) -> Result<Vec<Light>> {
    let is_glossy = scene.materials.iter().any(|material| match material.shading {
        Shading::MetalRough { .. } => true,
        Shading::Phong { specular, .. } => specular != [0.0; 3],
    });
    let count = if is_glossy { arguments.lights.max(arguments.glossy_lights) } else { arguments.lights };
    let options =
        compare::Options { count, sampler: arguments.sampler.into(), inversion: Inversion::default() };
    let mut list = LightList::default();
    AnyExtractor::new(map.shape, &options)?.extract(map, &mut list);
    Ok(list.lights)
}

fn render_lists(arguments: &Arguments, target: &Target) -> Result<()> {
    no_reference(arguments)?;
    let mut file = ListFile::open(&arguments.input)?;
    let mut renderer = renderer(arguments)?;
    let camera = camera(arguments, &renderer)?;
    let mut list = LightList::default();
    match target {
        Target::File { path, is_exr } => {
            if !file.read(&mut list)? {
                return Err(Error::failed("holds no light list").at(arguments.input.display()));
            }
            renderer.draw(&list.lights, &camera, samples(arguments))?;
            PictureWriter::default().write(&mut renderer, 0.0, path, *is_exr)
        }
        Target::Folder(folder) => {
            let mut render = numbered(arguments, renderer, camera, folder)?;
            let progress = Progress::of(None, "lists");
            while file.read(&mut list)? {
                render.step(&list, &mut ())?;
                progress.inc(1);
            }
            progress.finish();
            Ok(())
        }
    }
}

/// The service makes lists on its threads; this one renders them.
fn render_sequence(arguments: &Arguments, target: &Target) -> Result<()> {
    no_reference(arguments)?;
    let Target::Folder(folder) = target else {
        return Err(Error::usage("a sequence gives many pictures; name a folder").at(target.name()));
    };
    let config = Config::load(&arguments.input)?;
    let shutdown = Shutdown::new();
    let _signals = SignalWatch::start(&shutdown)?;
    let renderer = renderer(arguments)?;
    let camera = camera(arguments, &renderer)?;
    let render = numbered(arguments, renderer, camera, folder)?;
    let input = ServiceInput::open(&config)?;
    let progress = Progress::of(input.frame_count(), "lists");
    let shown = Shown { render, progress: progress.clone() };
    let ends = Ends { readers: vec![ListReader::new("render", shown)], ..Ends::default() };
    let service = Service::start_with(&config, input, ends, &shutdown)?;
    let summary = service.summary();
    let served = service.join(Duration::from_millis(100), || ());
    progress.finish();
    let _ = write!(io::stderr(), "{summary}");
    served
}

/// A stage that shows how far it is.
struct Shown {
    render: Render,
    progress: Progress,
}

impl Stage for Shown {
    type Input = LightList;
    type Output = ();

    fn step(&mut self, list: &LightList, (): &mut ()) -> Result<stages::Flow> {
        self.progress.inc(1 + list.stamp.lost_before);
        self.render.step(list, &mut ())
    }
}

fn numbered(arguments: &Arguments, renderer: Renderer, camera: Camera, folder: &Path) -> Result<Render> {
    std::fs::create_dir_all(folder).map_err(|error| {
        Error::failed("the folder for pictures cannot be made").because(error).at(folder.display())
    })?;
    let files = Files { folder: folder.to_owned(), are_exr: false };
    Ok(Render::new(renderer, camera, samples(arguments), files, arguments.every))
}

fn no_reference(arguments: &Arguments) -> Result<()> {
    if arguments.reference {
        return Err(Error::usage("--reference takes every pixel of a panorama as a light; give a panorama"));
    }
    Ok(())
}
