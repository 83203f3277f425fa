//! Pictures for a report.

use super::Arguments;
use super::inputs::Map;
use crate::compare::still_methods::METHODS;
use crate::error::Result;
use crate::gpu::{Backend, Gpu};
use crate::report::document::Document;
use crate::report::frame_time::{heading, is_in_software};
use crate::report::picture_tables::{self, MOST_LIGHTS, SHAPE, SIZE, of_map, options};
use crate::report::pictures::Pictures;
use crate::report::table::Table;
use crate::report::tables::{self, Origin};
use crate::scene::Scene;

/// The renderer of the built-in scene.
pub(super) struct Drawing {
    pictures: Pictures,
    /// The adapter's name.
    adapter: String,
    /// Numbers of lights.
    counts: Vec<usize>,
}

impl Drawing {
    /// Opens the device, where the arguments and the adapter allow pictures; otherwise says why in the
    /// document.
    pub fn open(arguments: &Arguments, document: &mut Document, map_count: usize) -> Result<Option<Self>> {
        let Arguments { pictures: is_wanted, tables, .. } = *arguments;
        if map_count == 0 || (tables && !is_wanted) {
            return Ok(None);
        }
        let gpu = match Gpu::open(&Gpu::instance(Backend::Vulkan), None) {
            Ok(gpu) => gpu,
            Err(error) if is_wanted => return Err(error),
            Err(error) => {
                document.pictures_skipped = Some(format!("{error}."));
                return Ok(None);
            }
        };
        let adapter = heading(&gpu).swap_remove(0);
        if is_in_software(&gpu) && !is_wanted {
            document.pictures_skipped = Some(format!(
                "the only Vulkan adapter is a driver in software, {adapter}, which takes half a minute or more a map. The \
                 same command with --pictures draws them."
            ));
            return Ok(None);
        }
        let all = &document.lights;
        let counts = if *all == tables::COUNTS {
            picture_tables::COUNTS.to_vec()
        } else {
            all.iter().copied().filter(|&count| count <= MOST_LIGHTS).collect()
        };
        if counts.is_empty() {
            document.pictures_skipped =
                Some(format!("they have at most {MOST_LIGHTS} lights, and more were asked for."));
            return Ok(None);
        }
        document.machine.adapter = Some(adapter.clone());
        let most = counts.iter().copied().max().unwrap_or(MOST_LIGHTS);
        let pictures = Pictures::new(gpu, Scene::built_in(), &options(most))?;
        Ok(Some(Self { pictures, adapter, counts }))
    }

    /// Rows of all tables together.
    pub fn rows(&self, map_count: usize) -> usize {
        map_count * METHODS.len() * self.counts.len()
    }

    /// Draws under a map; `None` when `goes_on` says no. `step` is called after every picture.
    pub fn draw(
        &mut self,
        origin: Origin,
        map: &Map,
        goes_on: impl Fn() -> bool,
        step: impl Fn(),
    ) -> Result<Option<Table>> {
        let origin = Origin { command: with_pictures(&origin.command), ..origin };
        let (pictures, pixels) = (&mut self.pictures, map.for_pictures());
        let Some(mut table) = of_map(origin, pictures, pixels, &self.counts, goes_on, step)? else {
            return Ok(None);
        };
        table.notes = format!(
            "The built-in scene in {} x {} pixels, maps of {} x {}, at most {MOST_LIGHTS} lights; drawn by {}. The time is \
             that of the lights, not of the picture.",
            SIZE[0],
            SIZE[1],
            SHAPE.columns(),
            SHAPE.rows(),
            self.adapter
        );
        Ok(Some(table))
    }
}

/// The command that prints tables of pictures, made from one that prints those of lights.
pub(super) fn with_pictures(command: &str) -> String {
    command.replacen("--tables", "--tables --pictures", 1)
}
