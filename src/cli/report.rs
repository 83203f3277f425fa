mod command;
mod inputs;
#[cfg(feature = "render")]
mod pictures;
mod sequences;

use super::messages::PROGRESS;
use super::signals::SignalWatch;
use crate::error::{Error, Result};
use crate::light::MAX_LIGHTS;
use crate::report::document::{Document, Table, Text};
use crate::report::sequence::{self, Sequence};
use crate::report::tables::{self, Origin};
use crate::report::{folder, sequence_table, stills};
use crate::rt::Shutdown;
use command::{command, command_line};
use indicatif::{ProgressBar, ProgressStyle};
use inputs::{Inputs, Map, Moving};
use std::io::{self, ErrorKind, Write};
use std::path::PathBuf;

/// Measure error against time, as a page, plots and JSON.
///
/// For every MAP and every way to make lights of it, with 4, 8, ... 1024 lights: error of irradiance, shadows and glossy
/// surfaces against the time that the lights take. For every SEQUENCE: error against the filtered truth, flicker and
/// motion of the lights against the time of a frame. Where there is a GPU, pictures under every MAP too. What is on the
/// Pareto front is marked. Without a MAP or SEQUENCE three maps and two sequences are made up.
///
/// A MAP is a lat-long panorama, OpenEXR or Radiance HDR. A SEQUENCE is a folder or pattern (name.####.exr) of numbered
/// panoramas, or a configuration as `run --config` takes.
///
/// The folder gets index.html, which needs nothing else, report.json and the plots as SVG; it is written anew after every
/// input. Ctrl-C (SIGINT) or SIGTERM ends the report with what is done; a second signal ends it at once. Thirteen maps
/// and two sequences take some minutes.
///
/// Examples:
///   lightcast report
///   lightcast report studio.hdr noon.hdr config/replay.toml --output report
///   lightcast report --tables --lights 64,256 studio.hdr
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Panoramas and sequences.
    #[arg(value_name = "MAP or SEQUENCE")]
    inputs: Vec<PathBuf>,

    /// Folder for the report; made if it is not there. Files of the same names are replaced.
    #[arg(long, short, value_name = "DIR", default_value = "report")]
    output: PathBuf,

    /// Print the tables and write no files.
    #[arg(long, conflicts_with = "output")]
    tables: bool,

    /// Numbers of lights.
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = lights,
          default_values_t = tables::COUNTS)]
    lights: Vec<usize>,

    /// Frames of a sequence, from its first on.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,

    /// Frames per second of sequences of panoramas; goes before what the files say.
    #[arg(long, value_name = "HZ")]
    frame_rate: Option<f64>,

    /// A panorama that is turned so that its sun walks through phi = 0: one more sequence, of 40 frames.
    #[arg(long, value_name = "MAP", requires = "hall")]
    garden: Option<PathBuf>,

    /// A panorama some of whose lamps flicker: one more sequence, of 40 frames.
    #[arg(long, value_name = "MAP", requires = "garden")]
    hall: Option<PathBuf>,

    /// Draw pictures even by a Vulkan driver in software, which takes a minute or more a map.
    #[cfg(feature = "render")]
    #[arg(long)]
    pictures: bool,
}

fn lights(text: &str) -> Result<usize, String> {
    text.parse()
        .ok()
        .filter(|count| (1..=MAX_LIGHTS).contains(count))
        .ok_or_else(|| format!("give 1 to {MAX_LIGHTS}"))
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let shutdown = Shutdown::new();
    let _signals = SignalWatch::start(&shutdown)?;
    let inputs = Inputs::of(arguments);
    if !arguments.tables {
        // Better told now than after minutes of measuring.
        std::fs::create_dir_all(&arguments.output).map_err(|error| {
            let error = Error::failed("the folder for the report cannot be made").because(error);
            error.at(arguments.output.display())
        })?;
    }
    let mut report = Report::new(arguments, &shutdown, &inputs);
    let outcome = report.measure(&inputs);
    report.bar.finish_and_clear();
    report.document.is_complete = *outcome.as_ref().unwrap_or(&false);
    // What a later input spoiled is done all the same.
    report.finish().and(outcome.map(|_| ()))
}

/// A report that is being made.
struct Report<'a> {
    arguments: &'a Arguments,
    shutdown: &'a Shutdown,
    bar: ProgressBar,
    document: Document,
    is_read: bool,
}

