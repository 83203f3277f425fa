mod bracket;
mod from_patches;

use super::write;
use crate::calibrate::{Calibration, CodeLimits, Family};
use crate::cli::input::{Input, is_standard_input};
use crate::cli::signals::SignalWatch;
use crate::cli::standard_output::print;
use crate::config::Config;
use crate::error::{Error, Kind, Result};
use crate::files;
use crate::picture::Plot;
use crate::rt::Shutdown;
use crate::service::Service;
use crate::source::{Sequence, SequenceOptions};
use clap::ValueEnum;
use lightcast_core::camera::Response;
use lightcast_core::image::Frame;
use std::path::{Path, PathBuf};

/// Find how a camera turns light into codes, and merge a bracket of exposures.
///
/// PICTURES are 16-bit PNG files with raw codes, or JPEG and 8-bit PNG files of an ordinary camera; a folder
/// or a pattern such as frames/name.####.png stands for its pictures in order, and a configuration (.toml)
/// for frames of the live camera that it names.
///
/// With --patches the pictures show three or more grey patches of known luminance, from black to near
/// saturation; six are good, and two of them held out. The file (TOML) says where they are, in px from the
/// top left corner; `picture` is only needed where there are several PICTURES, and of a sequence all frames
/// are taken together:
///
///   [[patch]]
///   picture = "chart.png"
///   rectangle = [120, 340, 30, 30]    # x, y, width, height
///   luminance_cd_m2 = 12.5
///   held_out = true                   # optional: not fitted, only predicted
///
/// Without --patches, the pictures are a bracket: one still scene at several exposure times, longest to
/// shortest a factor of 2 to 8 apart, from a camera that does not move. Times (with ISO and f-number) come
/// from their EXIF data, or from --exposures, a TOML file in the order of the pictures: exposure_s = [13.0,
/// 1.6, 0.2]. Where neither is known, the response of --calibration serves to find the times. The radiance is
/// relative.
///
/// A table goes to standard output, the response to --output: as the response of the calibration given by
/// --calibration, whose lens is kept, or alone.
///
/// Examples:
///   lightcast calibrate response chart.png --patches chart.toml --calibration lens.json --output camera.json
///   lightcast calibrate response IMG_69*.JPG --output response.json --plot response.svg --merge office.exr
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Pictures, folders, patterns, or the configuration of a camera.
    #[arg(required_unless_present = "config", value_name = "PICTURES")]
    pictures: Vec<PathBuf>,

    /// The configuration of a camera as PICTURES, whatever it is called.
    #[arg(long, value_name = "FILE", conflicts_with = "pictures")]
    config: Option<PathBuf>,

    /// Grey patches: rectangles and luminances (TOML).
    #[arg(long, value_name = "FILE", conflicts_with_all = ["exposures", "merge"])]
    patches: Option<PathBuf>,

    /// Frames to take of a live camera.
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    live_frames: u64,

    /// Model for the patches [default: the one that predicts each patch best from the others].
    #[arg(long, value_enum, requires = "patches")]
    model: Option<ModelName>,

    /// Codes at which a companded sensor changes its slope, such as 1024,2048: a piecewise linear response.
    #[arg(long, value_name = "CODES", value_delimiter = ',', requires = "patches")]
    knees: Vec<u16>,

    /// Exposure times of the pictures (TOML).
    #[arg(long, value_name = "FILE")]
    exposures: Option<PathBuf>,

    /// Code without light [default: found from the patches; 0 for a bracket].
    #[arg(long, value_name = "CODE")]
    black: Option<u16>,

    /// Code from which pixels are saturated [default: found].
    #[arg(long, value_name = "CODE")]
    saturation: Option<u16>,

    /// Calibration whose lens goes into --output: lightcast's, OpenCV's or Kalibr's.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,

    /// File for the result (JSON); may be the one of --calibration.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,

    /// Picture of the curve and its deviations (SVG).
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,

    /// Merge the bracket into a picture of radiance (OpenEXR, floats).
    #[arg(long, value_name = "FILE")]
    merge: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ModelName {
    /// code = a + b ln L, HDR sensors of the HDRC class.
    Logarithmic,
    /// Codes proportional to the light above black.
    Linear,
    /// Straight lines between --knees, or between the patches.
    PiecewiseLinear,
}

impl From<ModelName> for Family {
    fn from(name: ModelName) -> Self {
        match name {
            ModelName::Logarithmic => Self::Logarithmic,
            ModelName::Linear => Self::Linear,
            ModelName::PiecewiseLinear => Self::PiecewiseLinear,
        }
    }
}

