use super::input::ConfigurationArguments;
use super::run::{allow_many_files, watch};
use super::signals::SignalWatch;
use crate::config::Config;
use crate::error::Result;
use crate::rt::Shutdown;
use crate::service::{RECORD_QUEUE, RecordOptions, RecordSamples, Service};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Record the frames of a camera as they are captured, without making lights.
///
/// CONFIG names the camera in its section [source]; before there is a calibration, leave [camera] out. Every
/// frame becomes a file `frame.NNNNNN.exr` with its sequence number: sensor codes without loss, with rate,
/// capture time, exposure, mosaic and lens in its attributes. `recording.json` beside them says what was
/// recorded and how many frames are missing. A disk that is too slow loses frames of the recording, which are
/// counted as drops; a full disk ends it, and all that was written before can be played.
///
/// The recording is played as any sequence: kind = "sequence" with the folder as its path. To record while
/// lights are made, see `lightcast run --record`.
///
/// Example: lightcast record config/camera.toml --output recording/ --seconds 10
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    #[command(flatten)]
    config: ConfigurationArguments,

    /// New or empty folder for the recording.
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,

    /// Write radiance as half floats, by the response of the configuration, instead of the camera's codes.
    #[arg(long)]
    half: bool,

    /// End after this many frames.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    frames: Option<u64>,

    /// End after this many seconds.
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<Duration>,

    /// Frames that may wait for the disk.
    #[arg(long, value_name = "N", default_value_t = RECORD_QUEUE as u16, value_parser = clap::value_parser!(u16).range(1..=1000))]
    queue: u16,
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "is no number".to_owned())?;
    Duration::try_from_secs_f64(seconds)
        .ok()
        .filter(|time| !time.is_zero())
        .ok_or_else(|| "must be above 0".to_owned())
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    arguments.config.check("record")?;
    let config = Config::load(arguments.config.path())?;
    let options = RecordOptions {
        folder: arguments.output.clone(),
        samples: if arguments.half { RecordSamples::Half } else { RecordSamples::AsCaptured },
        queue: arguments.queue.into(),
        frames_max: arguments.frames.unwrap_or(u64::MAX),
    };
    allow_many_files();
    let shutdown = Shutdown::new();
    let _signals = SignalWatch::start(&shutdown)?;
    let service = Service::record(&config, &options, &shutdown)?;
    let (started, summary) = (Instant::now(), service.summary());
    let written =
        |summary: &crate::service::Summary| summary.stage("record").map_or(0, |record| record.frames.get());
    watch(service, &summary, "frames", written, |_| {
        if arguments.seconds.is_some_and(|seconds| started.elapsed() >= seconds) {
            shutdown.request();
        }
    })
}
