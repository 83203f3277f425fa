use super::messages::PROGRESS;
use super::signals::SignalWatch;
use super::systemd::Watchdog;
use crate::config::Config;
use crate::error::{Error, Kind, Result};
use crate::net::{Board, Server, ServerOptions};
use crate::rt::Shutdown;
use crate::service::{Copies, Output, Pictures, RecordOptions, Service, Summary};
use indicatif::{ProgressBar, ProgressStyle};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// How often the progress bar moves: quick enough to look alive, far slower than frames.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(100);

/// Capture or play what a configuration names and write a light list for every frame.
///
/// Each frame gives one line of JSON: time and place in the sequence, power, error, and every light with its slot,
/// direction, irradiance and spread. Standard error gets progress (on a terminal), every file that could not be
/// read, and a summary at the end: frames, drops, bad frames and times of every stage, the frames that a camera lost,
/// and the pixels that were saturated or invalid.
///
/// Ctrl-C (SIGINT) or SIGTERM ends the run after the frames under way, and all lists written are whole; a second
/// signal ends it at once with exit code 128 + signal. A reader that closes the pipe ends the run too.
///
/// A camera that is unplugged or does not answer is started again until it is back.
///
/// With --listen the lists are also streamed to clients, over WebSockets; http://HOST:PORT/ shows them in a browser. Then
/// SIGHUP takes the configuration anew: if it is bad the old one stays, else the service starts again with it, and
/// clients stay connected (those of a server whose section [server] has changed connect again). Lists then are written only to --output.
///
/// Examples:
///   lightcast run --config config/replay.toml | jq .error
///   lightcast run --config config/stream.toml --listen 127.0.0.1:7300
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Configuration file (TOML); config/replay.toml and config/camera.toml explain every key.
    #[arg(long, short, value_name = "FILE")]
    config: PathBuf,

    /// Write the light lists to this file instead of standard output [default with --listen: nowhere].
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,

    /// Draw maps with their lights into this folder.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,

    /// Draw the first map in every N sequence numbers.
    #[arg(long, value_name = "N", default_value_t = 25, requires = "pictures",
          value_parser = clap::value_parser!(u64).range(1..))]
    picture_every: u64,

    /// Record the frames, as they are captured, into this new folder. A slow disk loses recorded frames, never live
    /// ones.
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,

    /// Stream the lists to clients that connect here. Names of this machine only (127.0.0.1, localhost) keep others out;
    /// [server] in the configuration says who may connect.
    #[arg(long, value_name = "HOST:PORT")]
    listen: Option<String>,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let config = Config::load(&arguments.config)?;
    let shutdown = Shutdown::new();
    let Some(address) = &arguments.listen else {
        let _signals = SignalWatch::start(&shutdown)?;
        let mut output = OutputFile::new(arguments);
        let service = Service::start(
            &config,
            || output.open(),
            copies(arguments, arguments.record.clone(), None),
            &shutdown,
        )?;
        let summary = service.summary();
        return watch(service, &summary, "lists", Summary::lists_published, |_| ());
    };
    let signals = SignalWatch::start_with_hangup(&shutdown)?;
    allow_many_connections();
    let board = Arc::new(Board::default());
    let server = Server::start(address, &board, config.server_options()?, &shutdown)?;
    tracing::info!("listening on http://{}/", server.address());
    let mut serving = Serving {
        arguments,
        signals: &signals,
        shutdown: &shutdown,
        board: &board,
        server: &server,
        output: OutputFile::new(arguments),
        watchdog: Watchdog::new(),
    };
    let served = serving.serve(config);
    serving.watchdog.stopping();
    served.and(server.stop())
}

/// Raises the number of open files, of which every client is one, from the shell's limit to the one that is allowed.
fn allow_many_connections() {
    let limit = getrlimit(Resource::Nofile);
    if let Err(error) = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit }) {
        tracing::warn!("the limit of open files stays at {:?}: {error}", limit.current);
    }
}

