//! Measures one input after another and keeps what is done.

use super::command::{command_line, of_maps, of_sequence};
use super::inputs::{Inputs, Made, Map, Moving};
#[cfg(feature = "render")]
use super::pictures::{Drawing, with_pictures};
use super::{Arguments, print};
use crate::cli::messages::PROGRESS;
use crate::cli::progress::Progress;
use crate::compare::sequence_methods::{LIGHTS, SequenceMethod, is_published};
use crate::compare::stability;
use crate::compare::still_methods::{METHODS, are_published};
use crate::error::Result;
use crate::report::document::{Document, Text};
use crate::report::table::Table;
use crate::report::tables::{self, Origin};
use crate::report::{folder, sequence_table, stills};
use crate::rt::Shutdown;
use std::path::Path;

/// A report that is being made.
pub(super) struct Report<'a> {
    arguments: &'a Arguments,
    shutdown: &'a Shutdown,
    progress: Progress,
    document: Document,
    /// Draws pictures, where any are wanted.
    #[cfg(feature = "render")]
    drawing: Option<Drawing>,
    is_read: bool,
}

impl<'a> Report<'a> {
    pub fn new(arguments: &'a Arguments, shutdown: &'a Shutdown) -> Self {
        let mut counts = arguments.lights.clone();
        counts.sort_unstable();
        counts.dedup();
        Self {
            arguments,
            shutdown,
            progress: Progress::in_percent(0),
            document: Document::new(command_line(), counts),
            #[cfg(feature = "render")]
            drawing: None,
            is_read: true,
        }
    }

    /// Opens all inputs and the device that draws pictures; `None` when it was interrupted.
    pub fn open(&mut self) -> Result<Option<Inputs>> {
        let reading = |name: &str| self.progress.set_message(format!("reading {name}"));
        let inputs = Inputs::open(self.arguments, self.shutdown, reading);
        // An error is printed below the bar.
        let Some(inputs) = inputs.inspect_err(|_| self.progress.finish())? else {
            self.progress.finish();
            return Ok(None);
        };
        let counts = self.document.lights.len();
        let rows = inputs.maps.len() * METHODS.len() * counts
            + inputs.sequences.len() * SequenceMethod::ALL.len() * counts;
        #[cfg(feature = "render")]
        let rows = {
            self.drawing = Drawing::open(self.arguments, &mut self.document, inputs.maps.len())
                .inspect_err(|_| self.progress.finish())?;
            rows + self.drawing.as_ref().map_or(0, |drawing| drawing.rows(inputs.maps.len()))
        };
        #[cfg(not(feature = "render"))]
        {
            self.document.pictures_skipped =
                Some("this program was built without its renderer (feature `render`).".to_owned());
        }
        self.progress.set_length(rows as u64);
        Ok(Some(inputs))
    }

    /// Whether everything was measured; false when it was interrupted, or nobody reads the tables any more.
    pub fn measure(&mut self, inputs: &mut Inputs) -> Result<bool> {
        let mut rows = Vec::new();
        for (done, map) in (1..).zip(&inputs.maps) {
            let origin = self.origin_of_map(map);
            self.progress.set_message(format!("map {}", origin.name));
            let (counts, shutdown, progress) = (&self.document.lights, self.shutdown, &self.progress);
            let goes_on = || {
                progress.inc(1);
                !shutdown.is_requested()
            };
            let Some((table, of_map)) = tables::of_map(origin, map.for_lights(), counts, goes_on)? else {
                return Ok(false);
            };
            rows.extend(of_map);
            let command = of_maps(self.arguments, inputs.maps[..done].iter());
            if !self.add(table.lines(), |document| document.add_map(table, command))? {
                return Ok(false);
            }
        }
        if !self.means(&inputs.maps, &rows)? {
            return Ok(false);
        }
        let mut published = Vec::new();
        for moving in &mut inputs.sequences {
            if !self.sequence(moving, &mut published)? {
                return Ok(false);
            }
        }
        if !self.published_sequences(inputs, &published)? || !self.hard_cases()? {
            return Ok(false);
        }
        #[cfg(feature = "render")]
        if let Some(drawing) = self.drawing.take() {
            return self.pictures(drawing, &inputs.maps);
        }
        Ok(true)
    }

    /// Draws under every map; whether to go on.
    #[cfg(feature = "render")]
    fn pictures(&mut self, mut drawing: Drawing, maps: &[Map]) -> Result<bool> {
        for (done, map) in (1..).zip(maps) {
            let origin = self.origin_of_map(map);
            self.progress.set_message(format!("pictures under {}", origin.name));
            let (shutdown, progress) = (self.shutdown, &self.progress);
            let Some(table) = drawing.draw(origin, map, || !shutdown.is_requested(), || progress.inc(1))?
            else {
                return Ok(false);
            };
            let command = with_pictures(&of_maps(self.arguments, maps[..done].iter()));
            if !self.add(table.lines(), |document| document.add_pictures(table, command))? {
                return Ok(false);
            }
        }
        let lines = self.document.picture_means.as_ref().map(Table::lines).unwrap_or_default();
        self.show(&lines)?;
        Ok(self.goes_on())
    }

