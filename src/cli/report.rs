mod command;
mod inputs;
mod making;
mod options;
#[cfg(feature = "render")]
mod pictures;
mod sequences;

use super::panorama::PanoramaArguments;
use super::signals::SignalWatch;
use super::standard_output::print;
use crate::compare::stability;
use crate::error::{Error, Result};
use crate::report::tables;
use crate::rt::Shutdown;
use lightcast_core::light::MAX_LIGHTS;
use making::Report;
use std::path::PathBuf;

/// Measure error against time, as a page, plots and JSON.
///
/// For every map and every way to make lights of it, with 4, 8, ... 1024 lights: error of irradiance, shadows
/// and glossy surfaces against the time that the lights take. For every sequence: error against the filtered
/// truth, flicker and motion of the lights against the time of a frame. Where there is a GPU, pictures under
/// every map too. Results on the Pareto front are marked. Without an INPUT three maps and two sequences that
/// are built in are used. The hard cases follow: the results of plain f32, and how far this program is from
/// f64.
///
/// An INPUT is a map or a sequence. A map is a lat-long panorama, OpenEXR or Radiance HDR, or `-` for one on
/// standard input. A sequence is a folder or pattern (name.####.exr) of numbered panoramas, or a
/// configuration as `run` takes it. Light lists and servers have no map to measure lights against and are
/// refused.
///
/// The folder gets index.html, which needs nothing else, report.json and the plots as SVG; it is rewritten
/// after every input. Ctrl-C (SIGINT) or SIGTERM ends the report with what is done; a second signal ends it
/// at once. Thirteen maps and two sequences take some minutes.
///
/// Examples:
///   lightcast report
///   lightcast report studio.hdr noon.hdr config/replay.toml --output report
///   lightcast report --tables --lights 64,256 studio.hdr
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Panoramas, sequences and configurations, or `-` for a panorama on standard input.
    #[arg(value_name = "INPUT")]
    inputs: Vec<PathBuf>,

    /// A configuration as a further INPUT, whatever it is called. May be given several times.
    #[arg(long, value_name = "FILE")]
    config: Vec<PathBuf>,

    #[command(flatten)]
    panorama: PanoramaArguments,

    /// Folder for the report; made if it is not there. Files of the same names are replaced.
    #[arg(long, short, value_name = "DIR", default_value = "report")]
    output: PathBuf,

    /// Print the tables and write no files.
    #[arg(long, conflicts_with = "output")]
    tables: bool,

    /// Print the hard cases, in plain f32, here and in f64, and nothing else.
    #[arg(long, conflicts_with_all =
          ["inputs", "config", "output", "tables", "lights", "frames", "frame_rate", "garden", "hall"])]
    stability: bool,

    /// Numbers of lights, with commas between them.
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = lights,
          default_values_t = tables::COUNTS)]
    lights: Vec<usize>,

    /// Frames of a sequence, from its first on; 100 if this is not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,

    /// Frames per second of sequences of panoramas; takes precedence over the files.
    #[arg(long, value_name = "HZ", value_parser = frame_rate)]
    frame_rate: Option<f64>,

    /// A panorama that is turned so that its sun walks through phi = 0: one more sequence, of 40 frames. For
    /// chinese_garden_1k there are published figures, which have a table of their own.
    #[arg(long, value_name = "MAP", requires = "hall")]
    garden: Option<PathBuf>,

    /// A panorama some of whose lamps flicker: one more sequence, of 40 frames. Published figures exist for
    /// dancing_hall_1k.
    #[arg(long, value_name = "MAP", requires = "garden")]
    hall: Option<PathBuf>,

    /// Draw pictures even with a Vulkan driver in software, which takes half a minute or more per map. They
    /// have 4, 16, 64 and 256 lights, or the numbers of --lights, at most 512.
    #[cfg(feature = "render")]
    #[arg(long, conflicts_with = "stability")]
    pictures: bool,
}

fn lights(text: &str) -> Result<usize, String> {
    text.parse()
        .ok()
        .filter(|count| (1..=MAX_LIGHTS).contains(count))
        .ok_or_else(|| format!("give 1 to {MAX_LIGHTS}"))
}

fn frame_rate(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|rate: &f64| rate.is_finite() && *rate > 0.0)
        .ok_or_else(|| "give a number above 0".to_owned())
}

impl Arguments {
    /// The most frames of a sequence.
    fn frame_limit(&self) -> usize {
        self.frames.map_or(100, |frames| frames as usize)
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    if arguments.stability {
        print(&stability::lines(&stability::measure(|| true)?))?;
        return Ok(());
    }
    options::check(arguments)?;
    let shutdown = Shutdown::new();
    let _signals = SignalWatch::start(&shutdown)?;
    let mut report = Report::new(arguments, &shutdown);
    // Errors are better reported now than after minutes of measuring.
    let Some(mut inputs) = report.open()? else {
        tracing::warn!("interrupted before anything was measured");
        return Ok(());
    };
    if !arguments.tables {
        std::fs::create_dir_all(&arguments.output).map_err(|error| {
            let error = Error::failed("the folder for the report cannot be made").because(error);
            error.at(&arguments.output)
        })?;
    }
    let outcome = report.measure(&mut inputs);
    // The report is finished even if a later input has failed.
    report.finish(*outcome.as_ref().unwrap_or(&false)).and(outcome.map(|_| ()))
}

#[cfg(test)]
mod tests {
    use super::Arguments;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        arguments: Arguments,
    }

    /// The arguments that these words of a command line give.
    pub(super) fn arguments(words: &[&str]) -> Arguments {
        Line::parse_from(std::iter::once("report").chain(words.iter().copied())).arguments
    }
}