/// Pictures, a recording and the clients of a server.
fn copies(arguments: &Arguments, record: Option<PathBuf>, board: Option<&Arc<Board>>) -> Copies {
    let pictures = arguments
        .pictures
        .as_ref()
        .map(|folder| Pictures { folder: folder.clone(), every: arguments.picture_every });
    let recording = record.map(|folder| RecordOptions { folder, ..RecordOptions::default() });
    Copies { pictures, recording, board: board.cloned(), ..Copies::default() }
}

/// A service with a server, whose configuration can be taken anew.
struct Serving<'a> {
    arguments: &'a Arguments,
    signals: &'a SignalWatch,
    shutdown: &'a Shutdown,
    board: &'a Arc<Board>,
    server: &'a Server,
    output: OutputFile<'a>,
    watchdog: Watchdog,
}

impl Serving<'_> {
    /// Runs services until one ends by itself or the program is to end.
    fn serve(&mut self, mut config: Config) -> Result<()> {
        let mut record = self.arguments.record.clone();
        // Until a service has started with the newest configuration, the one before can be gone back to.
        let mut before = None;
        let mut service = self.start(&config, record.clone())?;
        loop {
            let Some(next) = self.run(service)? else { return Ok(()) };
            before = Some(std::mem::replace(&mut config, next.config)).or(before);
            record = self.arguments.record.as_deref().map(next_folder);
            service = match self.start(&config, record.clone()) {
                Ok(service) => {
                    self.server.set_options(next.options);
                    service
                }
                Err(error) => {
                    tracing::error!("the new configuration does not work, back to the one before: {error}");
                    if let Some(before) = before.take() {
                        config = before;
                    }
                    match self.start_as_before(&config, record.clone())? {
                        Some(service) => service,
                        None => return Ok(()),
                    }
                }
            };
        }
    }

    fn start(&mut self, config: &Config, record: Option<PathBuf>) -> Result<(Service, Shutdown)> {
        let ending = Shutdown::new();
        let copies = copies(self.arguments, record, Some(self.board));
        Ok((Service::start(config, || self.output.open(), copies, &ending)?, ending))
    }

    /// Starts with a configuration that has worked: if it does not now, a device is away, and is waited for. `None`: the
    /// program is to end.
    fn start_as_before(
        &mut self,
        config: &Config,
        record: Option<PathBuf>,
    ) -> Result<Option<(Service, Shutdown)>> {
        let mut wait = Duration::from_millis(250);
        loop {
            match self.start(config, record.clone()) {
                Ok(started) => return Ok(Some(started)),
                Err(error) if error.kind() == Kind::Usage => return Err(error),
                Err(error) => tracing::warn!("{error}; trying again in {} s", wait.as_secs_f64()),
            }
            if self.shutdown.wait(wait) {
                return Ok(None);
            }
            wait = (2 * wait).min(LONGEST_WAIT);
        }
    }

    /// Runs one service until its end; what to go on with, if there is anything.
    fn run(&mut self, (service, ending): (Service, Shutdown)) -> Result<Option<Next>> {
        let mut next = None;
        let summary = service.summary().with(self.server.metrics().clone());
        let outcome = watch(service, &summary, "lists", Summary::lists_published, |summary| {
            if next.is_none() {
                self.watchdog.see(summary);
            }
            if self.shutdown.is_aborted() {
                ending.abort();
            } else if self.shutdown.is_requested() {
                ending.request();
            } else if next.is_none() && self.signals.take_hangup() {
                self.watchdog.reloading();
                match self.reload() {
                    Ok(reloaded) => {
                        tracing::info!("{}: taken anew", self.arguments.config.display());
                        next = Some(reloaded);
                        self.watchdog.starts_anew();
                        ending.request();
                    }
                    Err(error) => {
                        tracing::error!("the configuration is not taken, the old one stays: {error}");
                        self.watchdog.stays();
                    }
                }
            }
        });
        match (outcome, next) {
            (outcome, None) => outcome.map(|()| None),
            (Ok(()), next) => Ok(next.filter(|_| !self.shutdown.is_requested())),
            // What has gone wrong before is over with the service that it went wrong in.
            (Err(error), next) => {
                tracing::error!("the service before has ended with an error: {error}");
                Ok(next.filter(|_| !self.shutdown.is_requested()))
            }
        }
    }

    /// The configuration as its file is now, if a service could run with it.
    fn reload(&self) -> Result<Next> {
        let config = Config::load(&self.arguments.config)?;
        let options = config.server_options()?;
        Service::check(&config)?;
        Ok(Next { config, options })
    }
}

