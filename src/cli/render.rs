mod files;
mod lists;
mod look;
mod values;
mod window;

use super::input::{Input, InputArguments};
use super::lights::SamplerName;
use super::panorama::PanoramaArguments;
use super::resolution::Resolution;
use crate::compare::{self, AnyExtractor, Inversion};
use crate::error::{Error, Result};
use crate::gpu::{Backend, Gpu};
use crate::net::ClientOptions;
use crate::render::{self, DirectionalOptions, Options, Renderer};
use crate::scene::{Camera, Scene, Shading};
use clap::ValueEnum;
use glam::Vec3;
use lightcast_core::image::PolarMap;
use lightcast_core::light::{Light, LightList};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use values::{Target, field_of_view, milliseconds, vector};

/// Render a scene under captured light.
///
/// INPUT is one of
///   a panorama of the whole sphere, OpenEXR or Radiance HDR;
///   light lists, one JSON object a line, as `run` and `lights` write them (.jsonl, .json);
///   a configuration, as for `run` (.toml);
///   the address of a server (ws://HOST:PORT or HOST:PORT); `watch --render` offers more for these;
///   `-`: light lists or a panorama on standard input.
///
/// --output names a file, .png for people or .exr for linear radiance, which gets a picture of the first
/// list; or a folder, which gets frame_NUMBER.png for every list. Without --output a window opens, if there
/// is a display; there lists arrive at their own pace, and the newest is shown. Its keys:
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
///   lightcast lights garden.hdr --lights 300 | lightcast render - --lights 300 --output garden.png
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    #[command(flatten)]
    input: InputArguments,

    /// The request to a server as INPUT, where `watch` gives more than its address.
    #[arg(skip)]
    subscription: Option<ClientOptions>,

    /// Picture file (.png, .exr), or folder for numbered pictures (made if it does not exist). Default: a
    /// window.
    #[arg(long, short, value_name = "FILE|FOLDER")]
    output: Option<PathBuf>,

    /// Window: time that a frame may take; lights and shadow maps are reduced to keep to it.
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

    /// Lights that shine on everything; further lights join them.
    #[arg(long, value_name = "N", default_value_t = 72)]
    lights: usize,

    /// Lights taken from a panorama for reflections in glossy surfaces (where the scene has any).
    #[arg(long, value_name = "N", default_value_t = 1152)]
    glossy_lights: usize,

    /// How a panorama becomes lights.
    #[arg(long, value_enum, default_value_t = SamplerName::Refined)]
    sampler: SamplerName,

    /// Join lights with similar directions into at most this many.
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

    #[command(flatten)]
    panorama: PanoramaArguments,

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

    /// Render the list of the first frame in every N sequence numbers; `run --picture-every N` draws the same
    /// frames, and gives them the same numbers.
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

/// Samples of a pixel in pictures that are not refined on the screen.
const SAMPLES: u32 = 4;

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let target = arguments.output.as_deref().map(Target::of).transpose()?;
    let input = arguments.input.input()?;
    if let Input::Panoramas(_) = &input {
        let why = "name one of the panoramas, or a configuration whose section [source] has the folder or pattern as its path";
        return Err(input.refused("render", why));
    }
    match target {
        None => window::run(arguments, &input),
        Some(target) => files::run(arguments, &input, &target),
    }
}

impl Arguments {
    /// The arguments of `lightcast render INPUT REST...`, with the request to a server; help and wrong
    /// arguments end the program as they do there.
    pub fn of_watch(input: &OsStr, rest: &[OsString], subscription: Option<ClientOptions>) -> Self {
        #[derive(clap::Parser)]
        #[command(name = "lightcast watch INPUT --render")]
        struct Line {
            #[command(flatten)]
            arguments: Arguments,
        }
        let line = [OsStr::new("render"), input].into_iter().chain(rest.iter().map(OsString::as_os_str));
        Self { subscription, ..<Line as clap::Parser>::parse_from(line).arguments }
    }
}

fn backend(arguments: &Arguments) -> Backend {
    match arguments.backend {
        BackendName::Vulkan => Backend::Vulkan,
        BackendName::Gl => Backend::Gl,
    }
}

fn options(arguments: &Arguments) -> Result<Options> {
    let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    Ok(Options {
        width_px: side(arguments.size.columns),
        height_px: side(arguments.size.rows),
        lighting: arguments.look.lighting()?,
        ground_albedo: arguments.look.ground_albedo(),
        directional: DirectionalOptions {
            lights: arguments.lights,
            shadow_maps: arguments.shadow_maps,
            shadow_map_px: arguments.shadow_map_size,
            soft_samples: arguments.soft_samples,
            clusters: arguments.clusters,
            ..DirectionalOptions::default()
        },
    })
}

fn renderer(arguments: &Arguments, input: &Input) -> Result<Renderer> {
    let scene = scene(arguments)?;
    let gpu = Gpu::open(&Gpu::instance(backend(arguments)), None)?;
    tracing::info!("{} ({:?}, {})", gpu.info.name, gpu.info.backend, gpu.info.driver_info);
    let mut renderer = Renderer::new(gpu, scene, &options(arguments)?)?;
    renderer.set_look(&look(arguments, input)?)?;
    renderer.pose(arguments.time);
    Ok(renderer)
}

fn look(arguments: &Arguments, input: &Input) -> Result<render::Look> {
    let panorama = match input {
        Input::Panorama(path) => Some(path.as_path()),
        _ => None,
    };
    arguments.look.of_pictures(panorama, arguments.panorama)
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

/// A scene file, with warnings about its parts that are not shown.
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
        // The near plane is close, so that the scene stays visible from a short distance.
        camera.near = 1e-3 * forward.length().min(reach);
    }
    Ok(camera)
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

fn no_reference(arguments: &Arguments) -> Result<()> {
    if arguments.reference {
        return Err(Error::usage("--reference takes every pixel of a panorama as a light; give a panorama"));
    }
    Ok(())
}
