//! The graph of stages and its supervisor: threads from a configuration, their end, and what they have done.
//!
//! ```text
//! source ──Frame──▶ calibrate ──PolarMap──▶ light ──LightList──▶ filter ──LightList──▶ publish
//!    └──Frame──▶ record                       ├──PolarMap──▶ picture ◀──LightList────────┤
//!                                             └──PolarMap──▶ (board) ◀──LightList────────┘
//! ```

mod camera;
mod graph;
mod input;
mod recorder;
mod summary;

pub use input::Input;
pub use recorder::{RECORD_QUEUE, RecordOptions, RecordSamples};
pub use summary::Summary;

use crate::config::{self, Config, Links, Pace};
use crate::design::{RateFilter, low_pass};
use crate::error::{Error, Result};
use crate::light::{Extractor, LightList};
use crate::net::Board;
use crate::rt::link::{self, Item};
use crate::rt::stage::Nowhere;
use crate::rt::{Metrics, Shutdown};
use crate::stage;
use graph::Graph;
use lightcast_core::image::{Frame, PolarMap};
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Items that a `bounded` link holds: one to take while the next is made evens out the jitter of two stages, and
/// another that of the disk. More would only cost memory, the slowest stage sets the pace.
const LINK_CAPACITY: usize = 2;

/// Where the light lists go.
pub struct Output {
    /// Takes JSON lines.
    pub writer: Box<dyn Write + Send>,
    /// What messages call it: a path, or "standard output".
    pub name: String,
}

/// Pictures of some maps with their lights. Drawing is slow; in a replay it holds up `light` and `publish`, whose times
/// then show it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pictures {
    /// Where they go; made if it does not exist.
    pub folder: PathBuf,
    /// The first map in every so many sequence numbers is drawn; at least 1.
    pub every: u64,
}

/// A running service.
pub struct Service {
    graph: Graph,
    frame_count: Option<u64>,
}

impl Service {
    /// Opens everything that `config` names, then the output, so that a start that fails leaves an old output file
    /// alone; then starts the threads. They end when the sequence does, on the first error, and when `shutdown` is
    /// requested. Copies of what it makes go to `copies`.
    ///
    /// # Errors
    /// Kind `Usage` for options that do not work, with file and line; those of the source when no frame can be
    /// read; those of `open_output`; those of the system for threads and folders.
    pub fn start(
        config: &Config,
        open_output: impl FnOnce() -> Result<Output>,
        copies: Copies,
        shutdown: &Shutdown,
    ) -> Result<Self> {
        Self::start_with(config, Input::open(config)?, open_output, copies, shutdown)
    }

