//! `render` without --output: the window, from any input.

use super::lists::{Lists, Origin, Reader};
use super::{Arguments, backend, camera, lights_of_map, look, no_reference, options, scene};
use crate::cli::input::Input;
use crate::cli::panorama::{map_shape, read_panorama};
use crate::cli::signals::SignalWatch;
use crate::error::{Error, Result};
use crate::render::budget::BudgetOptions;
use crate::render::{Look, Renderer};
use crate::rt::{Metrics, Shutdown};
use crate::scene::Scene;
use crate::window::{Display, LightSource, Settings};
use lightcast_core::image::PolarMap;
use std::path::Path;

pub(super) fn run(arguments: &Arguments, input: &Input) -> Result<()> {
    no_reference(arguments)?;
    if arguments.look.is_transparent() {
        return Err(Error::usage(
            "a window has nothing behind it to be seen; give --background transparent with --output",
        ));
    }
    let look = look(arguments, input)?;
    let (name, display) = (title(input), Display::open()?);
    let window = Window { arguments, name, look, display, closing: Shutdown::new() };
    let _signals = SignalWatch::start(&window.closing)?;
    match input {
        Input::Panorama(path) => window.show_panorama(path),
        _ => window.show_lists(input),
    }
}

/// The name of a file without its folders; an address as it is.
fn title(input: &Input) -> String {
    let name = input.name();
    match input {
        Input::Server(_) => name,
        _ => Path::new(&name).file_name().and_then(|name| name.to_str()).unwrap_or("lights").to_owned(),
    }
}

/// A window before it is opened.
struct Window<'a> {
    arguments: &'a Arguments,
    name: String,
    look: Look,
    display: Display,
    closing: Shutdown,
}

impl Window<'_> {
    fn show_panorama(self, path: &Path) -> Result<()> {
        let shape = map_shape(self.arguments.resolution, self.arguments.hemisphere)?;
        let map = read_panorama(path, self.arguments.panorama, shape)?;
        let scene = scene(self.arguments)?;
        let lights = lights_of_map(self.arguments, &scene, &map)?;
        self.show(LightSource::Still(lights), scene, map)
    }

    fn show_lists(self, input: &Input) -> Result<()> {
        let origin = Origin::open(self.arguments, input, Reader::Window, &self.closing)?;
        let scene = scene(self.arguments)?;
        let (Lists { link, maps, shape, .. }, making) = origin.start()?;
        let metrics = Metrics::new("window");
        let source = LightSource::Live { lists: link, maps, metrics: metrics.clone() };
        let shown = self.show(source, scene, PolarMap::black(shape));
        let ended = making.finish(metrics);
        shown.and(ended)
    }

    fn show(self, source: LightSource, scene: Scene, map: PolarMap) -> Result<()> {
        let Self { arguments, name, look, display, closing } = self;
        let options = options(arguments)?;
        let budget = arguments.budget.map(|budget_ms| {
            let default = BudgetOptions::default();
            let reserved = &options.directional;
            let most_shadow_maps = reserved.shadow_maps.min(reserved.lights);
            BudgetOptions {
                target_frame_time_ns: (budget_ms * 1e6) as u64,
                least_lights: default.least_lights.min(reserved.lights),
                most_lights: reserved.lights,
                least_shadow_maps: default.least_shadow_maps.min(most_shadow_maps),
                most_shadow_maps,
            }
        });
        let settings = Settings {
            name,
            backend: backend(arguments),
            options,
            samples: arguments.samples.unwrap_or(1),
            budget,
            time_s: arguments.time,
            look,
            map,
        };
        let first_camera = Box::new(|renderer: &Renderer| camera(arguments, renderer));
        display.show(settings, scene, source, first_camera, &closing)
    }
}
