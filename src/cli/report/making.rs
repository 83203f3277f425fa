//! Measures one input after another and keeps what is done.

use super::command::{command, command_line, quoted};
use super::inputs::{Inputs, Map, Moving};
#[cfg(feature = "render")]
use super::pictures;
use super::{Arguments, print};
use crate::cli::messages::PROGRESS;
use crate::cli::panorama::read_panorama;
use crate::error::Result;
use crate::report::document::{Document, Text};
use crate::report::sequence::{self, Sequence};
use crate::report::table::Table;
use crate::report::tables::{self, Origin};
use crate::report::{folder, sequence_table, stability, stills};
use crate::rt::Shutdown;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};

/// A report that is being made.
pub(super) struct Report<'a> {
    pub arguments: &'a Arguments,
    pub shutdown: &'a Shutdown,
    pub bar: ProgressBar,
    pub document: Document,
    is_read: bool,
}

impl<'a> Report<'a> {
    pub fn new(arguments: &'a Arguments, shutdown: &'a Shutdown, inputs: &Inputs) -> Self {
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
    pub fn measure(&mut self, inputs: &Inputs) -> Result<bool> {
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
        if !self.published_sequences()? || !self.hard_cases()? {
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
        let read = |path: &PathBuf| read_panorama(path, sequence::SHAPE);
        let rows = sequence_table::measure(&read(garden)?, &read(hall)?)?;
        let (lines, title) =
            (sequence_table::lines(&rows), "Sequences beside published figures, 128 lights".to_owned());
        self.show(&lines)?;
        let command = self.of_garden_and_hall(String::new()).command;
        self.document.texts.push(Text { title, command, lines });
        self.save()?;
        Ok(self.goes_on())
    }

    /// On the page only: they do not depend on the inputs and have an option of their own.
    fn hard_cases(&mut self) -> Result<bool> {
        if !self.arguments.tables {
            self.bar.set_message("hard cases");
            self.document.stability = stability::measure()?;
            self.save()?;
        }
        Ok(self.goes_on())
    }

    fn of_garden_and_hall(&self, name: String) -> Origin {
        let mut origin = self.origin(name, None);
        for (option, path) in [("--garden", &self.arguments.garden), ("--hall", &self.arguments.hall)] {
            if let Some(path) = path {
                origin.command += &format!(" {option} {}", quoted(&path.to_string_lossy()));
            }
        }
        origin
    }

    pub fn origin(&self, name: String, words: Option<&Path>) -> Origin {
        Origin { name, command: command(self.arguments, words.into_iter()) }
    }

    /// Keeps a table and shows it; whether to go on.
    pub fn add(&mut self, table: Table, place: fn(&mut Document) -> &mut Vec<Table>) -> Result<bool> {
        self.show(&table.lines())?;
        tracing::info!("{}: measured", self.bar.message());
        place(&mut self.document).push(table);
        self.save()?;
        Ok(self.goes_on())
    }

    pub fn goes_on(&self) -> bool {
        self.is_read && !self.shutdown.is_requested()
    }

    /// Prints where tables are asked for.
    pub fn show(&mut self, lines: &[String]) -> Result<()> {
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
    pub fn finish(&mut self, is_complete: bool) -> Result<()> {
        self.bar.finish_and_clear();
        self.document.is_complete = is_complete;
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
