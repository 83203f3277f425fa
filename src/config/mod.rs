//! The contents of a configuration file, checked once and turned into the options of the modules below.
//!
//! The file is TOML; `config/replay.toml` has every key with a comment. Unknown keys are refused, an error
//! names file, line and key, and paths in the file are relative to its folder.

mod file;
mod server;
mod source;

pub use server::ServerConfig;

use crate::design::FilterOptions;
use crate::error::{Error, Result, TomlText};
use crate::source::SequenceOptions;
#[cfg(feature = "camera")]
use crate::source::{BracketOptions, v4l2::V4l2Options};
use glam::DMat3;
use lightcast_core::camera::{ColourMatrix, Response};
use lightcast_core::image::PolarShape;
use lightcast_core::light;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// A whole configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Where the frames come from.
    pub source: SourceOptions,
    /// How fast they are played.
    pub pace: Pace,
    /// What happens when a stage is slower than the frames arrive.
    pub links: Links,
    /// What the frames show.
    pub camera: CameraOptions,
    /// Size and extent of the polar map.
    pub map: PolarShape,
    /// How lights are made.
    pub lights: light::Options,
    /// How they are filtered.
    pub filter: FilterOptions,
    /// Who may connect to a server.
    pub server: ServerConfig,
    origin: TomlText,
}

/// Where frames come from.
#[derive(Clone, Debug, PartialEq)]
pub enum SourceOptions {
    /// Numbered files.
    Sequence(SequenceOptions),
    /// A live camera, and the exposures that it cycles through.
    #[cfg(feature = "camera")]
    Camera(V4l2Options, Option<BracketOptions>),
}

/// How fast a sequence is played.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pace {
    /// At its own frame rate.
    #[default]
    RealTime,
    /// As fast as possible.
    Fast,
}

/// What a link between two stages does when its reader is slow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Links {
    /// The newest frame wins; drops are counted.
    Live,
    /// The writer waits; nothing is lost, and every run gives the same bytes.
    #[default]
    Replay,
}

/// What the frames of a source show.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraOptions {
    /// Kind of picture.
    pub projection: ProjectionKind,
    /// Calibration file; a fisheye picture needs one.
    pub calibration: Option<PathBuf>,
    /// Which camera of a Kalibr chain; `None`: the first.
    pub kalibr_camera: Option<String>,
    /// Meaning of sensor codes; takes precedence over the calibration. Files of OpenCV and Kalibr do not give
    /// it.
    pub response: Option<Response>,
    /// Rotation from camera to world axes; `None`: the projection's own default.
    pub world_from_camera: Option<DMat3>,
    /// Linear Rec. 709 from the sensor's colours; `None`: the frames have these already, or no colours.
    pub rec709_from_sensor: Option<ColourMatrix>,
}

/// Kind of picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ProjectionKind {
    /// A panorama of the whole sphere.
    #[default]
    LatLong,
    /// A picture through a lens that a calibration file describes.
    Fisheye,
}

impl Config {
    /// Reads and checks a configuration file.
    ///
    /// # Errors
    /// Kind `Usage`, naming file, line and key.
    pub fn load(path: &Path) -> Result<Self> {
        file::parse(TomlText::load(path)?)
    }

    /// Puts file and line in front of an error about an option of `section` that only its algorithm could
    /// find.
    pub fn locate(&self, section: &str, error: impl Into<Error>) -> Error {
        self.origin.locate(section, error.into())
    }
}
