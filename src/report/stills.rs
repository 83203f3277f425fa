//! Error and time of the lights of single maps: the table of METHODS section 6.

use crate::error::Result;
use crate::image::{PolarMap, PolarShape, luminance_f64};
use crate::light::error::ListError;
use crate::light::measure::{Errors, Reference};
use crate::light::{Extractor, Inversion, LightList, Options, Sampler};
use std::time::{Duration, Instant};

/// Size of the maps that the published figures are given for.
pub const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);
/// Numbers of lights in the table.
pub const COUNTS: [usize; 2] = [64, 256];
/// Extractions of which the median time is reported: at least so many, ...
const LEAST_RUNS: usize = 3;
/// ... at most so many, ...
const MOST_RUNS: usize = 25;
/// ... and no more once they have taken so long together.
const BUDGET: Duration = Duration::from_millis(100);

/// A way from a map to lights, with its row of METHODS section 6 where it has one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Method {
    /// How it is called in the table.
    pub name: &'static str,
    sampler: Sampler,
    inversion: Inversion,
    /// Geometric means over the thirteen maps, at [`COUNTS`] lights, from a float64 reference model.
    pub published: Option<[Errors; 2]>,
}

/// The panoramas that the published means are over, by their names without extension.
const PUBLISHED_MAPS: [&str; 13] = [
    "autoshop_01_1k",
    "brown_photostudio_02_1k",
    "chinese_garden_1k",
    "dancing_hall_1k",
    "dikhololo_night_1k",
    "forest_slope_1k",
    "noon_grass_1k",
    "potsdamer_platz_1k",
    "quarry_01_1k",
    "st_fagans_interior_1k",
    "st_peters_square_night_1k",
    "studio_small_03_1k",
    "venice_sunset_1k",
];

/// Whether these names, without extensions, are those of the panoramas that there are published means of.
pub fn are_published(names: &[String]) -> bool {
    names.len() == PUBLISHED_MAPS.len()
        && PUBLISHED_MAPS.iter().all(|own| names.iter().any(|name| name == own))
}

/// How many times the published figure a mean may be.
pub const LIMIT: f64 = 1.15;

const fn errors(shadow: f64, irradiance: f64, glossy: f64) -> Errors {
    Errors { irradiance, shadow, glossy }
}

/// A method with the default inversion.
const fn method(name: &'static str, sampler: Sampler, published: Option<[Errors; 2]>) -> Method {
    Method { name, sampler, inversion: Inversion::Bicontinuous, published }
}

/// The methods of the table.
pub const METHODS: [Method; 9] = [
    Method {
        inversion: Inversion::Standard,
        ..method(
            "standard",
            Sampler::EqualPower,
            Some([errors(0.0324, 0.0410, 0.216), errors(0.0110, 0.0159, 0.081)]),
        )
    },
    Method {
        inversion: Inversion::NormalisedRows,
        ..method(
            "bicontinuous, the paper's",
            Sampler::EqualPower,
            Some([errors(0.0222, 0.0611, 0.283), errors(0.0068, 0.0191, 0.099)]),
        )
    },
    method(
        "bicontinuous",
        Sampler::EqualPower,
        Some([errors(0.0213, 0.0606, 0.280), errors(0.0062, 0.0173, 0.088)]),
    ),
    method("structured", Sampler::Structured, None),
    method(
        "median cut",
        Sampler::MedianCut,
        Some([errors(0.0104, 0.0062, 0.0668), errors(0.0021, 0.00114, 0.0094)]),
    ),
    method("variance minimisation", Sampler::VarianceMinimisation, None),
    method(
        "refined",
        Sampler::Refined,
        Some([errors(0.0060, 0.0031, 0.0311), errors(0.0014, 0.00066, 0.0051)]),
    ),
    // METHODS' row is that of refined lights after eight passes, close to this.
    method(
        "Kollig-Keller",
        Sampler::KolligKeller,
        Some([errors(0.0048, 0.0023, 0.0184), errors(0.00115, 0.00051, 0.0034)]),
    ),
    method("adaptive", Sampler::Adaptive, None),
];

