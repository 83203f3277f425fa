//! Recordings of what a service captures.

use super::camera;
use super::opened_source::OpenedSource;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::rt::{Metrics, Shutdown, link};
use crate::stage::Record;
use lightcast_core::camera::Response;
use lightcast_core::image::Frame;
use std::path::PathBuf;

/// What to record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordOptions {
    /// A new or empty folder.
    pub folder: PathBuf,
    /// Kind of samples.
    pub samples: RecordSamples,
    /// Frames that may wait for the disk; more are dropped and counted.
    pub queue: usize,
    /// Frames after which the recording ends.
    pub frames_max: u64,
}

/// Frames that wait for the disk by default: half a second at 60 frames per second bridges the delays of
/// disks.
pub const RECORD_QUEUE: usize = 30;

impl Default for RecordOptions {
    /// The camera's codes, without an end.
    fn default() -> Self {
        Self {
            folder: PathBuf::new(),
            samples: RecordSamples::AsCaptured,
            queue: RECORD_QUEUE,
            frames_max: u64::MAX,
        }
    }
}

/// The samples that are written for a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordSamples {
    /// The camera's codes, without loss.
    AsCaptured,
    /// Radiance, by the response, as half floats.
    Half,
}

/// Makes the recorder. It ends by itself when its source has ended.
///
/// # Errors
/// `Usage`: the folder is not empty, or half floats are requested of a mosaic or where no response is known.
pub(super) fn recorder(
    config: &Config,
    options: &RecordOptions,
    source: &OpenedSource,
    metrics: &Metrics,
) -> Result<Record> {
    let response = camera::response(config)?;
    let table = match options.samples {
        RecordSamples::AsCaptured => None,
        RecordSamples::Half => Some(table(source, &response)?),
    };
    // A calibration's text is JSON.
    let calibration = camera::calibration(config)?.and_then(|own| serde_json::from_str(&own.to_json()).ok());
    let recording = source.recording(calibration);
    Record::new(options.folder.clone(), recording, table, options.frames_max, metrics)
}

/// The link to a recorder for which `queue` frames may wait; `waits` says whether the source waits for it or
/// drops frames.
pub(super) fn recorder_link(
    queue: usize,
    waits: bool,
    metrics: &Metrics,
    shutdown: &Shutdown,
) -> (link::Sender<Frame>, link::Receiver<Frame>) {
    if waits {
        link::bounded(queue, shutdown, Frame::default)
    } else {
        link::lossy(queue, metrics.drops.clone(), shutdown, Frame::default)
    }
}

/// Radiance by code.
fn table(source: &OpenedSource, response: &Response) -> Result<Vec<f32>> {
    let fault = |what: &str| Err(Error::usage(what).at(source.name()));
    if !source.format().is_codes {
        return Ok(Vec::new());
    }
    if source.format().bayer.is_some() {
        return fault("frames of a mosaic sensor can be recorded as they come only, not as half floats");
    }
    if response.is_identity() {
        return fault(
            "half floats need a response, which tells what sensor codes mean; give one in [camera]",
        );
    }
    Ok(response.table().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_that_does_not_wait_leaves_out_what_a_disk_that_hangs_does_not_take() {
        let (metrics, shutdown) = (Metrics::new("record"), Shutdown::new());
        let (mut frames, mut recorder) = recorder_link(3, false, &metrics, &shutdown);
        for _ in 0..200 {
            frames.send_copy(&Frame::default()).unwrap();
        }
        assert_eq!(metrics.drops.get(), 197);
        drop(frames);
        assert_eq!(std::iter::from_fn(|| recorder.receive().map(drop)).count(), 3);
    }
}