    /// The table of a sequence; its rows beside published figures, where it has these, are added to
    /// `published`.
    fn sequence(&mut self, moving: &mut Moving, published: &mut Vec<sequence_table::Row>) -> Result<bool> {
        let name = moving.name();
        self.progress.set_message(format!("reading {name}"));
        let Some(sequence) = moving.read(self.arguments, self.shutdown)? else { return Ok(false) };
        self.progress.set_message(format!("sequence {name}"));
        let origin = Origin { name, command: of_sequence(self.arguments, moving) };
        let (shutdown, progress) = (self.shutdown, &self.progress);
        let goes_on = || !shutdown.is_requested();
        let counts = &self.document.lights;
        let Some((table, known)) =
            tables::of_sequence(origin, &sequence, counts, &goes_on, || progress.inc(1))?
        else {
            return Ok(false);
        };
        if !self.add(table.lines(), |document| document.sequences.push(table))? {
            return Ok(false);
        }
        if let Moving::Made(Made { name, path, .. }) = moving
            && is_published(name, &stem(path))
        {
            let Some(rows) = sequence_table::rows(name, &sequence, &known, &goes_on)? else {
                return Ok(false);
            };
            published.extend(rows);
        }
        Ok(true)
    }

    /// The means over the maps, and for the thirteen with published figures those figures too. Returns
    /// whether to go on.
    fn means(&mut self, maps: &[Map], rows: &[stills::Row]) -> Result<bool> {
        let lines = self.document.means.as_ref().map(Table::lines).unwrap_or_default();
        self.show(&lines)?;
        let names: Vec<String> = maps.iter().filter_map(|map| map.path.as_deref().map(stem)).collect();
        let lines = stills::mean_lines(rows);
        if are_published(&names) && lines.len() > 1 {
            let title = "Single maps beside published figures".to_owned();
            self.show(&lines)?;
            let command = of_maps(self.arguments, maps.iter());
            self.document.texts.push(Text { title, command, lines });
        }
        self.save()?;
        Ok(self.goes_on())
    }

    /// METHODS' table of the garden and the hall.
    fn published_sequences(&mut self, inputs: &Inputs, rows: &[sequence_table::Row]) -> Result<bool> {
        let made = inputs.sequences.iter().find(|moving| matches!(moving, Moving::Made(_)));
        if let Some(made) = made.filter(|_| !rows.is_empty()) {
            let lines = sequence_table::lines(rows);
            self.show(&lines)?;
            let title = format!("Sequences beside published figures, {} lights", LIGHTS);
            let command = of_sequence(self.arguments, made);
            self.document.texts.push(Text { title, command, lines });
            self.save()?;
        }
        Ok(self.goes_on())
    }

    /// On the page only: they do not depend on the inputs and have an option of their own.
    fn hard_cases(&mut self) -> Result<bool> {
        if !self.arguments.tables {
            self.progress.set_message("hard cases");
            self.document.stability = stability::measure(|| !self.shutdown.is_requested())?;
            self.save()?;
        }
        Ok(self.goes_on())
    }

    fn origin_of_map(&self, map: &Map) -> Origin {
        Origin { name: map.name.clone(), command: of_maps(self.arguments, std::iter::once(map)) }
    }

    /// Shows a table's lines and keeps it; whether to go on.
    fn add(&mut self, lines: Vec<String>, keep: impl FnOnce(&mut Document)) -> Result<bool> {
        self.show(&lines)?;
        tracing::info!("{}: measured", self.progress.message());
        keep(&mut self.document);
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
    pub fn finish(&mut self, is_complete: bool) -> Result<()> {
        self.progress.finish();
        self.document.is_complete = is_complete;
        let document = &self.document;
        let is_empty = document.maps.is_empty() && document.sequences.is_empty();
        if !document.is_complete && self.is_read {
            let kept = match (is_empty, self.arguments.tables) {
                (true, _) => "no map or sequence was measured to its end, and there is no report",
                (false, true) => "the tables are those of what was measured until then",
                (false, false) => "what was measured until then is kept",
            };
            tracing::warn!("not complete; {kept}");
        }
        if self.arguments.tables {
            print(&document.findings())?;
            return Ok(());
        }
        if is_empty {
            return Ok(());
        }
        let page = folder::write(document, &self.arguments.output)?;
        let mut lines = document.findings();
        lines.push(page.display().to_string());
        print(&lines)?;
        Ok(())
    }
}

/// A file's name without its extension.
fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
