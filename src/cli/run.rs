use super::messages::PROGRESS;
use super::signals::SignalWatch;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::rt::Shutdown;
use crate::service::{Copies, Output, Pictures, Service};
use indicatif::{ProgressBar, ProgressStyle};
use std::fs::File;
use std::io::{self, Write as _};
use std::path::PathBuf;
use std::time::Duration;

/// How often the progress bar moves: quick enough to look alive, far slower than frames.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(100);

/// Play what a configuration names and write a light list for every frame.
///
/// Each frame gives one line of JSON: time and place in the sequence, power, error, and every light with its slot,
/// direction, irradiance and spread. Standard error gets progress (on a terminal), every file that could not be
/// read, and a summary at the end: frames, drops, bad frames and times of every stage, and the pixels that were
/// saturated or invalid.
///
/// Ctrl-C (SIGINT) or SIGTERM ends the run after the frames under way, and all lists written are whole; a second
/// signal ends it at once with exit code 128 + signal. A reader that closes the pipe ends the run too.
///
/// Example: lightcast run --config config/replay.toml | jq .error
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Configuration file (TOML); config/replay.toml explains every key.
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
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let config = Config::load(&arguments.config)?;
    let shutdown = Shutdown::new();
    let _signals = SignalWatch::start(&shutdown)?;
    let pictures = arguments
        .pictures
        .as_ref()
        .map(|folder| Pictures { folder: folder.clone(), every: arguments.picture_every });
    let open_output = || open_output(arguments.output.as_ref());
    let service = Service::start(&config, open_output, pictures.as_ref(), Copies::default(), &shutdown)?;
    let summary = service.summary();
    let bar = PROGRESS.add(progress_bar(service.frame_count()));
    let outcome = service.join(PROGRESS_INTERVAL, || {
        bar.set_position(summary.lists_published());
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
fn progress_bar(frame_count: Option<u64>) -> ProgressBar {
    let template = if frame_count.is_some() {
        "{bar:40} {pos}/{len} lists, {per_sec}, {eta} left"
    } else {
        "{spinner} {pos} lists, {per_sec}, {elapsed}"
    };
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    match frame_count {
        Some(count) => ProgressBar::new(count),
        None => ProgressBar::new_spinner(),
    }
    .with_style(style)
}