/// The result of a fit.
struct Found {
    response: Response,
    lines: Vec<String>,
    plot: Plot,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let calibration = match &arguments.calibration {
        Some(path) => Some(Calibration::load(path, None)?),
        None => None,
    };
    let inputs = match &arguments.config {
        Some(path) => vec![Taken::live(path, arguments.live_frames)?],
        None => {
            let find = |path: &PathBuf| Taken::find(path, arguments.live_frames);
            arguments.pictures.iter().map(find).collect::<Result<_>>()?
        }
    };
    let found = match &arguments.patches {
        Some(path) => from_patches::find(arguments, &inputs, path)?,
        None => {
            let known = calibration.as_ref().map(|calibration| &calibration.response);
            bracket::find(arguments, &inputs, known.filter(|response| !response.is_identity()))?
        }
    };
    print(&found.lines)?;
    if let Some(path) = &arguments.output {
        let text = match calibration {
            Some(calibration) => Calibration { response: found.response, ..calibration }.to_json(),
            None => {
                let text = serde_json::to_string_pretty(found.response.model());
                text.expect("numbers and words have a JSON form") + "\n"
            }
        };
        write(path, &text)?;
    }
    if let Some(path) = &arguments.plot {
        write(path, &found.plot.to_svg())?;
    }
    Ok(())
}

impl Arguments {
    fn limits(&self) -> CodeLimits {
        CodeLimits { black_code: self.black, saturation_code: self.saturation }
    }
}

/// One of the PICTURES, and the frames that it stands for.
struct Taken {
    path: PathBuf,
    frames: Frames,
}

enum Frames {
    Files(Vec<PathBuf>),
    /// The first frames of what a configuration names, and their number.
    Live(Box<Config>, u64),
}

impl Taken {
    fn live(path: &Path, live_frames: u64) -> Result<Self> {
        let frames = Frames::Live(Box::new(Config::load(path)?), live_frames);
        Ok(Self { path: path.to_owned(), frames })
    }

    fn find(path: &Path, live_frames: u64) -> Result<Self> {
        let input = Input::of(path)?;
        match &input {
            Input::Configuration(path) => return Self::live(path, live_frames),
            Input::Panorama(path) | Input::Panoramas(path) if !is_standard_input(path) => {}
            _ => {
                return Err(
                    input.refused("calibrate response", "name picture files, which can be read twice")
                );
            }
        }
        let frames = if path.is_file() {
            Frames::Files(vec![path.to_owned()])
        } else {
            // The rate does not matter here.
            let options = SequenceOptions {
                path: path.to_owned(),
                frame_rate_hz: Some(1.0),
                ..SequenceOptions::default()
            };
            Frames::Files(Sequence::open(&options)?.files().map(Path::to_owned).collect())
        };
        Ok(Self { path: path.to_owned(), frames })
    }

    /// The files of pictures that were taken before.
    fn files(&self) -> Result<&[PathBuf]> {
        match &self.frames {
            Frames::Files(files) => Ok(files),
            Frames::Live(..) => {
                Err(Error::usage("a bracket is made of pictures; live frames are for --patches")
                    .at(&self.path))
            }
        }
    }

    /// Calls `each` with every frame and the name that it has in messages.
    fn for_each(&self, mut each: impl FnMut(&Frame, &Path) -> Result<()>) -> Result<()> {
        match &self.frames {
            Frames::Files(files) => {
                let mut frame = Frame::default();
                files.iter().try_for_each(|path| {
                    read(path, &mut frame)?;
                    each(&frame, path)
                })
            }
            Frames::Live(config, count) => {
                let shutdown = Shutdown::new();
                let _signals = SignalWatch::start(&shutdown)?;
                Service::take_frames(config, *count, &shutdown, |frame| each(frame, &self.path))
            }
        }
    }
}

fn read(path: &Path, frame: &mut Frame) -> Result<()> {
    files::read(path, frame).map(|_| ()).map_err(|error| error.with_kind(Kind::Failed))
}

/// A number for a table: four digits.
fn digits(value: f64) -> String {
    if value == 0.0 || (1e-3..1e5).contains(&value.abs()) {
        let decimals = (3 - value.abs().max(1e-3).log10().floor() as i32).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.3e}")
    }
}

/// The curve at up to `count` codes, (radiance, code), for a plot.
fn curve(response: &Response, count: usize) -> Vec<(f64, f64)> {
    let (low, high) = (f64::from(response.black_clip_code()), f64::from(response.saturation_code()));
    (0..count)
        .map(|at| (low + (high - low) * at as f64 / (count - 1) as f64).round() as u16)
        .map(|code| (f64::from(response.table()[usize::from(code)]), f64::from(code)))
        .collect()
}

#[cfg(test)]
mod tests;
