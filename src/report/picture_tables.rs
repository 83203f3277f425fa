//! Error of pictures for a report: every method of single maps, with the built-in scene.

use super::pictures::{self, Pictures};
use super::stills::{METHODS, OURS, median_time};
use super::table::{Measure, Row, Table};
use super::tables::Origin;
use crate::error::Result;
use crate::image::PolarMap;
use crate::light::error::ListError;
use crate::light::{Extractor, LightList};
use crate::render;

/// What is measured of pictures.
pub const OF_PICTURES: [Measure; 2] = [
    Measure { key: "rms", name: "RMS / mean", ranked: true },
    Measure { key: "flip", name: "FLIP", ranked: true },
];

/// Settings of the pictures: 160 x 120 pixels, a shadow map for every light.
pub fn options() -> render::Options {
    pictures::options([160, 120], pictures::COUNTS[pictures::COUNTS.len() - 1])
}

/// All methods with those of `counts` that the renderer has shadow maps for; `goes_on` is asked after every picture.
/// `None` when it says no.
///
/// # Errors
/// Those of the device, and of [`Extractor::new`].
pub fn of_map(
    origin: Origin,
    pictures: &mut Pictures,
    map: &PolarMap,
    counts: &[usize],
    mut goes_on: impl FnMut() -> bool,
) -> Result<Option<Table>> {
    pictures.draw_reference(map, |_| ())?;
    let mut rows = Vec::new();
    for method in METHODS {
        for &count in counts.iter().filter(|&&count| count <= options().lights) {
            if !goes_on() {
                return Ok(None);
            }
            let mut extractor = Extractor::new(map.shape, &method.options(count))?;
            let mut list_error = ListError::new();
            let mut run = |list: &mut LightList| {
                extractor.step(map, list);
                list_error.measure(list);
            };
            let (mut judged, mut list) = (LightList::default(), LightList::default());
            (0..method.frames()).for_each(|_| run(&mut judged));
            let time = median_time(|| run(&mut list));
            let (rms, flip) = pictures.errors(&judged)?;
            rows.push(Row {
                method: method.name.to_owned(),
                lights: count,
                time_ms: time.as_secs_f64() * 1e3,
                values: vec![rms, flip],
                front: Vec::new(),
            });
        }
    }
    Ok(Some(Table::new(origin.name, origin.command, &OF_PICTURES, OURS, rows)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::Gpu;
    use crate::image::PolarShape;
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
        let counts = [4, 64, 100_000];
        let table = of_map(origin(), &mut pictures, &map, &counts, || true).unwrap().unwrap();
        assert_eq!(table.rows.len(), 2 * METHODS.len(), "more lights than shadow maps are left out");
        let of = |lights| table.rows.iter().find(|row| row.method == OURS && row.lights == lights).unwrap();
        assert!(of(64).values[0] < 0.5 * of(4).values[0] && of(64).values[1] < of(4).values[1], "{table:?}");
        assert!(of_map(origin(), &mut pictures, &map, &[4], || false).unwrap().is_none());
    }
}
