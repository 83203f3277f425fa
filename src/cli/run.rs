use super::messages::PROGRESS;
use super::signals::SignalWatch;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::rt::Shutdown;
use crate::service::{Copies, Output, Pictures, RecordOptions, Service, Summary};
use indicatif::{ProgressBar, ProgressStyle};
use std::fs::File;
use std::io::{self, Write as _};
use std::path::PathBuf;
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
/// Example: lightcast run --config config/replay.toml | jq .error
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Configuration file (TOML); config/replay.toml and config/camera.toml explain every key.
    #[arg(long, short, value_name = "FILE")]
    config: PathBuf,

    /// Write the light lists to this file instead of standard output.
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
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let config = Config::load(&arguments.config)?;
    let shutdown = Shutdown::new();
    let _signals = SignalWatch::start(&shutdown)?;
    let pictures = arguments
        .pictures
        .as_ref()
        .map(|folder| Pictures { folder: folder.clone(), every: arguments.picture_every });
    let recording = arguments
        .record
        .as_ref()
        .map(|folder| RecordOptions { folder: folder.clone(), ..RecordOptions::default() });
    let open_output = || open_output(arguments.output.as_ref());
    let copies = Copies { pictures, recording, ..Copies::default() };
    let service = Service::start(&config, open_output, copies, &shutdown)?;
    watch(service, "lists", Summary::lists_published, |_| ())
}

/// Shows the progress of a service until it ends, then its summary. `count` counts the `things` of its progress; `watch`
/// sees the summary about ten times a second.
pub(super) fn watch(
    service: Service,
    things: &str,
    count: impl Fn(&Summary) -> u64,
    mut watch: impl FnMut(&Summary),
) -> Result<()> {
    let summary = service.summary();
    let bar = PROGRESS.add(progress_bar(service.frame_count(), things));
    let outcome = service.join(PROGRESS_INTERVAL, || {
        bar.set_position(count(&summary));
        watch(&summary);
    });
    bar.finish_and_clear();
    // The summary also tells how far a failed run came.
    let _ = write!(io::stderr(), "{summary}");
    outcome
}

fn open_output(path: Option<&PathBuf>) -> Result<Output> {
    let Some(path) = path else {
        return Ok(Output { writer: Box::new(io::stdout()), name: "standard output".to_owned() });
    };
    let file = File::create(path)
        .map_err(|error| Error::failed("the output file cannot be made").because(error).at(path.display()))?;
    Ok(Output { writer: Box::new(file), name: path.display().to_string() })
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
