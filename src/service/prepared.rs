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
    source: Option<OpenedSource>,
    calibrate: Option<(FrameToPolar, Response)>,
    pub(super) light: Extractor,
    pub(super) filter: RateFilter,
}

impl Prepared {
    /// Makes what can be made.
    ///
    /// # Errors
    /// Those of [`Service::start`](super::Service::start), except those that show only when a camera is
    /// opened; kind `Usage` where the map does not fit into memory.
    pub fn new(config: &Config) -> Result<Self> {
        memory::check(config)?;
        let (light, filter) = (extractor(config)?, filter(config)?);
        camera::calibration(config)?;
        let mut prepared = Self { source: None, calibrate: None, light, filter };
        if matches!(config.source, SourceOptions::Sequence(_)) {
            prepared.set_source(config, OpenedSource::open(config)?)?;
        }
        Ok(prepared)
    }

    /// As [`Self::new`], with frames from `source`.
    pub(super) fn with(config: &Config, source: OpenedSource) -> Result<Self> {
        memory::check(config)?;
        let (light, filter) = (extractor(config)?, filter(config)?);
        let mut prepared = Self { source: None, calibrate: None, light, filter };
        prepared.set_source(config, source)?;
        Ok(prepared)
    }

    fn set_source(&mut self, config: &Config, source: OpenedSource) -> Result<()> {
        self.calibrate = Some(camera::frame_to_polar(config, source.format(), source.name())?);
        taps(config, &source)?;
        self.source = Some(source);
        Ok(())
    }

    /// The source, opened, and what makes polar maps of its frames.
    pub(super) fn take_source(
        &mut self,
        config: &Config,
    ) -> Result<(OpenedSource, (FrameToPolar, Response))> {
        if self.source.is_none() {
            self.set_source(config, OpenedSource::open(config)?)?;
        }
        let source = self.source.take().expect("it was opened");
        Ok((source, self.calibrate.take().expect("it is made with the source")))
    }
}
