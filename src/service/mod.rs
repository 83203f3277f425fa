//! The graph of stages and its supervisor: starting threads from a configuration, ending them, and their
//! metrics.
//!
//! ```text
//! source ──Frame──▶ calibrate ──PolarMap──▶ light ──LightList──▶ filter ──LightList──▶ ends
//!    └──▶ record        ├──▶ (window)                                             ├──▶ publish
//!                       ├──▶ board                                                ├──▶ board
//!                       └──▶ picture ◀────────────────────────────────────────────┼──▶ picture
//!                                                                                 └──▶ renderer, window
//! ```

mod camera;
mod ends;
mod graph;
mod memory;
mod opened_source;
mod prepared;
mod recorder;
mod summary;

pub use ends::{Ends, ListReader, Output, Pictures};
pub use opened_source::OpenedSource;
use prepared::Input;
pub use prepared::{Named, Prepared};
pub use recorder::{RECORD_QUEUE, RecordOptions, RecordSamples};
pub use summary::Summary;

use crate::config::{Config, Links, Pace};
use crate::design::{RateFilter, low_pass};
use crate::error::{Error, Result};
use crate::net::{PostLists, PostMaps};
use crate::rt::link::{self, Item};
use crate::rt::{Counter, Metrics, Shutdown};
use crate::stage;
use graph::{Departure, Graph, Running};
use lightcast_core::image::{Frame, PolarMap};
use lightcast_core::light::ReferencedList;
use lightcast_core::light::{Extractor, LightList};
use lightcast_core::temporal::Taps;
use std::io::Write;
use std::sync::Arc;
use std::time::Duration;

/// Items that a `bounded` link holds: one that is read while the next is made compensates for the jitter of
/// two stages, and another for that of the disk. More would only cost memory, because the slowest stage sets
/// the pace.
const LINK_CAPACITY: usize = 2;

/// Lists that wait for a file that is slower than the service: five seconds at 25 lists a second bridge the
/// delays of disks and of readers of a pipe. Their memory is allocated when they are first needed.
const LIST_QUEUE: usize = 128;

/// A running service.
pub struct Service {
    running: Running,
    frame_count: Option<u64>,
}

impl Service {
    /// Opens everything that `config` and `ends` name, then starts the threads. They end when the sequence
    /// does, on the first error, when `shutdown` is requested, and when no recipient is left, which never
    /// happens where clients are served.
    ///
    /// # Errors
    /// Kind `Usage` for invalid options, with file and line; those of the source when no frame can be read;
    /// those of opening the output; those of the system for threads and folders.
    pub fn start(config: &Config, ends: Ends, shutdown: &Shutdown) -> Result<Self> {
        Self::start_prepared(config, Prepared::new(config)?, ends, shutdown)
    }