impl<'a> Report<'a> {
    fn new(arguments: &'a Arguments, shutdown: &'a Shutdown, inputs: &Inputs) -> Self {
        let mut counts = arguments.lights.clone();
        counts.sort_unstable();
        counts.dedup();
        let rows = inputs.maps.len() * stills::METHODS.len() * counts.len()
            + inputs.sequences.len() * sequence::Method::ALL.len() * counts.len();
        let style = ProgressStyle::with_template("{bar:40} {percent}% {msg}, {elapsed}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = PROGRESS.add(ProgressBar::new(rows as u64)).with_style(style);
        Self { arguments, shutdown, bar, document: Document::new(command_line(), counts), is_read: true }
    }

    /// Whether everything was measured; false when it was interrupted, or nobody reads the tables any more.
    fn measure(&mut self, inputs: &Inputs) -> Result<bool> {
        let maps: Vec<_> = inputs.maps.iter().map(|map| map.read(stills::SHAPE)).collect::<Result<_>>()?;
        let mut rows = Vec::new();
        for (map, pixels) in inputs.maps.iter().zip(&maps) {
            let origin = self.origin(map.name(), map.words());
            self.bar.set_message(format!("map {}", origin.name));
            let (counts, shutdown, bar) = (&self.document.lights, self.shutdown, &self.bar);
            let goes_on = || {
                bar.inc(1);
                !shutdown.is_requested()
            };
            let Some((table, of_map)) = tables::of_map(origin, pixels, counts, goes_on)? else {
                return Ok(false);
            };
            rows.extend(of_map);
            if !self.add(table, |document| &mut document.maps)? {
                return Ok(false);
            }
        }
        self.means(&inputs.maps, &rows)?;
        for moving in &inputs.sequences {
            if !self.sequence(moving)? {
                return Ok(false);
            }
        }
        if !self.published_sequences()? {
            return Ok(false);
        }
        #[cfg(feature = "render")]
        return pictures::measure(self, &inputs.maps);
        #[cfg(not(feature = "render"))]
        {
            self.document.pictures_skipped =
                Some("this program was built without its renderer (feature `render`).".to_owned());
            Ok(true)
        }
    }

    fn sequence(&mut self, moving: &Moving) -> Result<bool> {
        self.bar.set_message(format!("reading {}", moving.name()));
        let Some(sequence) = moving.read(self.arguments, self.shutdown)? else { return Ok(false) };
        self.bar.set_message(format!("sequence {}", moving.name()));
        let origin = match moving {
            Moving::Recorded(path) => self.origin(moving.name(), Some(path.as_path())),
            Moving::BuiltIn(_) => self.origin(moving.name(), None),
            Moving::Made { .. } => self.of_garden_and_hall(moving.name()),
        };
        self.table_of(origin, &sequence)
    }

    fn table_of(&mut self, origin: Origin, sequence: &Sequence) -> Result<bool> {
        let (counts, shutdown, bar) = (&self.document.lights, self.shutdown, &self.bar);
        let goes_on = || {
            bar.inc(1);
            !shutdown.is_requested()
        };
        match tables::of_sequence(origin, sequence, counts, goes_on)? {
            Some(table) => self.add(table, |document| &mut document.sequences),
            None => Ok(false),
        }
    }

    /// The means over the maps; of the thirteen that there are published figures for these too.
    fn means(&mut self, maps: &[Map], rows: &[stills::Row]) -> Result<()> {
        if maps.len() < 2 {
            return Ok(());
        }
        let command = command(self.arguments, maps.iter().filter_map(Map::words));
        let name = format!("geometric means over {} maps", maps.len());
        self.document.means = Table::mean(name, command.clone(), &self.document.maps);
        let lines = self.document.means.as_ref().map(Table::lines).unwrap_or_default();
        self.show(&lines)?;
        let lines = stills::mean_lines(rows, maps.len());
        if maps.len() == 13 && lines.len() > 1 {
            let title = "Single maps beside published figures".to_owned();
            self.show(&lines)?;
            self.document.texts.push(Text { title, command, lines });
        }
        self.save()
    }

    /// METHODS' table of the garden and the hall.
    fn published_sequences(&mut self) -> Result<bool> {
        let Some((garden, hall)) = self.arguments.garden.as_ref().zip(self.arguments.hall.as_ref()) else {
            return Ok(true);
        };
        self.bar.set_message("garden and hall, 128 lights");
        let read = |path: &PathBuf| super::panorama::read_panorama(path, sequence::SHAPE);
        let rows = sequence_table::measure(&read(garden)?, &read(hall)?)?;
        let (lines, title) =
            (sequence_table::lines(&rows), "Sequences beside published figures, 128 lights".to_owned());
        self.show(&lines)?;
        let command = self.of_garden_and_hall(String::new()).command;
        self.document.texts.push(Text { title, command, lines });
        self.save()?;
        Ok(self.goes_on())
    }

    fn of_garden_and_hall(&self, name: String) -> Origin {
        let mut origin = self.origin(name, None);
        for (option, path) in [("--garden", &self.arguments.garden), ("--hall", &self.arguments.hall)] {
            if let Some(path) = path {
                origin.command += &format!(" {option} {}", command::quoted(&path.to_string_lossy()));
            }
        }
        origin
    }

    fn origin(&self, name: String, words: Option<&std::path::Path>) -> Origin {
        Origin { name, command: command(self.arguments, words.into_iter()) }
    }

    /// Keeps a table and shows it; whether to go on.
    fn add(&mut self, table: Table, place: fn(&mut Document) -> &mut Vec<Table>) -> Result<bool> {
        self.show(&table.lines())?;
        tracing::info!("{}: measured", self.bar.message());
        place(&mut self.document).push(table);
        self.save()?;
        Ok(self.goes_on())
    }

    fn goes_on(&self) -> bool {
        self.is_read && !self.shutdown.is_requested()
    }

    /// Prints where tables are asked for.
    fn show(&mut self, lines: &[String]) -> Result<()> {
        if self.arguments.tables {
            self.is_read = PROGRESS.suspend(|| print(lines))?;
        }
        Ok(())
    }

    /// Writes the files of what is done so far.
    fn save(&self) -> Result<()> {
        if !self.arguments.tables {
            folder::write(&self.document, &self.arguments.output)?;
        }
        Ok(())
    }

    /// Says what was found, and where the page is.
    fn finish(&self) -> Result<()> {
        let document = &self.document;
        if !document.is_complete && self.is_read {
            tracing::warn!("not complete; what was measured until then is kept");
        }
        if self.arguments.tables {
            print(&document.findings())?;
            return Ok(());
        }
        if document.maps.is_empty() && document.sequences.is_empty() {
            return Ok(());
        }
        let page = folder::write(document, &self.arguments.output)?;
        let mut lines = document.findings();
        lines.push(page.display().to_string());
        print(&lines)?;
        Ok(())
    }
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