/// The method of [`METHODS`] that `run` takes unless told otherwise. It is judged when the scene has stood still for
/// [`STILL_FRAMES`], the others by their first list.
pub const OURS: &str = "adaptive";
/// The length of the filter at 25 frames/s: by then lights have settled.
pub const STILL_FRAMES: usize = 9;

/// One map, one method, one number of lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// How the lights were found.
    pub method: Method,
    /// How many.
    pub count: usize,
    /// Against the slow measures.
    pub errors: Errors,
    /// The estimate that the list carries.
    pub estimate: f32,
    /// Relative difference of the lights' luminous power from the map's.
    pub power_difference: f64,
    /// Median time of one extraction, its error estimate included.
    pub time: Duration,
}

impl Method {
    /// After how many frames of the same map its list is judged.
    fn frames(&self) -> usize {
        if self.sampler == Sampler::Adaptive { STILL_FRAMES } else { 1 }
    }

    /// The list that is judged, of `count` lights, and the median time of one extraction with its own estimate of its
    /// error.
    ///
    /// # Errors
    /// Those of [`Extractor::new`].
    pub fn timed_list(&self, map: &PolarMap, count: usize) -> Result<(LightList, Duration)> {
        let options =
            Options { count, sampler: self.sampler, inversion: self.inversion, ..Options::default() };
        let (mut extractor, mut list_error) = (Extractor::new(map.shape, &options)?, ListError::new());
        let mut run = |list: &mut LightList| {
            extractor.step(map, list);
            list_error.measure(list);
        };
        let (mut judged, mut list) = (LightList::default(), LightList::default());
        (0..self.frames()).for_each(|_| run(&mut judged));
        let time = median_time(|| run(&mut list));
        Ok((judged, time))
    }
}

/// Measures all methods on one map with so many lights. `goes_on` is asked after every row; when it says no, the rows
/// until then are all.
///
/// # Errors
/// Those of [`Extractor::new`].
pub fn measure(map: &PolarMap, counts: &[usize], mut goes_on: impl FnMut() -> bool) -> Result<Vec<Row>> {
    let reference = Reference::new(map);
    let power = luminance_f64(map.power());
    let mut rows = Vec::new();
    for method in METHODS {
        for &count in counts {
            let (judged, time) = method.timed_list(map, count)?;
            let power_difference =
                if power > 0.0 { luminance_f64(judged.sum_of_lights()) / power - 1.0 } else { 0.0 };
            rows.push(Row {
                method,
                count,
                errors: reference.errors(&judged.lights),
                estimate: judged.error,
                power_difference,
                time,
            });
            if !goes_on() {
                return Ok(rows);
            }
        }
    }
    Ok(rows)
}

/// Median time of some runs.
fn median_time(mut run: impl FnMut()) -> Duration {
    let mut times = Vec::new();
    let begin = Instant::now();
    while times.len() < LEAST_RUNS || (times.len() < MOST_RUNS && begin.elapsed() < BUDGET) {
        let start = Instant::now();
        run();
        times.push(start.elapsed());
    }
    times.sort();
    times[times.len() / 2]
}

/// Geometric means of the errors of rows with the same method and number of lights, in the order of [`METHODS`] and
/// [`COUNTS`]. An error of zero makes its mean zero.
pub fn means(rows: &[Row]) -> Vec<(Method, usize, Errors)> {
    let mut means = Vec::new();
    for method in METHODS {
        for count in COUNTS {
            let of: Vec<Errors> = rows
                .iter()
                .filter(|row| row.method.name == method.name && row.count == count)
                .map(|row| row.errors)
                .collect();
            let mean = |pick: fn(&Errors) -> f64| geometric_mean(of.iter().map(pick));
            if !of.is_empty() {
                let errors = Errors {
                    irradiance: mean(|e| e.irradiance),
                    shadow: mean(|e| e.shadow),
                    glossy: mean(|e| e.glossy),
                };
                means.push((method, count, errors));
            }
        }
    }
    means
}

/// Geometric mean of values >= 0: 0 where one of them is, and for none.
pub fn geometric_mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) =
        values.into_iter().fold((0.0, 0u64), |(sum, count), value| (sum + value.ln(), count + 1));
    if count == 0 { 0.0 } else { (sum / count as f64).exp() }
}

