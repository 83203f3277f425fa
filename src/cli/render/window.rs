//! `render` without --output: the window, and the threads that bring lists to it.

use super::stream::{pass_on, server};
use super::values::Input;
use super::{Arguments, backend, camera, lights_of_map, look, no_reference, options, scene};
use crate::cli::panorama::{map_shape, read_panorama};
use crate::cli::signals::SignalWatch;
use crate::config::{Config, Pace};
use crate::error::{Error, Result};
use crate::net::{Client, ClientOptions};
use crate::render::budget::BudgetOptions;
use crate::rt::link::{self, Sender};
use crate::rt::{Clock, Metrics, Shutdown, Threads};
use crate::service::{Ends, Service, Summary};
use crate::window::{Display, Settings, Source};
use crate::wire::ListFile;
use lightcast_core::image::{PolarMap, PolarShape};
use lightcast_core::light::LightList;
use std::ffi::OsStr;
use std::io::{self, Write as _};
use std::time::Duration;

/// Lights below it make the inset show the whole sphere.
const HORIZON: f32 = -1e-3;

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    no_reference(arguments)?;
    let display = Display::open()?;
    let closing = Shutdown::new();
    let _signals = SignalWatch::start(&closing)?;
    match Input::of(&arguments.input) {
        Input::Panorama => show_panorama(arguments, display, &closing),
        Input::Lists => show_lists(arguments, display, &closing),
        Input::Configuration => show_sequence(arguments, display, &closing),
        Input::Server => show_stream(arguments, server(arguments)?, display, &closing),
    }
}

/// [`run`], with lists from a server that is asked for what `options` say.
pub(super) fn run_stream(arguments: &Arguments, options: ClientOptions) -> Result<()> {
    no_reference(arguments)?;
    let display = Display::open()?;
    let closing = Shutdown::new();
    let _signals = SignalWatch::start(&closing)?;
    show_stream(arguments, options, display, &closing)
}

fn show(
    arguments: &Arguments,
    display: Display,
    source: Source,
    scene: crate::scene::Scene,
    map: PolarMap,
    closing: &Shutdown,
) -> Result<()> {
    if arguments.look.is_transparent() {
        return Err(Error::usage(
            "a window has nothing behind it to be seen; give --background transparent with --output",
        ));
    }
    let options = options(arguments);
    let name = arguments.input.file_name().and_then(OsStr::to_str).unwrap_or("lights").to_owned();
    let budget = arguments.budget.map(|budget_ms| {
        let default = BudgetOptions::default();
        let most_shadow_maps = options.shadow_maps.min(options.lights);
        BudgetOptions {
            target_frame_time_ns: (budget_ms * 1e6) as u64,
            least_lights: default.least_lights.min(options.lights),
            most_lights: options.lights,
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
        look: look(arguments)?,
        map,
    };
    let first_camera = Box::new(|renderer: &crate::render::Renderer| camera(arguments, renderer));
    display.show(settings, scene, source, first_camera, closing)
}

fn show_panorama(arguments: &Arguments, display: Display, closing: &Shutdown) -> Result<()> {
    let map = read_panorama(&arguments.input, map_shape(arguments.resolution, arguments.hemisphere)?)?;
    let scene = scene(arguments)?;
    let lights = lights_of_map(arguments, &scene, &map)?;
    show(arguments, display, Source::Still(lights), scene, map, closing)
}

/// A thread of its own reads the lists and passes them on at the times at which they were captured.
fn show_lists(arguments: &Arguments, display: Display, closing: &Shutdown) -> Result<()> {
    let mut file = ListFile::open(&arguments.input)?;
    let mut list = LightList::default();
    if !file.read(&mut list)? {
        return Err(Error::failed("holds no light list").at(arguments.input.display()));
    }
    let is_hemisphere = list.lights.iter().all(|light| light.direction[1] > HORIZON);
    let shape = if is_hemisphere { PolarShape::hemisphere(4, 1) } else { PolarShape::sphere(4, 2) };
    let scene = scene(arguments)?;
    let reading = Shutdown::new();
    let (sender, lists) = link::latest(&reading, LightList::default);
    let mut threads = Threads::new(&reading);
    let end = reading.clone();
    threads.spawn("lists", move || play(file, list, sender, &end))?;
    let metrics = Metrics::new("window");
    let source = Source::Live { lists, maps: None, metrics: metrics.clone() };
    let shown = show(arguments, display, source, scene, PolarMap::black(shape), closing);
    reading.request();
    let read = threads.join(Duration::from_millis(100), || ());
    let (shown_count, skipped) = (metrics.frames.get(), metrics.drops.get());
    tracing::info!("window: {shown_count} lists shown, {skipped} skipped");
    shown.and(read)
}

/// Passes on `list` and all that follow it in `file`, each when as much time has passed as between its capture and that
/// of the first; times that run backwards are not waited for.
fn play(
    mut file: ListFile,
    mut list: LightList,
    mut sender: Sender<LightList>,
    end: &Shutdown,
) -> Result<()> {
    let clock = Clock::real();
    let first_ns = list.stamp.capture_time_ns;
    loop {
        if !clock.wait_until(list.stamp.capture_time_ns.saturating_sub(first_ns), end) {
            return Ok(());
        }
        let sent = sender.take().and_then(|mut copy| {
            copy.copy_from(&list);
            sender.send(copy)
        });
        if sent.is_err() || !file.read(&mut list)? {
            return Ok(());
        }
    }
}

/// The client brings lists on its thread; when the server refuses it, the window closes.
fn show_stream(
    arguments: &Arguments,
    options: ClientOptions,
    display: Display,
    closing: &Shutdown,
) -> Result<()> {
    let scene = scene(arguments)?;
    let (sender, lists) = link::latest(closing, LightList::default);
    let (received, shown_metrics) = (Metrics::new("client"), Metrics::new("window"));
    let client = Client::start(options, &received, closing, pass_on(sender, closing))?;
    let source = Source::Live { lists, maps: None, metrics: shown_metrics.clone() };
    // Nobody knows yet what the server's map is like; a sphere has room for every light.
    let map = PolarMap::black(PolarShape::sphere(4, 2));
    let shown = show(arguments, display, source, scene, map, closing);
    closing.request();
    let served = client.join(Duration::from_millis(100), || ());
    let _ = write!(io::stderr(), "{}", Summary::of(vec![received, shown_metrics]));
    shown.and(served)
}

/// The service makes lists on its threads, at the sequence's own rate whatever the configuration says: nobody could
/// watch them as fast as they can be made.
fn show_sequence(arguments: &Arguments, display: Display, closing: &Shutdown) -> Result<()> {
    let mut config = Config::load(&arguments.input)?;
    config.pace = Pace::RealTime;
    let scene = scene(arguments)?;
    // The service's own: when its sequence ends, the window stays.
    let serving = Shutdown::new();
    let (lists_in, lists) = link::latest(&serving, LightList::default);
    let (maps_in, maps) = link::latest(&serving, || PolarMap::black(config.map));
    let ends = Ends { lists: Some(lists_in), maps: Some(maps_in), ..Ends::default() };
    let service = Service::start(&config, ends, &serving)?;
    let metrics = Metrics::new("window");
    let source = Source::Live { lists, maps: Some(maps), metrics: metrics.clone() };
    let shown = show(arguments, display, source, scene, PolarMap::black(config.map), closing);
    serving.request();
    let summary = service.summary().with(metrics);
    let served = service.join(Duration::from_millis(100), || ());
    let _ = write!(io::stderr(), "{summary}");
    shown.and(served)
}
