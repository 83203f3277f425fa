mod output_file;
mod reload;
mod serving;
mod systemd;

use super::input::ConfigurationArguments;
use super::messages::{METRICS, print};
use super::progress::Progress;
use super::signals::SignalWatch;
use crate::config::Config;
use crate::error::Result;
use crate::net::{Board, Server};
use crate::rt::{Shutdown, handle_limit, raise_handle_limit};
use crate::service::{Ends, Output, Pictures, RecordOptions, Service, Summary};
use output_file::OutputFile;
use serving::Serving;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use systemd::Watchdog;

/// How often the progress is updated: often enough to look alive, far less often than frames come.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(100);

/// Capture or play what a configuration names and write a light list for every frame.
///
/// Each frame gives one line of JSON: time and place in the sequence, power, error, and every light with its
/// slot, direction, irradiance and spread. Standard error gets progress, every file that could not be read,
/// and a summary at the end: frames, drops, bad frames and times of every stage, the frames that a camera
/// lost, and the pixels that were saturated or invalid.
///
/// Ctrl-C (SIGINT) or SIGTERM ends the run after the frames in progress, and all lists written are complete;
/// a second signal ends it at once with exit code 128 + signal. A reader that closes the pipe ends the run
/// too, unless clients are served.
///
/// A camera that is unplugged or does not answer is started again until it is back.
///
/// With --listen the lists are also streamed to clients, over WebSockets; http://HOST:PORT/ shows them in a
/// browser. Then SIGHUP reloads the configuration: if it is invalid the old one stays, and if it, its
/// calibration and the files of its sequence are as before, the service goes on; otherwise it restarts with
/// it, and clients stay connected (those of a server whose section [server] has changed reconnect). Lists
/// then are written only to --output; a full disk ends that output, or the pictures, and nothing else.
///
/// Examples:
///   lightcast run config/replay.toml | jq .error
///   lightcast run config/stream.toml --listen 127.0.0.1:7300
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    #[command(flatten)]
    pub config: ConfigurationArguments,

    /// Append the light lists to this file instead of standard output [default with --listen: nowhere]. With
    /// --listen, or a camera, a slow reader of it loses lists, which are counted, and holds nobody up; with
    /// --listen, SIGHUP opens it anew, after logs were rotated. Two programs cannot write to one file.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,

    /// Draw maps with their lights into this folder; with --listen, or a camera, those that there is time
    /// for.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,

    /// Draw the first map in every N sequence numbers; a picture has the number of the list that is drawn on
    /// it.
    #[arg(long, value_name = "N", default_value_t = 25, requires = "pictures",
          value_parser = clap::value_parser!(u64).range(1..))]
    picture_every: u64,

    /// Record the frames, as they are captured, into this new folder. A slow disk loses recorded frames,
    /// never live ones.
    #[arg(long, value_name = "DIR")]
    pub record: Option<PathBuf>,

    /// Stream the lists to clients that connect here. Names of this machine only (127.0.0.1, localhost) keep
    /// others out; [server] in the configuration says who may connect.
    #[arg(long, value_name = "HOST:PORT")]
    listen: Option<String>,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    arguments.config.check("run")?;
    let config = Config::load(arguments.config.path())?;
    allow_many_files();
    let shutdown = Shutdown::new();
    let Some(address) = &arguments.listen else {
        let _signals = SignalWatch::start(&shutdown)?;
        let output = OutputFile::new(arguments.output.as_deref(), false);
        let ends = ends(arguments, arguments.record.clone(), output.output(&shutdown), None);
        let service = Service::start(&config, ends, &shutdown)?;
        let summary = service.summary();
        return watch(service, &summary, "lists", Summary::lists_made, |_| ());
    };
    let signals = SignalWatch::start_with_hangup(&shutdown)?;
    let board = Arc::new(Board::default());
    board.show_always(METRICS.clone());
    let server = Server::start(address, &board, config.server_options()?, &shutdown)?;
    tracing::info!("listening on http://{}/", server.address());
    let served = Serving {
        arguments,
        signals: &signals,
        shutdown: &shutdown,
        board: &board,
        server: &server,
        output: OutputFile::new(arguments.output.as_deref(), true),
        watchdog: Watchdog::new(),
    }
    .serve(config);
    served.and(server.stop())
}

/// Allows as many open files as the machine does: every client is one, and files of frames come and go.
pub(super) fn allow_many_files() {
    if let Err(error) = raise_handle_limit() {
        tracing::warn!("the limit of open files stays at {:?}: {error}", handle_limit());
    }
}

/// The recipients of a service's results: files, a recording and the clients of a server.
pub(super) fn ends(
    arguments: &Arguments,
    record: Option<PathBuf>,
    output: Option<Output>,
    board: Option<&Arc<Board>>,
) -> Ends {
    let pictures = arguments
        .pictures
        .as_ref()
        .map(|folder| Pictures { folder: folder.clone(), every: arguments.picture_every });
    let recording = record.map(|folder| RecordOptions { folder, ..RecordOptions::default() });
    Ends { pictures, recording, output, board: board.cloned(), ..Ends::default() }
}

/// Shows the progress of a service until it ends, then its summary. `count` counts the `things` of its
/// progress; `watch` sees the summary about ten times a second.
pub(super) fn watch(
    service: Service,
    summary: &Summary,
    things: &'static str,
    count: impl Fn(&Summary) -> u64,
    mut watch: impl FnMut(&Summary),
) -> Result<()> {
    let progress = Progress::of(service.frame_count(), things);
    let outcome = service.join(PROGRESS_INTERVAL, || {
        progress.set_position(count(summary));
        watch(summary);
    });
    progress.finish();
    // The summary also tells how far a failed run came.
    print(&summary.to_string());
    outcome
}