/// Lines for the geometric means over the maps of [`are_published`], header first, the published figures in brackets.
pub fn mean_lines(rows: &[Row]) -> Vec<String> {
    let title = format!("geometric means over {} maps", PUBLISHED_MAPS.len());
    let mut lines =
        vec![format!("{title:<28} {:>6} {:>19} {:>19} {:>19}", "lights", "irradiance", "shadow", "glossy")];
    for (method, count, errors) in means(rows) {
        let place = COUNTS.iter().position(|&c| c == count);
        let published = method.published.zip(place).map(|(published, place)| published[place]);
        let cell = |pick: fn(&Errors) -> f64| match &published {
            Some(published) => format!("{:.5} ({:.5})", pick(&errors), pick(published)),
            // In line with those that have a figure in brackets.
            None => format!("{:.5}          ", pick(&errors)),
        };
        lines.push(format!(
            "  {:<26} {:>6} {:>19} {:>19} {:>19}  {}",
            method.name,
            count,
            cell(|e| e.irradiance),
            cell(|e| e.shadow),
            cell(|e| e.glossy),
            published.map_or(String::new(), |published| verdict(&errors, &published)),
        ));
    }
    lines
}

/// Whether errors are within the limit of the published ones.
fn verdict(errors: &Errors, published: &Errors) -> String {
    let worst = (errors.irradiance / published.irradiance)
        .max(errors.shadow / published.shadow)
        .max(errors.glossy / published.glossy);
    if worst <= LIMIT { "ok".to_owned() } else { format!("{worst:.2} times the published figure") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::test_maps::real_maps;

    #[test]
    fn more_and_better_lights_have_less_error_and_all_keep_the_power() {
        let map = PolarMap::from_fn(SHAPE, |row, column| {
            let lamp = row.abs_diff(40) < 4 && column.abs_diff(100) < 5;
            if lamp { [90.0, 80.0, 60.0] } else { [1.0, 1.2, 1.5] }
        });
        let rows = measure(&map, &COUNTS, || true).unwrap();
        assert_eq!(rows.len(), METHODS.len() * COUNTS.len());
        for pair in rows.chunks(2) {
            assert!(pair[1].errors.irradiance < pair[0].errors.irradiance, "{}", pair[0].method.name);
        }
        let of = |name: &str| rows.iter().find(|row| row.method.name == name).unwrap().errors.irradiance;
        assert!(of("refined") < 0.2 * of("standard"));
        assert!(rows.iter().all(|row| row.power_difference.abs() < 1e-4));
        let means = means(&rows);
        assert_eq!(means.len(), rows.len());
        assert!((means[0].2.shadow / rows[0].errors.shadow - 1.0).abs() < 1e-12);
        let expected = format!("{:.5} (0.21600)", rows[0].errors.glossy);
        assert!(mean_lines(&rows)[1].contains(&expected), "{expected}");
    }

    #[test]
    fn errors_over_the_thirteen_maps_reach_the_published_table() {
        let maps = real_maps(SHAPE);
        let rows: Vec<Row> =
            maps.iter().flat_map(|(_, map)| measure(map, &COUNTS, || true).unwrap()).collect();
        let names: Vec<String> = maps.iter().map(|(name, _)| name.replace(".hdr", "")).collect();
        assert!(maps.is_empty() || are_published(&names));
        assert!(!are_published(&vec![PUBLISHED_MAPS[0].to_owned(); 13]), "one of them thirteen times");
        let lines = mean_lines(&rows);
        lines.iter().for_each(|line| println!("{line}"));
        // Header alone where there are no maps.
        assert_eq!(lines.len(), if maps.is_empty() { 1 } else { 1 + METHODS.len() * COUNTS.len() });
        for line in &lines[1..] {
            let is_published =
                METHODS.iter().any(|m| m.published.is_some() && line.starts_with(&format!("  {} ", m.name)));
            assert_eq!(line.ends_with("ok"), is_published, "{line}");
        }
    }

    #[test]
    fn means_are_geometric() {
        let row = |error: f64| Row {
            method: METHODS[2],
            count: 64,
            errors: errors(error, error, error),
            estimate: 0.0,
            power_difference: 0.0,
            time: Duration::ZERO,
        };
        let means = means(&[row(0.01), row(0.0001)]);
        assert!((means[0].2.glossy - 0.001).abs() < 1e-12);
    }
}
