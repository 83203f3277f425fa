use super::messages::PROGRESS;
use super::panorama::read_panorama;
use crate::error::{Error, Result};
use crate::report::{sequence_table, stills};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{self, ErrorKind, Write};
use std::path::PathBuf;

/// Print error against time, as tables.
///
/// For every MAP, a lat-long panorama, and for 64 and 256 lights: irradiance, shadow and glossy error of the methods of
/// the field and of refined lights, with the estimate that the list carries, the difference in power and the median
/// time. Then the geometric means over all maps; for thirteen maps the published figures stand beside them.
///
/// With --garden and --hall the steadiness over time as well: two sequences made of these two maps, before and after
/// the filter.
///
/// Example: lightcast report *_1k.hdr --garden chinese_garden_1k.hdr --hall dancing_hall_1k.hdr
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Panoramas: OpenEXR or Radiance HDR.
    #[arg(required_unless_present = "garden")]
    maps: Vec<PathBuf>,

    /// The map that is turned so that its sun walks through phi = 0.
    #[arg(long, value_name = "MAP", requires = "hall")]
    garden: Option<PathBuf>,

    /// The map some of whose lamps flicker.
    #[arg(long, value_name = "MAP", requires = "garden")]
    hall: Option<PathBuf>,
}

/// Prints as it measures, so that what is done is not lost when the rest is interrupted.
pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let style =
        ProgressStyle::with_template("{bar:40} {pos}/{len} {msg}").expect("a template that is well formed");
    let progress = PROGRESS.add(ProgressBar::new(arguments.maps.len() as u64)).with_style(style);
    let mut rows = Vec::new();
    for path in &arguments.maps {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        progress.set_message(name.clone());
        let of_map = stills::measure(&read_panorama(path, stills::SHAPE)?)?;
        if !PROGRESS.suspend(|| print(&stills::lines(&name, &of_map)))? {
            return Ok(());
        }
        rows.extend(of_map);
        progress.inc(1);
    }
    progress.finish_and_clear();
    if !rows.is_empty() && !print(&stills::mean_lines(&rows, arguments.maps.len()))? {
        return Ok(());
    }
    if let (Some(garden), Some(hall)) = (&arguments.garden, &arguments.hall) {
        let (garden, hall) = (read_panorama(garden, stills::SHAPE)?, read_panorama(hall, stills::SHAPE)?);
        print(&sequence_table::lines(&sequence_table::measure(&garden, &hall)?))?;
    }
    Ok(())
}

/// Writes lines to standard output; false when nobody reads it any more.
pub(super) fn print(lines: &[String]) -> Result<bool> {
    let mut out = io::stdout().lock();
    match lines.iter().try_for_each(|line| writeln!(out, "{line}")) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(Error::failed("standard output cannot be written").because(error)),
    }
}
