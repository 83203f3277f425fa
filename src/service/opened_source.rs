//! Where the frames of a service come from, opened.

use super::graph::{Graph, Output};
use crate::config::{self, Config};
use crate::error::Result;
#[cfg(feature = "camera")]
use crate::error::{Error, Kind};
use crate::rt::stage::Ticks;
#[cfg(feature = "camera")]
use crate::rt::utc_from_monotonic_ns;
use crate::rt::{CaptureEpoch, Clock, Metrics};
#[cfg(feature = "camera")]
use crate::source::{Bracket, BracketOptions, v4l2::V4l2Camera};
use crate::source::{FrameFormat, LiveCamera, Sequence};
use crate::stage::{self, Patience, Recording};
#[cfg(feature = "camera")]
use lightcast_core::camera::Response;
use lightcast_core::image::Frame;
use std::path::Path;
use std::sync::Arc;

/// Name of the stage, and of its thread.
const SOURCE: &str = "source";

/// A source that is ready to start.
pub struct OpenedSource {
    frames: Frames,
    format: FrameFormat,
    /// For messages: the path, or the camera's stable name.
    name: String,
    metrics: Arc<Metrics>,
    exposure_s: Option<f64>,
    /// The offset from capture times to nanoseconds since 1970.
    utc_from_capture_ns: Option<i64>,
    epoch: CaptureEpoch,
}

enum Frames {
    Sequence(Sequence),
    Camera(Box<dyn LiveCamera>),
}

impl OpenedSource {
    /// Opens the source that a configuration names.
    ///
    /// # Errors
    /// Those of the source: no file or no camera of this name, or one that cannot be used as configured.
    pub fn open(config: &Config) -> Result<Self> {
        match &config.source {
            config::SourceOptions::Sequence(options) => {
                let mut sequence = Sequence::open(options)?;
                let metrics = Metrics::new(SOURCE);
                sequence.count_overflowed(metrics.counter("samples beyond the numbers of their files"));
                Ok(Self {
                    format: sequence.format(),
                    frames: Frames::Sequence(sequence),
                    name: options.path.display().to_string(),
                    metrics,
                    exposure_s: None,
                    utc_from_capture_ns: None,
                    epoch: CaptureEpoch::default(),
                })
            }
            #[cfg(feature = "camera")]
            config::SourceOptions::Camera(options, bracket) => {
                let camera = V4l2Camera::open(options.clone()).map_err(|error| match error.kind() {
                    Kind::Usage => config.locate("source", error),
                    _ => error,
                })?;
                let (format, name) = (camera.format(), camera.name().to_owned());
                let exposure_s = camera.exposure_s();
                let source = match bracket {
                    None => Self { exposure_s, ..Self::camera(format, name, camera) },
                    Some(options) => Self::bracket(camera, options, &super::camera::response(config)?)
                        .map_err(|error| config.locate("source.bracket", error))?,
                };
                Ok(Self { utc_from_capture_ns: Some(utc_from_monotonic_ns()), ..source })
            }
        }
    }

    #[cfg(feature = "camera")]
    fn bracket(mut camera: V4l2Camera, options: &BracketOptions, response: &Response) -> Result<Self> {
        let (mut format, name) = (camera.format(), camera.name().to_owned());
        let raw_rate_hz = format.frame_rate_hz;
        if format.bayer.is_some() {
            return Err(Error::usage(
                "exposures of a mosaic sensor cannot be merged; choose another pixel format",
            ));
        }
        camera.choose_exposure_control(&options.control, &options.values)?;
        format.is_codes = false;
        format.frame_rate_hz /= options.values.len() as f64;
        let metrics = Metrics::new(SOURCE);
        let bracket = Bracket::new(camera, raw_rate_hz, options, response, &metrics)?;
        Ok(Self { metrics, ..Self::camera(format, name, bracket) })
    }

    /// Any other camera: frames of this format from a device of this name.
    pub fn camera(format: FrameFormat, name: String, camera: impl LiveCamera + 'static) -> Self {
        let frames = Frames::Camera(Box::new(camera));
        let metrics = Metrics::new(SOURCE);
        let epoch = CaptureEpoch::default();
        // A camera's capture times are the kernel's already.
        epoch.set(0);
        Self { frames, format, name, metrics, exposure_s: None, utc_from_capture_ns: None, epoch }
    }

    pub(super) fn format(&self) -> &FrameFormat {
        &self.format
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// The relation of its capture times to the kernel's clock.
    pub(super) fn epoch(&self) -> CaptureEpoch {
        self.epoch.clone()
    }

    /// Whether frames wait for their reader; those of a camera do not.
    pub(super) fn waits(&self) -> bool {
        matches!(self.frames, Frames::Sequence(_))
    }

    /// The files of a sequence.
    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        let sequence = match &self.frames {
            Frames::Sequence(sequence) => Some(sequence.files()),
            Frames::Camera(_) => None,
        };
        sequence.into_iter().flatten()
    }

    /// Frames to come, readable or not; `None` where they never end.
    pub fn frame_count(&self) -> Option<u64> {
        match &self.frames {
            Frames::Sequence(sequence) => sequence.frame_count(),
            Frames::Camera(_) => None,
        }
    }

    /// The description of a recording of it.
    pub(super) fn recording(&self, calibration: Option<serde_json::Value>) -> Recording {
        Recording {
            version: 1,
            source: self.name.clone(),
            exposure_s: self.exposure_s,
            calibration,
            utc_from_capture_ns: self.utc_from_capture_ns,
        }
    }

    /// Makes it the source of `graph`.
    pub(super) fn add_to(self, graph: &mut Graph) -> Output<Frame> {
        let (clock, shutdown) = (graph.clock().clone(), graph.shutdown().clone());
        let ticks = Ticks(shutdown.clone());
        match self.frames {
            Frames::Sequence(sequence) => {
                let rate_hz = self.format.frame_rate_hz;
                let source = stage::Source::new(sequence, rate_hz, (&clock, &shutdown), self.epoch);
                graph.stage(self.metrics, source, ticks, Frame::default())
            }
            Frames::Camera(camera) => {
                let rate_hz = self.format.frame_rate_hz;
                let patience = Patience::for_rate(rate_hz);
                let capture =
                    stage::Capture::new(camera, rate_hz, patience, (&clock, &shutdown), &self.metrics);
                graph.stage(self.metrics, capture, ticks, Frame::default())
            }
        }
    }

    /// The clock that paces it; `is_fast` lets it run as fast as possible.
    pub(super) fn clock(&self, is_fast: bool) -> Clock {
        match self.frames {
            Frames::Sequence(_) if is_fast => Clock::simulated(),
            _ => Clock::real(),
        }
    }
}