    /// As [`Self::start`], with frames from `input` and not from what `config` names.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn start_with(
        config: &Config,
        input: Input,
        open_output: impl FnOnce() -> Result<Output>,
        copies: Copies,
        shutdown: &Shutdown,
    ) -> Result<Self> {
        let format = *input.format();
        let frame_count = input.frame_count();
        let (frame_to_polar, response) = camera::frame_to_polar(config, &format, input.name())?;
        let extractor =
            Extractor::new(config.map, &config.lights).map_err(|error| config.locate("lights", error))?;
        let filter = RateFilter::new(&config.filter).map_err(|error| config.locate("filter", error))?;
        // The filter designs its taps when it sees the first list; what no taps can do is told before.
        let taps =
            low_pass(format.frame_rate_hz, &config.filter).map_err(|error| config.locate("filter", error))?;
        let Copies { pictures, recording, lists: list_copies, maps: map_copies, board } = copies;
        let recording = match &recording {
            Some(options) => Some(recorder::recorder(config, options, &input, shutdown)?),
            None => None,
        };
        let output = open_output()?;

        let [calibrate_metrics, light_metrics, filter_metrics, publish_metrics] =
            ["calibrate", "light", "filter", "publish"].map(Metrics::new);
        let mut graph = Graph::new(input.clock(config.pace == Pace::Fast), shutdown);
        let black = || PolarMap::black(config.map);

        let mut map_taps: Vec<_> = map_copies.into_iter().map(|maps| stage::MapTap::new(maps, 1)).collect();
        let list_tap = match &pictures {
            None => None,
            Some(pictures) => {
                std::fs::create_dir_all(&pictures.folder).map_err(|error| {
                    Error::failed("the folder for pictures cannot be made")
                        .because(error)
                        .at(pictures.folder.display())
                })?;
                // A map waits for its list until the filter lets it out; fewer places would stop the light stage,
                // and with it the list that the map waits for.
                let waiting = u64::from(taps.delay_frames()) / pictures.every.max(1) + 1;
                let (maps_in, maps_out) = link::bounded(LINK_CAPACITY + waiting as usize, shutdown, black);
                let (lists_in, lists_out) = link::bounded(LINK_CAPACITY, shutdown, LightList::default);
                let picture = stage::Picture::new(lists_out, pictures.folder.clone());
                graph.spawn(Metrics::new("picture"), picture, maps_out, Nowhere)?;
                map_taps.push(stage::MapTap::new(maps_in, pictures.every));
                Some(stage::ListTap::new(lists_in, pictures.every))
            }
        };

        let (frames_in, frames_out) = connect(config.links, shutdown, Frame::default);
        let (maps_in, maps_out) = connect(config.links, shutdown, black);
        let (lists_in, lists_out) = connect(config.links, shutdown, LightList::default);
        let (filtered_in, filtered_out) = connect(config.links, shutdown, LightList::default);

        let mut publish = stage::Publish::new(output.writer, output.name, list_tap, list_copies);
        if let Some(board) = &board {
            publish = publish.with_board(board.clone(), input.epoch());
        }
        graph.spawn(publish_metrics, publish, filtered_out, Nowhere)?;
        graph.spawn(filter_metrics, stage::Filter(filter), lists_out, filtered_in)?;
        graph.spawn(
            light_metrics,
            stage::Light::new(extractor, map_taps, board.clone()),
            maps_out,
            lists_in,
        )?;
        let calibrate = stage::Calibrate::new(frame_to_polar, response, &calibrate_metrics);
        graph.spawn(calibrate_metrics, calibrate, frames_out, maps_in)?;
        let recorder = match recording {
            Some((record, frames, recorder, metrics)) => {
                recorder::spawn(&mut graph, (record, frames, metrics), false)?;
                Some(recorder)
            }
            None => None,
        };
        input.spawn(&mut graph, stage::Tee::new(Some(frames_in), recorder))?;
        if let Some(board) = &board {
            board.show_stages(graph.summary().stages().to_vec());
        }
        Ok(Self { graph, frame_count })
    }

    /// Whether a service with this configuration would start, as far as that can be told while another one has the
    /// camera: what only the camera knows shows when it is opened.
    ///
    /// # Errors
    /// Those of [`Self::start`].
    pub fn check(config: &Config) -> Result<()> {
        Extractor::new(config.map, &config.lights).map_err(|error| config.locate("lights", error))?;
        RateFilter::new(&config.filter).map_err(|error| config.locate("filter", error))?;
        camera::calibration(config)?;
        if matches!(config.source, config::Source::Sequence(_)) {
            let input = Input::open(config)?;
            camera::frame_to_polar(config, input.format(), input.name())?;
            low_pass(input.format().frame_rate_hz, &config.filter)
                .map_err(|error| config.locate("filter", error))?;
        }
        Ok(())
    }

    /// Records what `config` names and makes no lights of it.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn record(config: &Config, options: &RecordOptions, shutdown: &Shutdown) -> Result<Self> {
        let input = Input::open(config)?;
        let frame_count = input.frame_count();
        let mut graph = Graph::new(input.clock(config.pace == Pace::Fast), shutdown);
        let (record, frames, recorder, metrics) = recorder::recorder(config, options, &input, shutdown)?;
        recorder::spawn(&mut graph, (record, frames, metrics), true)?;
        input.spawn(&mut graph, stage::Tee::new(None, Some(recorder)))?;
        Ok(Self { graph, frame_count })
    }

    /// Gives the first `count` frames of what `config` names to `each`, in the calling thread; fewer where a sequence
    /// ends. Their meaning is not looked at. Requests `shutdown` when it is done.
    ///
    /// # Errors
    /// Those of the source and of `each`; kind `Failed` when `shutdown` was requested before.
    pub fn take_frames(
        config: &Config,
        count: u64,
        shutdown: &Shutdown,
        mut each: impl FnMut(&Frame) -> Result<()>,
    ) -> Result<()> {
        let input = Input::open(config)?;
        let mut graph = Graph::new(input.clock(config.pace == Pace::Fast), shutdown);
        let (frames_in, mut frames_out) = link::bounded(LINK_CAPACITY, shutdown, Frame::default);
        input.spawn(&mut graph, stage::Tee::new(Some(frames_in), None))?;
        let mut outcome = Ok(());
        for _ in 0..count {
            let Some(frame) = frames_out.receive() else { break };
            outcome = each(&frame);
            if outcome.is_err() {
                break;
            }
        }
        if outcome.is_ok() && shutdown.is_requested() {
            outcome = Err(Error::failed("interrupted before all frames were taken"));
        }
        drop(frames_out);
        shutdown.request();
        graph.join(Duration::from_millis(10), || ()).and(outcome)
    }

    /// Frames that the sequence has, readable or not; `None` when it repeats.
    pub fn frame_count(&self) -> Option<u64> {
        self.frame_count
    }

    /// What the stages have done so far; it goes on counting while they run.
    pub fn summary(&self) -> Summary {
        self.graph.summary()
    }

    /// Waits for the end and calls `watch` about every `interval` meanwhile.
    ///
    /// # Errors
    /// The first error in time of any stage.
    pub fn join(self, interval: Duration, watch: impl FnMut()) -> Result<()> {
        self.graph.join(interval, watch)
    }
}

/// Who else gets what a service captures and makes.
#[derive(Default)]
pub struct Copies {
    /// Pictures of maps with their lights.
    pub pictures: Option<Pictures>,
    /// The frames as they are captured. Its failure, by a full disk say, ends it alone, and is told in the end.
    pub recording: Option<RecordOptions>,
    /// All lists, for a renderer, say; [`list_link`] makes such a link.
    pub lists: Option<link::Sender<LightList>>,
    /// All maps that lights are made of, for a view of them. A link that is not `latest` holds up the service.
    pub maps: Option<link::Sender<PolarMap>>,
    /// All lists and the newest map, for the clients of a server.
    pub board: Option<Arc<Board>>,
}

/// A link for copies of the lists that a service publishes: a live service never waits for its reader, who gets the
/// newest; a replay loses nothing.
pub fn list_link(
    config: &Config,
    shutdown: &Shutdown,
) -> (link::Sender<LightList>, link::Receiver<LightList>) {
    connect(config.links, shutdown, LightList::default)
}

fn connect<T: Item>(
    links: Links,
    shutdown: &Shutdown,
    make: impl FnMut() -> T,
) -> (link::Sender<T>, link::Receiver<T>) {
    match links {
        Links::Live => link::latest(shutdown, make),
        Links::Replay => link::bounded(LINK_CAPACITY, shutdown, make),
    }
}
