//! The keys of `[source]`.

use super::{Links, Pace, SourceOptions};
use crate::error::{Error, Place, Result};
use crate::source::SequenceOptions;
#[cfg(feature = "camera")]
use crate::source::{
    BracketOptions,
    v4l2::{ControlValue, V4l2Options},
};
use lightcast_core::image::Bayer;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
#[cfg(feature = "camera")]
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Sequence,
    #[cfg(feature = "camera")]
    Camera,
}

/// The keys of all kinds of sources. They lie in one structure, and not in one for each kind, so that an
/// error names its line.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SourceKeys {
    kind: Kind,
    #[serde(default, deserialize_with = "frame_rate")]
    frame_rate_hz: Option<f64>,
    links: Option<Links>,
    // A sequence.
    path: Option<PathBuf>,
    first: Option<i64>,
    last: Option<i64>,
    repeat: Option<bool>,
    pace: Option<Pace>,
    bayer: Option<Bayer>,
    // A camera.
    #[cfg(feature = "camera")]
    device: Option<String>,
    #[cfg(feature = "camera")]
    format: Option<String>,
    #[cfg(feature = "camera")]
    size: Option<[u32; 2]>,
    #[cfg(feature = "camera")]
    controls: Option<BTreeMap<String, ControlValue>>,
    #[cfg(feature = "camera")]
    buffers: Option<u32>,
    #[cfg(feature = "camera")]
    bracket: Option<BracketOptions>,
}

/// Most buffers that can be configured: the kernel's own limit.
#[cfg(feature = "camera")]
const BUFFERS_MAX: u32 = 32;

impl SourceKeys {
    /// The options; paths are relative to `folder`.
    pub(super) fn check(self, folder: &Path) -> Result<(SourceOptions, Pace, Links)> {
        match self.kind {
            Kind::Sequence => self.sequence(folder),
            #[cfg(feature = "camera")]
            Kind::Camera => self.camera(),
        }
    }

    fn sequence(self, folder: &Path) -> Result<(SourceOptions, Pace, Links)> {
        #[cfg(feature = "camera")]
        refuse(
            "sequence",
            &[
                ("device", self.device.is_some()),
                ("format", self.format.is_some()),
                ("size", self.size.is_some()),
                ("controls", self.controls.is_some()),
                ("buffers", self.buffers.is_some()),
                ("bracket", self.bracket.is_some()),
            ],
        )?;
        let (first, last) = (self.first, self.last);
        if let (Some(first), Some(last)) = (first, last)
            && first > last
        {
            let fault = Error::usage(format!("must not be before first = {first}"));
            return Err(fault.at(Place::value("last", last)));
        }
        let path = folder.join(needed("path", self.path)?);
        let repeat = self.repeat.unwrap_or(false);
        let options = SequenceOptions {
            path,
            frame_rate_hz: self.frame_rate_hz,
            first,
            last,
            repeat,
            bayer: self.bayer,
        };
        Ok((SourceOptions::Sequence(options), self.pace.unwrap_or_default(), self.links.unwrap_or_default()))
    }

    #[cfg(feature = "camera")]
    fn camera(self) -> Result<(SourceOptions, Pace, Links)> {
        refuse(
            "camera",
            &[
                ("path", self.path.is_some()),
                ("first", self.first.is_some()),
                ("last", self.last.is_some()),
                ("repeat", self.repeat.is_some()),
                ("pace", self.pace.is_some()),
                ("bayer", self.bayer.is_some()),
            ],
        )?;
        let buffers = self.buffers.unwrap_or(V4l2Options::default().buffers);
        if !(2..=BUFFERS_MAX).contains(&buffers) {
            let fault = format!("the driver needs 2 to {BUFFERS_MAX}, one to fill while another is read");
            return Err(Error::usage(fault).at(Place::value("buffers", buffers)));
        }
        if self.size.is_some_and(|size| size.contains(&0)) {
            return Err(Error::usage("columns and rows must be above 0").at(Place::value("size", "...")));
        }
        let options = V4l2Options {
            device: needed("device", self.device)?,
            format: self.format,
            size: self.size,
            frame_rate_hz: self.frame_rate_hz,
            controls: self.controls.unwrap_or_default(),
            buffers,
        };
        // A camera does not wait, so its links are live by default.
        Ok((SourceOptions::Camera(options, self.bracket), Pace::RealTime, self.links.unwrap_or(Links::Live)))
    }
}

fn needed<T>(key: &str, value: Option<T>) -> Result<T> {
    value.ok_or_else(|| Error::usage(format!("missing field `{key}`")))
}

/// Refuses keys of another kind of source.
#[cfg(feature = "camera")]
fn refuse(kind: &str, keys: &[(&str, bool)]) -> Result<()> {
    match keys.iter().find(|(_, is_there)| *is_there) {
        Some((key, _)) => {
            let fault = Error::usage(format!("is no key of kind = \"{kind}\"; remove it"));
            Err(fault.at(Place::value(*key, "...")))
        }
        None => Ok(()),
    }
}

fn frame_rate<'de, D: Deserializer<'de>>(value: D) -> Result<Option<f64>, D::Error> {
    let rate_hz = f64::deserialize(value)?;
    // 1e9 Hz would be one frame a nanosecond, the unit of capture times.
    if !(rate_hz > 0.0 && rate_hz < 1e9) {
        return Err(D::Error::custom(format!("a frame rate is above 0 and below 1e9 Hz, not {rate_hz}")));
    }
    Ok(Some(rate_hz))
}
