//! Error of pictures against the number of lights, as figure 6 of Havran et al. 2005 shows it, with numbers.

use super::frame_time::Timed;
use super::picture_error::{mean_flip, relative_rms};
use super::stills::geometric_mean;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::picture::{Panel, Plot, Series};
use crate::render::{self, emitters};
use crate::scene::Scene;
use lightcast_core::image::PolarMap;
use lightcast_core::light::{self, Extractor, LightList, Sampler};
use std::time::Duration;

/// Numbers of lights.
pub const COUNTS: [usize; 8] = [4, 8, 16, 32, 64, 128, 256, 512];
/// How a map becomes lights, and the names of these methods.
pub const SAMPLERS: [(&str, Sampler); 2] =
    [("equal power", Sampler::EqualPower), ("refined", Sampler::Refined)];
/// Time for the frames of one list: short, as there are many lists.
const BUDGET: Duration = Duration::from_millis(300);

/// One list of lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// [`relative_rms`] of radiance.
    pub rms: f64,
    /// [`mean_flip`].
    pub flip: f64,
    /// Median time of a frame.
    pub frame: Duration,
}

/// A scene under a map, with one number of lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Lights.
    pub count: usize,
    /// For each of [`SAMPLERS`].
    pub figures: [Figures; SAMPLERS.len()],
}

/// A scene under a map.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// The scene's name.
    pub scene: String,
    /// The map's name.
    pub map: String,
    /// One for each of [`COUNTS`].
    pub rows: Vec<Row>,
}

/// Sizes and shadow maps of the pictures; everything else is as in `lightcast render`, except that glossy
/// surfaces have no longer list (set L): there are only N lights. Fewer shadow maps than lights leave an
/// error that no number of lights removes.
pub fn options(size: [u32; 2], shadow_maps: usize) -> render::Options {
    render::Options {
        width_px: size[0],
        height_px: size[1],
        directional: render::DirectionalOptions {
            lights: COUNTS[COUNTS.len() - 1],
            shadow_maps,
            cone_rad: 0.0,
            ..render::DirectionalOptions::default()
        },
        ..render::Options::default()
    }
}

/// Measures one scene under one map after another.
pub struct Pictures {
    timed: Timed,
    reference: Vec<[f32; 4]>,
    picture: Vec<[f32; 4]>,
}

impl Pictures {
    /// Puts the scene on the device.
    ///
    /// # Errors
    /// As [`render::Renderer::new`].
    pub fn new(gpu: Gpu, scene: Scene, options: &render::Options) -> Result<Self> {
        Ok(Self { timed: Timed::new(gpu, scene, options)?, reference: Vec::new(), picture: Vec::new() })
    }

    /// Errors against the picture that has every pixel of `map` as a light with a shadow map of its own, and
    /// frame times. The samplers take turns, so that other load on the machine affects both. `progress` is
    /// called with the share of the reference that is drawn, which takes most of the time.
    ///
    /// # Errors
    /// Those of the device, and of [`Extractor::new`].
    pub fn measure(&mut self, map: &PolarMap, mut progress: impl FnMut(f64)) -> Result<Vec<Row>> {
        self.draw_reference(map, |share| {
            progress(share);
            true
        })?;
        let mut list = LightList::default();
        let mut rows = Vec::new();
        for count in COUNTS {
            let mut figures = [Figures { rms: 0.0, flip: 0.0, frame: Duration::ZERO }; SAMPLERS.len()];
            for ((_, sampler), figures) in SAMPLERS.into_iter().zip(&mut figures) {
                let options = light::Options { count, sampler, ..light::Options::default() };
                Extractor::new(map.shape, &options)?.extract(map, &mut list);
                *figures = self.figures(&list)?;
            }
            rows.push(Row { count, figures });
        }
        Ok(rows)
    }

