//! What can be made of a configuration while another service runs.

use super::opened_source::OpenedSource;
use super::{camera, extractor, filter, memory, taps};
use crate::config::{Config, SourceOptions};
use crate::design::RateFilter;
use crate::error::Result;
use lightcast_core::camera::{FrameToPolar, Response};
use lightcast_core::light::Extractor;

/// A checked configuration, and what takes a while to make of it. A camera is opened only when the service
/// starts: another one may have it.
pub struct Prepared {
    input: Option<Input>,
    pub(super) light: Extractor,
    pub(super) filter: RateFilter,
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
        let prepared = Self::without_input(config)?;
        camera::calibration(config)?;
        match config.source {
            SourceOptions::Sequence(_) => {
                Ok(Self { input: Some(Input::of(config, OpenedSource::open(config)?)?), ..prepared })
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
        Ok(Self { input: None, light: extractor(config)?, filter: filter(config)? })
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
