//! Pictures for a report.

use super::command::command;
use super::inputs::Map;
use super::making::Report;
use crate::error::Result;
use crate::gpu::{Backend, Gpu};
use crate::image::PolarShape;
use crate::report::frame_time::{heading, is_in_software};
use crate::report::picture_tables::{of_map, options};
use crate::report::pictures::Pictures;
use crate::report::table::Table;
use crate::report::tables::Origin;
use crate::scene::Scene;

/// Size of the maps: the reference has a light for every pixel.
const SHAPE: PolarShape = PolarShape::hemisphere(120, 30);

/// Draws the built-in scene under every map, where the arguments and the adapter allow it; whether to go on.
pub(super) fn measure(report: &mut Report, maps: &[Map]) -> Result<bool> {
    let is_wanted = report.arguments.pictures;
    if maps.is_empty() || (report.arguments.tables && !is_wanted) {
        return Ok(true);
    }
    let gpu = match Gpu::open(&Gpu::instance(Backend::Vulkan), None) {
        Ok(gpu) => gpu,
        Err(error) if is_wanted => return Err(error),
        Err(error) => {
            report.document.pictures_skipped = Some(format!("{error}."));
            return Ok(true);
        }
    };
    let adapter = heading(&gpu).swap_remove(0);
    if is_in_software(&gpu) && !is_wanted {
        report.document.pictures_skipped = Some(format!(
            "the only Vulkan adapter is a driver in software, {adapter}, which takes a minute or more a map. The same command \
             with --pictures draws them."
        ));
        return Ok(true);
    }
    report.document.machine.adapter = Some(adapter.clone());
    let mut pictures = Pictures::new(gpu, Scene::built_in(), &options())?;
    for map in maps {
        let Origin { name, command } = report.origin(map.name(), map.words());
        report.bar.set_message(format!("pictures under {name}"));
        let origin = Origin { name, command: with_pictures(&command) };
        let (counts, shutdown) = (report.document.lights.clone(), report.shutdown);
        let goes_on = || !shutdown.is_requested();
        let Some(mut table) = of_map(origin, &mut pictures, &map.read(SHAPE)?, &counts, goes_on)? else {
            return Ok(false);
        };
        table.notes = format!(
            "The built-in scene in {} x {} pixels, maps of {} x {}; drawn by {adapter}. The time is that of the lights, not \
             of the picture.",
            options().width_px,
            options().height_px,
            SHAPE.columns,
            SHAPE.rows
        );
        if !report.add(table, |document| &mut document.pictures)? {
            return Ok(false);
        }
    }
    if maps.len() > 1 {
        let name = format!("geometric means over pictures under {} maps", maps.len());
        let command = with_pictures(&command(report.arguments, maps.iter().filter_map(Map::words)));
        report.document.picture_means = Table::mean(name, command, &report.document.pictures);
        let lines = report.document.picture_means.as_ref().map(Table::lines).unwrap_or_default();
        report.show(&lines)?;
    }
    Ok(report.goes_on())
}

fn with_pictures(command: &str) -> String {
    command.replacen("--tables", "--tables --pictures", 1)
}