/// What a service is started anew with.
struct Next {
    config: Config,
    options: ServerOptions,
}

/// Longest wait between two attempts to start with a configuration that has worked.
const LONGEST_WAIT: Duration = Duration::from_secs(8);

/// Where a service that was started anew records: FOLDER-2, FOLDER-3, ..., the first that is free.
fn next_folder(folder: &Path) -> PathBuf {
    let numbered = |number: u64| {
        let mut name = folder.as_os_str().to_owned();
        name.push(format!("-{number}"));
        PathBuf::from(name)
    };
    (2..).map(numbered).find(|folder| !folder.exists()).expect("numbers do not end before folders do")
}

/// Shows the progress of a service until it ends, then its summary. `count` counts the `things` of its progress; `watch`
/// sees the summary about ten times a second.
pub(super) fn watch(
    service: Service,
    summary: &Summary,
    things: &str,
    count: impl Fn(&Summary) -> u64,
    mut watch: impl FnMut(&Summary),
) -> Result<()> {
    let bar = PROGRESS.add(progress_bar(service.frame_count(), things));
    let outcome = service.join(PROGRESS_INTERVAL, || {
        bar.set_position(count(summary));
        watch(summary);
    });
    bar.finish_and_clear();
    // The summary also tells how far a failed run came.
    let _ = write!(io::stderr(), "{summary}");
    outcome
}

/// Where the lists go: made by the first service that starts, gone on with by those after it.
struct OutputFile<'a> {
    path: Option<&'a Path>,
    /// Lists that clients get are written only where that is asked for.
    is_streamed: bool,
    file: Option<File>,
}

impl<'a> OutputFile<'a> {
    fn new(arguments: &'a Arguments) -> Self {
        Self { path: arguments.output.as_deref(), is_streamed: arguments.listen.is_some(), file: None }
    }

    fn open(&mut self) -> Result<Output> {
        let Some(path) = self.path else {
            return Ok(if self.is_streamed {
                Output { writer: Box::new(io::sink()), name: "nowhere".to_owned() }
            } else {
                Output { writer: Box::new(io::stdout()), name: "standard output".to_owned() }
            });
        };
        let failed = |error: io::Error| {
            Error::failed("the output file cannot be made").because(error).at(path.display())
        };
        let file = match self.file.take() {
            Some(file) => file,
            None => File::create(path).map_err(failed)?,
        };
        let writer = file.try_clone().map_err(failed)?;
        self.file = Some(file);
        Ok(Output { writer: Box::new(writer), name: path.display().to_string() })
    }
}

/// Draws nothing unless standard error is a terminal.
fn progress_bar(count: Option<u64>, things: &str) -> ProgressBar {
    let template = if count.is_some() {
        format!("{{bar:40}} {{pos}}/{{len}} {things}, {{per_sec}}, {{eta}} left")
    } else {
        format!("{{spinner}} {{pos}} {things}, {{per_sec}}, {{elapsed}}")
    };
    let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    match count {
        Some(count) => ProgressBar::new(count),
        None => ProgressBar::new_spinner(),
    }
    .with_style(style)
}