    /// Draws the picture that has every pixel of `map` as a light with a shadow map of its own, which later
    /// ones are compared with. `goes_on` is called repeatedly, with the share that is drawn. Returns false if
    /// it returned false, so that there is no reference.
    ///
    /// # Errors
    /// Those of the device.
    pub fn draw_reference(&mut self, map: &PolarMap, mut goes_on: impl FnMut(f64) -> bool) -> Result<bool> {
        let emitters = emitters(map);
        let Timed { renderer, camera, .. } = &mut self.timed;
        let share = |done| done as f64 / emitters.len().max(1) as f64;
        let is_whole = renderer.draw_reference(&emitters, camera, 1, |done| goes_on(share(done)))?;
        if is_whole {
            renderer.read_radiance(&mut self.reference)?;
        }
        Ok(is_whole)
    }

    /// [`relative_rms`] and [`mean_flip`] of the picture under these lights against the reference drawn last.
    ///
    /// # Errors
    /// Those of the device.
    pub fn errors(&mut self, list: &LightList) -> Result<(f64, f64)> {
        let Timed { renderer, camera, .. } = &mut self.timed;
        renderer.release_shadow_maps();
        renderer.draw(&list.lights, camera, 1)?;
        self.compare()
    }

    fn figures(&mut self, list: &LightList) -> Result<Figures> {
        let time = self.timed.measure(&list.lights, BUDGET)?;
        let (rms, flip) = self.compare()?;
        Ok(Figures { rms, flip, frame: time.frame })
    }

    fn compare(&mut self) -> Result<(f64, f64)> {
        self.timed.renderer.read_radiance(&mut self.picture)?;
        Ok((
            relative_rms(&self.reference, &self.picture),
            mean_flip(&self.reference, &self.picture, self.timed.renderer.size()[0]),
        ))
    }
}

/// Geometric means over measurements, for each of [`COUNTS`] that has any.
pub fn means<'a>(measured: impl Iterator<Item = &'a Measured> + Clone) -> Vec<Row> {
    let mut means = Vec::new();
    for count in COUNTS {
        let rows = measured.clone().flat_map(|measured| &measured.rows).filter(|row| row.count == count);
        if rows.clone().next().is_none() {
            continue;
        }
        let figures = std::array::from_fn(|sampler| {
            let mean = |pick: fn(&Figures) -> f64| {
                geometric_mean(rows.clone().map(|row| pick(&row.figures[sampler])))
            };
            Figures {
                rms: mean(|figures| figures.rms),
                flip: mean(|figures| figures.flip),
                frame: Duration::from_secs_f64(mean(|figures| figures.frame.as_secs_f64())),
            }
        });
        means.push(Row { count, figures });
    }
    means
}

/// Lines for rows under a title, header first; above it the adapter, as
/// [`heading`](super::frame_time::heading) has it.
pub fn lines(adapter: &str, title: &str, rows: &[Row]) -> Vec<String> {
    let [first, second] = SAMPLERS.map(|(name, _)| format!("{name:^28}"));
    let columns = format!("{:>9} {:>9} {:>8}", "RMS", "FLIP", "ms");
    let mut lines = vec![
        adapter.to_owned(),
        format!("{title:<44} {first}  {second}"),
        format!("{:>44} {columns}  {columns}", "lights"),
    ];
    lines.extend(rows.iter().map(|row| {
        let [first, second] = row.figures.map(|Figures { rms, flip, frame }| {
            format!("{rms:>9.4} {flip:>9.4} {:>8.1}", frame.as_secs_f64() * 1e3)
        });
        format!("{:>44} {first}  {second}", row.count)
    }));
    lines
}