    /// As [`Self::start`], with frames from `source` instead of what `config` names.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn start_with(
        config: &Config,
        source: OpenedSource,
        ends: Ends,
        shutdown: &Shutdown,
    ) -> Result<Self> {
        Self::start_prepared(config, Prepared::with(config, source)?, ends, shutdown)
    }

    /// As [`Self::start`], with what was made of `config` before.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn start_prepared(
        config: &Config,
        mut prepared: Prepared,
        ends: Ends,
        shutdown: &Shutdown,
    ) -> Result<Self> {
        let input = prepared.take_input(config)?;
        let frame_count = input.source.frame_count();
        let board = ends.board.clone();
        let running = light_graph(config, input, prepared, ends, shutdown)?.start()?;
        if let Some(board) = &board {
            board.show_stages(running.summary.stages().to_vec());
        }
        Ok(Self { running, frame_count })
    }

    /// Records the source that `config` names, without making lights.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn record(config: &Config, options: &RecordOptions, shutdown: &Shutdown) -> Result<Self> {
        let source = OpenedSource::open(config)?;
        let frame_count = source.frame_count();
        let metrics = Metrics::new("record");
        let record = recorder::recorder(config, options, &source, &metrics)?;
        let link = recorder::recorder_link(options.queue, source.waits(), &metrics, shutdown);
        let mut graph = Graph::new(source.clock(config.pace == Pace::Fast), shutdown);
        let frames = source.add_to(&mut graph).copies(link, 1);
        graph.end(metrics, record, frames, Departure::EndsAll);
        Ok(Self { running: graph.start()?, frame_count })
    }

    /// Calls `each` with the first `count` frames of the source that `config` names, in the calling thread;
    /// with fewer where a sequence ends. The calibration is not used. Requests `shutdown` when it is done.
    ///
    /// # Errors
    /// Those of the source and of `each`; kind `Failed` when `shutdown` was requested before.
    pub fn take_frames(
        config: &Config,
        count: u64,
        shutdown: &Shutdown,
        mut each: impl FnMut(&Frame) -> Result<()>,
    ) -> Result<()> {
        let source = OpenedSource::open(config)?;
        let frame_count = source.frame_count();
        let mut graph = Graph::new(source.clock(config.pace == Pace::Fast), shutdown);
        let link = link::bounded(LINK_CAPACITY, shutdown, Frame::default);
        let mut frames = source.add_to(&mut graph).next(link);
        let running = graph.start()?;
        let mut outcome = Ok(());
        let mut taken = 0;
        while taken < count
            && let Some(frame) = frames.receive()
        {
            taken += 1;
            outcome = each(&frame);
            if outcome.is_err() {
                break;
            }
        }
        // A sequence that ends asks for the end too: then all of its frames have been seen, bad ones too.
        let seen =
            running.summary.stage("source").map_or(0, |source| source.frames.get() + source.bad_frames.get());
        let has_ended = frame_count.is_some_and(|frame_count| seen >= frame_count);
        if outcome.is_ok() && taken < count && shutdown.is_requested() && !has_ended {
            outcome = Err(Error::failed("interrupted before all frames were taken"));
        }
        drop(frames);
        shutdown.request();
        running.join(Duration::from_millis(10), || ()).and(outcome)
    }

    /// Frames that the sequence has, readable or not; `None` when it repeats.
    pub fn frame_count(&self) -> Option<u64> {
        self.frame_count
    }

    /// The metrics of the stages so far; they continue to count while the stages run.
    pub fn summary(&self) -> Summary {
        self.running.summary.clone()
    }

    /// Waits for the end and calls `watch` about every `interval` meanwhile.
    ///
    /// # Errors
    /// The first error in time of any stage.
    pub fn join(self, interval: Duration, watch: impl FnMut()) -> Result<()> {
        self.running.join(interval, watch)
    }
}

/// All stages that make lights of frames, and all recipients of the lights, in the order of the data.
fn light_graph(
    config: &Config,
    input: Input,
    prepared: Prepared,
    mut ends: Ends,
    shutdown: &Shutdown,
) -> Result<Graph> {
    let wants_lists = ends.want_lists();
    let Input { source, frame_to_polar, response, delay_frames } = input;
    let opened = Opened::new(config, &source, &mut ends, shutdown)?;
    let Ends { maps: maps_in, lists: lists_in, board, pictures, readers, .. } = ends;
    // Where clients are served, an end that goes or is slow is its own affair.
    let (waits, departure) = match (&board, config.links) {
        (None, links) => (links == Links::Replay, Departure::EndsAll),
        (Some(_), _) => (false, Departure::IsTold),
    };
    let files = FileLinks { waits, shutdown };
    let black = || PolarMap::black(config.map);
    let epoch = source.epoch();

    let mut graph = Graph::new(source.clock(config.pace == Pace::Fast), shutdown);
    let frames = source.add_to(&mut graph);
    if let Some((metrics, record, link)) = opened.recorder {
        graph.end(metrics, record, frames.copies(link, 1), Departure::IsTold);
    }

    if !wants_lists && maps_in.is_none() {
        return Ok(graph);
    }
    let frames = frames.next(connect(config.links, shutdown, Frame::default));
    let metrics = Metrics::new("calibrate");
    let calibrate = stage::Calibrate::new(frame_to_polar, response, &metrics);
    let maps = graph.stage(metrics, calibrate, frames, black());
    if let Some(maps_in) = maps_in {
        maps.copies((maps_in, ()), 1);
    }
    if let Some(board) = &board {
        let link = maps.copies(link::latest(shutdown, black), 1);
        graph.end(Metrics::new("board-map"), PostMaps(board.clone()), link, Departure::IsTold);
    }
    let picture = pictures.map(|Pictures { folder, every }| {
        // A map waits for its list until the filter outputs it; with less room the maps' stage would block,
        // and with it the list that the map waits for.
        let waiting = u64::from(delay_frames) / every.max(1) + 1;
        let metrics = Metrics::new("picture");
        let link = files.link(LINK_CAPACITY + waiting as usize, metrics.drops.clone(), black);
        let drops = metrics.drops.clone();
        (metrics, stage::Picture::new(maps.copies(link, every), folder, drops))
    });

    if !wants_lists {
        return Ok(graph);
    }
    let maps = maps.next(connect(config.links, shutdown, black));
    let lists =
        graph.stage(Metrics::new("light"), stage::Light(prepared.light), maps, ReferencedList::default());

    let lists = lists.next(connect(config.links, shutdown, ReferencedList::default));
    let filtered =
        graph.stage(Metrics::new("filter"), stage::Filter(prepared.filter), lists, ReferencedList::default());
    if let Some(lists_in) = lists_in {
        filtered.copies((lists_in, ()), 1);
    }
    if let Some(board) = board {
        let metrics = Metrics::new("board");
        let link = match config.links {
            Links::Live => link::lossy(LIST_QUEUE, metrics.drops.clone(), shutdown, ReferencedList::default),
            Links::Replay => link::bounded(LINK_CAPACITY, shutdown, ReferencedList::default),
        };
        graph.end(metrics, PostLists::new(board, epoch), filtered.copies(link, 1), Departure::IsTold);
    }
    if let Some(publish) = opened.publish {
        let metrics = Metrics::new("publish");
        let link = files.link(LIST_QUEUE, metrics.drops.clone(), LightList::default);
        graph.end(metrics, publish, filtered.copies(link, 1), departure);
    }
    if let Some((metrics, picture)) = picture {
        // Most lists have no map to be drawn on: it is the maps without a list that are counted.
        let link = files.link(LIST_QUEUE, Counter::default(), LightList::default);
        graph.end(metrics, picture, filtered.copies(link, 1), departure);
    }
    for ListReader { metrics, stage } in readers {
        let link = connect(if waits { Links::Replay } else { Links::Live }, shutdown, LightList::default);
        graph.end(metrics, stage, filtered.copies(link, 1), departure);
    }
    Ok(graph)
}

