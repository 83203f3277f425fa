//! What can be made of a configuration while another service runs.

use super::opened_source::OpenedSource;
use super::{camera, extractor, filter, memory, taps};
use crate::calibrate::Calibration;
use crate::config::{Config, SourceOptions};
use crate::design::RateFilter;
use crate::error::Result;
use lightcast_core::camera::{FrameToPolar, Response};
use lightcast_core::light::Extractor;
use std::path::{Path, PathBuf};

/// A checked configuration, and what takes a while to make of it. A camera is opened only when the service
/// starts: another one may have it.
pub struct Prepared {
    input: Option<Input>,
    named: Named,
    pub(super) light: Extractor,
    pub(super) filter: RateFilter,
}

/// What a configuration names, as it was when this was looked at.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Named {
    calibration: Option<Calibration>,
    /// Those of a sequence.
    files: Vec<PathBuf>,
}

/// The source, opened, and what only its format decides.
pub(super) struct Input {
    pub source: OpenedSource,
    pub frame_to_polar: FrameToPolar,
    pub response: Response,
    /// By how many frames the filter delays the lights.
    pub delay_frames: u32,
}

impl Prepared {
    /// Makes what can be made.
    ///
    /// # Errors
    /// Those of [`Service::start`](super::Service::start), except those that show only when a camera is
    /// opened; kind `Usage` where the map does not fit into memory.
    pub fn new(config: &Config) -> Result<Self> {
        let mut prepared = Self::without_input(config)?;
        prepared.named.calibration = camera::calibration(config)?;
        match config.source {
            SourceOptions::Sequence(_) => {
                let source = OpenedSource::open(config)?;
                prepared.named.files = source.files().map(Path::to_owned).collect();
                Ok(Self { input: Some(Input::of(config, source)?), ..prepared })
            }
            #[cfg(feature = "camera")]
            SourceOptions::Camera(..) => Ok(prepared),
        }
    }

    /// As [`Self::new`], with frames from `source`.
    pub(super) fn with(config: &Config, source: OpenedSource) -> Result<Self> {
        let prepared = Self::without_input(config)?;
        Ok(Self { input: Some(Input::of(config, source)?), ..prepared })
    }

    fn without_input(config: &Config) -> Result<Self> {
        memory::check(config)?;
        Ok(Self { input: None, named: Named::default(), light: extractor(config)?, filter: filter(config)? })
    }

    /// What the configuration names, as it was found.
    pub fn named(&self) -> &Named {
        &self.named
    }

    /// The input, which is opened now if it is a camera.
    pub(super) fn take_input(&mut self, config: &Config) -> Result<Input> {
        match self.input.take() {
            Some(input) => Ok(input),
            None => Input::of(config, OpenedSource::open(config)?),
        }
    }
}

impl Input {
    fn of(config: &Config, source: OpenedSource) -> Result<Self> {
        let (frame_to_polar, response) = camera::frame_to_polar(config, source.format(), source.name())?;
        let delay_frames = taps(config, &source)?.delay_frames();
        Ok(Self { source, frame_to_polar, response, delay_frames })
    }
}
