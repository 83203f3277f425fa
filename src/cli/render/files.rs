//! `render` into files: one picture, or a folder of numbered ones, from any input.

use super::lists::{Origin, Reader};
use super::values::Target;
use super::{Arguments, camera, lights_of_map, no_reference, renderer, samples};
use crate::cli::input::Input;
use crate::cli::panorama::{map_shape, read_panorama};
use crate::cli::progress::Progress;
use crate::cli::run::watch;
use crate::cli::signals::SignalWatch;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::render::emitters;
use crate::rt::stage::{self as stages, Nowhere, Stage};
use crate::rt::{Clock, Metrics, Shutdown};
use crate::service::{Ends, ListReader, Service, Summary};
use crate::stage::{PictureWriter, Render};
use lightcast_core::light::LightList;
use std::path::Path;

/// Name of the stage that renders.
const RENDER: &str = "render";

pub(super) fn run(arguments: &Arguments, input: &Input, target: &Target) -> Result<()> {
    match (input, target) {
        (Input::Panorama(path), _) => render_panorama(arguments, input, path, target),
        (Input::Configuration(path), Target::Folder(folder)) => {
            render_service(arguments, input, path, folder)
        }
        _ => render_lists(arguments, input, target),
    }
}

fn render_panorama(arguments: &Arguments, input: &Input, panorama: &Path, target: &Target) -> Result<()> {
    let shape = map_shape(arguments.resolution, arguments.hemisphere)?;
    let map = read_panorama(panorama, arguments.panorama, shape)?;
    let mut renderer = renderer(arguments, input)?;
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
    match target {
        Target::File { path, is_exr } => PictureWriter::default().write(&mut renderer, 0.0, path, *is_exr),
        Target::Folder(folder) => {
            make(folder)?;
            let path = folder.join("frame_00000.png");
            PictureWriter::default().write(&mut renderer, 0.0, &path, false)
        }
    }
}

/// The renderer is an end of the service that makes the lists.
fn render_service(arguments: &Arguments, input: &Input, path: &Path, folder: &Path) -> Result<()> {
    no_reference(arguments)?;
    let config = Config::load(path)?;
    let shutdown = Shutdown::new();
    let signals = SignalWatch::start(&shutdown)?;
    let renderer = renderer(arguments, input)?;
    let camera = camera(arguments, &renderer)?;
    make(folder)?;
    let (samples, every, interrupted) = (samples(arguments), arguments.every, signals.interrupted());
    let render = Render::new(renderer, camera, samples, folder.to_owned(), every, interrupted);
    let ends = Ends { readers: vec![ListReader::new(RENDER, render)], ..Ends::default() };
    let service = Service::start(&config, ends, &shutdown)?;
    let summary = service.summary();
    let seen = |summary: &Summary| {
        summary.stage(RENDER).map_or(0, |render| render.frames.get() + render.drops.get())
    };
    watch(service, &summary, "lists", seen, |_| ())
}

/// Other threads bring the lists; this one renders them: the first into a file, all into a folder.
fn render_lists(arguments: &Arguments, input: &Input, target: &Target) -> Result<()> {
    no_reference(arguments)?;
    let shutdown = Shutdown::new();
    let origin = Origin::open(arguments, input, Reader::Files, &shutdown)?;
    let signals = SignalWatch::start(&shutdown)?;
    let interrupted = signals.interrupted();
    let mut renderer = renderer(arguments, input)?;
    let camera = camera(arguments, &renderer)?;
    if let Target::Folder(folder) = target {
        make(folder)?;
    }
    let metrics = Metrics::new(RENDER);
    let (lists, making) = origin.start()?;
    let outcome = match target {
        Target::File { path, is_exr } => {
            // It is dropped before waiting for the end, because the threads that make the lists may wait for
            // room in it.
            let mut link = lists.link;
            let no_picture = || Error::failed("interrupted; there is no picture").at(path);
            match link.receive() {
                Some(list) => {
                    metrics.frames.add(1);
                    let goes_on = || !interrupted.is_requested();
                    match renderer.draw_while(&list.lights, &camera, samples(arguments), goes_on) {
                        Ok(true) => PictureWriter::default().write(&mut renderer, 0.0, path, *is_exr),
                        Ok(false) => Err(no_picture()),
                        Err(error) => Err(error),
                    }
                }
                None if interrupted.is_requested() => Err(no_picture()),
                None if shutdown.is_requested() => Ok(()),
                None => Err(Error::failed("gave no light list").at(input.name())),
            }
        }
        Target::Folder(folder) => {
            let progress = Progress::of(lists.count, "lists");
            let (samples, every) = (samples(arguments), arguments.every);
            let render = Render::new(renderer, camera, samples, folder.clone(), every, interrupted);
            let shown = Shown { render, progress: progress.clone() };
            let outcome = stages::run(shown, lists.link, Nowhere, &Clock::real(), &shutdown, &metrics);
            progress.finish();
            outcome.map(|_| ())
        }
    };
    // The reason why there was no list is reported first.
    let ended = making.finish(metrics);
    ended.and(outcome)
}

/// A stage that shows its progress.
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

/// Makes a folder, unless it is there.
fn make(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Error::failed("the folder for pictures cannot be made").because(error).at(folder))
}