type Recorder = (Arc<Metrics>, stage::Record, (link::Sender<Frame>, link::Receiver<Frame>));

/// The ends that can fail, opened and checked before a thread is started.
struct Opened {
    recorder: Option<Recorder>,
    publish: Option<stage::Publish<Box<dyn Write + Send>>>,
}

impl Opened {
    /// The output comes last: a start that fails does not touch an existing file.
    fn new(config: &Config, source: &OpenedSource, ends: &mut Ends, shutdown: &Shutdown) -> Result<Self> {
        let recorder = match &ends.recording {
            None => None,
            Some(options) => {
                let metrics = Metrics::new("record");
                let record = recorder::recorder(config, options, source, &metrics)?;
                // Clients wait for no disk.
                let waits = source.waits() && ends.board.is_none();
                let link = recorder::recorder_link(options.queue, waits, &metrics, shutdown);
                Some((metrics, record, link))
            }
        };
        if let Some(Pictures { folder, .. }) = &ends.pictures {
            std::fs::create_dir_all(folder).map_err(|error| {
                Error::failed("the folder for pictures cannot be made").because(error).at(folder)
            })?;
        }
        let publish = match ends.output.take() {
            None => None,
            Some(Output { name, open }) => Some(stage::Publish::new(open()?, name)),
        };
        Ok(Self { recorder, publish })
    }
}

fn extractor(config: &Config) -> Result<Extractor> {
    Extractor::new(config.map, &config.lights).map_err(|error| config.locate("lights", error))
}

fn filter(config: &Config) -> Result<RateFilter> {
    RateFilter::new(&config.filter).map_err(|error| config.locate("filter", error))
}

/// The filter designs its taps when it gets the first list; impossible requirements are reported before that.
fn taps(config: &Config, source: &OpenedSource) -> Result<Taps> {
    low_pass(source.format().frame_rate_hz, &config.filter).map_err(|error| config.locate("filter", error))
}

/// Links to the stages that write files.
struct FileLinks<'a> {
    /// Whether the service waits for them.
    waits: bool,
    shutdown: &'a Shutdown,
}

impl FileLinks<'_> {
    /// A link of `capacity` items; where the service does not wait, those that do not fit are counted by
    /// `dropped`.
    fn link<T: Item>(
        &self,
        capacity: usize,
        dropped: Counter,
        make: impl FnMut() -> T,
    ) -> (link::Sender<T>, link::Receiver<T>) {
        if self.waits {
            link::bounded(capacity, self.shutdown, make)
        } else {
            link::lossy(capacity, dropped, self.shutdown, make)
        }
    }
}

/// A link of the chain: a live service never waits for its reader, which gets the newest; a replay loses
/// nothing.
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

#[cfg(test)]
mod tests;
