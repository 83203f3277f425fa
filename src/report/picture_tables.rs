//! Error of pictures for a report: every method of single maps, with the built-in scene.

use super::pictures::{self, Pictures};
use super::stills::timed_list;
use super::table::{Measure, Row, Table};
use super::tables::Origin;
use crate::compare::still_methods::{METHODS, OURS};
use crate::error::Result;
use crate::render;
use lightcast_core::image::{PolarMap, PolarShape};

/// The measures of pictures.
pub const OF_PICTURES: [Measure; 2] = [
    Measure { key: "rms", name: "image error (RMS)", ranked: true },
    Measure { key: "flip", name: "image error (FLIP)", ranked: true },
];

/// Default numbers of lights of the pictures: powers of four, because a picture has to be drawn for each.
pub const COUNTS: [usize; 4] = [4, 16, 64, 256];

/// Size of the maps: the reference has a light for every pixel.
pub const SHAPE: PolarShape = PolarShape::hemisphere(120, 30);

/// Columns and rows of the pictures.
pub const SIZE: [u32; 2] = [160, 120];

/// The most lights of a picture, each of which has a shadow map.
pub const MOST_LIGHTS: usize = pictures::COUNTS[pictures::COUNTS.len() - 1];

/// Settings of pictures of at most `lights` lights, with a shadow map for every one, and at least 256: the
/// reference is drawn in passes of as many lights. There are no more, because a driver in software clears all
/// of them for every picture, and some versions of Mesa's never free memory that grows with their number.
pub fn options(lights: usize) -> render::Options {
    pictures::options(SIZE, lights.max(256))
}

/// All methods with these numbers of lights, at most [`MOST_LIGHTS`]. `goes_on` is called after every picture
/// and while the reference is drawn; `None` when it returns false. `row_done` is called after every row.
///
/// # Errors
/// Those of the device, and of [`timed_list`].
pub fn of_map(
    origin: Origin,
    pictures: &mut Pictures,
    map: &PolarMap,
    counts: &[usize],
    goes_on: impl Fn() -> bool,
    mut row_done: impl FnMut(),
) -> Result<Option<Table>> {
    if !pictures.draw_reference(map, |_| goes_on())? {
        return Ok(None);
    }
    let mut rows = Vec::new();
    for method in METHODS {
        for &count in counts {
            if !goes_on() {
                return Ok(None);
            }
            let (list, time) = timed_list(&method, map, count)?;
            let (rms, flip) = pictures.errors(&list)?;
            rows.push(Row {
                method: method.name.to_owned(),
                lights: count,
                time_ms: time.as_secs_f64() * 1e3,
                values: vec![rms, flip],
                front: Vec::new(),
            });
            row_done();
        }
    }
    Ok(Some(Table::new(origin.name, origin.command, &OF_PICTURES, OURS, rows)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::Gpu;
    use crate::scene::Scene;

    #[test]
    fn pictures_of_more_lights_are_nearer_to_the_reference() {
        let Some(gpu) = Gpu::for_test() else { return };
        let map = PolarMap::from_fn(PolarShape::hemisphere(48, 12), |row, column| {
            let is_lamp = row.abs_diff(5) < 2 && column.abs_diff(12) < 3;
            if is_lamp { [60.0, 55.0, 40.0] } else { [1.0, 1.2, 0.1 * row as f32] }
        });
        let mut pictures = Pictures::new(gpu, Scene::built_in(), &pictures::options([64, 48], 72)).unwrap();
        let origin = || Origin { name: "map".to_owned(), command: String::new() };
        let mut done = 0;
        let table = of_map(origin(), &mut pictures, &map, &[4, 64], || true, || done += 1).unwrap().unwrap();
        assert_eq!((table.rows.len(), done), (2 * METHODS.len(), 2 * METHODS.len()));
        let of = |lights| table.rows.iter().find(|row| row.method == OURS && row.lights == lights).unwrap();
        assert!(of(64).values[0] < 0.5 * of(4).values[0] && of(64).values[1] < of(4).values[1], "{table:?}");
        // The reference has eight passes; nothing is kept of a table that is stopped in one of them, or
        // later.
        for limit in [0, 3, 8, 10] {
            let asked = std::cell::Cell::new(0);
            let goes_on = || asked.replace(asked.get() + 1) < limit;
            let stopped = of_map(origin(), &mut pictures, &map, &[4], goes_on, || ()).unwrap();
            assert!(stopped.is_none() && asked.get() == limit + 1, "{limit}: {}", asked.get());
        }
    }
}