/// Geometric means against the number of lights: RMS and FLIP over everything, then RMS over the scenes under
/// each map. `title` says what the pictures are.
pub fn plot(title: &str, measured: &[Measured]) -> Plot {
    let panel = |title: String, y_label: &str, rows: Vec<Row>, pick: fn(&Figures) -> f64| Panel {
        title,
        x_label: "lights".to_owned(),
        y_label: y_label.to_owned(),
        series: (0..SAMPLERS.len())
            .map(|sampler| Series {
                name: SAMPLERS[sampler].0.to_owned(),
                points: rows.iter().map(|row| (row.count as f64, pick(&row.figures[sampler]))).collect(),
            })
            .collect(),
        ..Panel::default()
    };
    let (rms, flip) = ("RMS / mean", "FLIP");
    let all = means(measured.iter());
    let mut panels = vec![
        panel(format!("all {}: RMS", measured.len()), rms, all.clone(), |figures| figures.rms),
        panel(format!("all {}: FLIP", measured.len()), flip, all, |figures| figures.flip),
    ];
    let mut maps: Vec<&str> = Vec::new();
    for Measured { map, .. } in measured {
        if !maps.contains(&map.as_str()) {
            maps.push(map);
        }
    }
    panels.extend(maps.into_iter().map(|map| {
        let rows = means(measured.iter().filter(|measured| measured.map == map));
        panel(map.to_owned(), rms, rows, |figures| figures.rms)
    }));
    Plot { title: title.to_owned(), panels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::image::PolarShape;

    fn measured(map: &str, error: f64) -> Measured {
        let figures =
            |error: f64| Figures { rms: error, flip: 0.5 * error, frame: Duration::from_secs_f64(error) };
        let rows = COUNTS
            .map(|count| Row { count, figures: [figures(error), figures(0.1 * error)] })
            .into_iter()
            .collect();
        Measured { scene: "scene".to_owned(), map: map.to_owned(), rows }
    }

    #[test]
    fn means_are_geometric_and_of_each_number_of_lights() {
        let all = [measured("a", 0.01), measured("b", 0.0001)];
        let rows = means(all.iter());
        assert_eq!(rows.iter().map(|row| row.count).collect::<Vec<_>>(), COUNTS);
        let [equal_power, refined] = rows[3].figures;
        assert!((equal_power.rms - 0.001).abs() < 1e-12 && (refined.flip - 0.00005).abs() < 1e-12);
        assert_eq!(equal_power.frame, Duration::from_millis(1));
        assert!(means([].iter()).is_empty());
    }

    #[test]
    fn tables_have_a_row_and_plots_a_point_for_each_number_of_lights() {
        let all = [measured("a", 0.01), measured("b", 0.0001), measured("a", 0.04)];
        let lines = lines("an adapter", "scene, a", &all[0].rows);
        assert_eq!((lines.len(), lines[0].as_str()), (3 + COUNTS.len(), "an adapter"));
        let cells: Vec<&str> = lines[10].split_whitespace().collect();
        assert_eq!(cells, ["512", "0.0100", "0.0050", "10.0", "0.0010", "0.0005", "1.0"]);
        let plot = plot("errors", &all);
        let titles: Vec<&str> = plot.panels.iter().map(|panel| panel.title.as_str()).collect();
        assert_eq!(titles, ["all 3: RMS", "all 3: FLIP", "a", "b"]);
        let of_a = &plot.panels[2].series[0];
        assert_eq!((of_a.name.as_str(), of_a.points.len()), ("equal power", COUNTS.len()));
        assert!((of_a.points[0].1 - 0.02).abs() < 1e-12);
    }

    #[test]
    fn more_lights_and_refined_ones_are_nearer_to_the_reference() {
        let Some(gpu) = Gpu::for_test() else { return };
        let map = PolarMap::from_fn(PolarShape::hemisphere(48, 12), |row, column| {
            let is_lamp = row.abs_diff(5) < 2 && column.abs_diff(12) < 3;
            if is_lamp { [60.0, 55.0, 40.0] } else { [1.0, 1.2, 0.1 * row as f32] }
        });
        let mut pictures = Pictures::new(gpu, Scene::built_in(), &options([64, 48], 72)).unwrap();
        let mut shares = Vec::new();
        let rows = pictures.measure(&map, |share| shares.push(share)).unwrap();
        lines("", "built-in", &rows).iter().for_each(|line| println!("{line}"));
        assert_eq!(shares.len(), (48 * 12usize).div_ceil(72));
        assert_eq!(shares.last(), Some(&1.0));
        for sampler in 0..2 {
            let [few, many] = [0, 5].map(|at| rows[at].figures[sampler]);
            assert!(many.rms < 0.5 * few.rms && many.flip < 0.7 * few.flip, "{few:?} {many:?}");
        }
        let [equal_power, refined] = rows[4].figures;
        assert!(refined.rms < equal_power.rms, "{equal_power:?} {refined:?}");
    }
}
