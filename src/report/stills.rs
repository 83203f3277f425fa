//! Error and time of the lights of single maps: the table of METHODS section 6.

use super::median::median;
use crate::compare::still_methods::{COUNTS, METHODS, PUBLISHED_MAPS, StillMethod};
use crate::error::Result;
use lightcast_core::image::{PolarMap, luminance_f64};
use lightcast_core::light::LightList;
use lightcast_core::light::ReferencedList;
use lightcast_core::light::error::ListError;
use lightcast_core::light::measure::{Errors, Reference};
use std::time::{Duration, Instant};

/// The fewest extractions of which the median time is reported.
const LEAST_RUNS: usize = 3;
/// The most extractions that are timed.
const MOST_RUNS: usize = 25;
/// Once the extractions have taken this long together, no more are timed.
const BUDGET: Duration = Duration::from_millis(100);

/// Largest ratio of a mean to the published figure.
pub const LIMIT: f64 = 1.15;

/// One map, one method, one number of lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// How the lights were found.
    pub method: StillMethod,
    /// Number of lights.
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

/// The list of `count` lights by which a method is judged, and the median time of one extraction with its own
/// estimate of its error.
///
/// # Errors
/// Those of [`StillMethod::extractor`].
pub fn timed_list(method: &StillMethod, map: &PolarMap, count: usize) -> Result<(LightList, Duration)> {
    let (mut extractor, mut list_error) = (method.extractor(map.shape, count)?, ListError::new());
    let mut run = |list: &mut ReferencedList| {
        extractor.step(map, list);
        list_error.measure(list);
    };
    let (mut judged, mut list) = (ReferencedList::default(), ReferencedList::default());
    (0..method.frames()).for_each(|_| run(&mut judged));
    let time = median_time(|| run(&mut list));
    Ok((judged.list, time))
}

/// Measures all methods on one map with these numbers of lights. `goes_on` is called after every row; when it
/// returns false, only the rows until then are returned.
///
/// # Errors
/// Those of [`StillMethod::extractor`].
pub fn measure(map: &PolarMap, counts: &[usize], mut goes_on: impl FnMut() -> bool) -> Result<Vec<Row>> {
    let reference = Reference::new(map);
    let power = luminance_f64(map.power());
    let mut rows = Vec::new();
    for method in METHODS {
        for &count in counts {
            let (judged, time) = timed_list(&method, map, count)?;
            let power_difference =
                if power > 0.0 { luminance_f64(judged.sum_of_lights()) / power - 1.0 } else { 0.0 };
            rows.push(Row {
                method,
                count,
                errors: reference.errors(&judged.lights),
                estimate: judged.error.expect("a timed list is measured"),
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
    median(&mut times).unwrap_or_default()
}

/// Geometric means of the errors of rows with the same method and number of lights, in the order of
/// [`METHODS`] and [`COUNTS`]. An error of zero makes its mean zero.
pub fn means(rows: &[Row]) -> Vec<(StillMethod, usize, Errors)> {
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

/// Geometric mean of values >= 0; 0 where one of them is 0, and for no values.
pub fn geometric_mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) =
        values.into_iter().fold((0.0, 0u64), |(sum, count), value| (sum + value.ln(), count + 1));
    if count == 0 { 0.0 } else { (sum / count as f64).exp() }
}

/// Lines for the geometric means over the maps of
/// [`are_published`](crate::compare::still_methods::are_published), header first, the published figures in
/// brackets.
pub fn mean_lines(rows: &[Row]) -> Vec<String> {
    let title = format!("geometric means over {} maps", PUBLISHED_MAPS.len());
    let mut lines =
        vec![format!("{title:<28} {:>6} {:>19} {:>19} {:>19}", "lights", "irradiance", "shadow", "glossy")];
    for (method, count, errors) in means(rows) {
        let place = COUNTS.iter().position(|&c| c == count);
        let published = method.published.zip(place).map(|(published, place)| published[place]);
        let cell = |pick: fn(&Errors) -> f64| match &published {
            Some(published) => format!("{:.5} ({:.5})", pick(&errors), pick(published)),
            // Aligned with the columns that have a figure in brackets.
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
    use crate::compare::still_methods::{SHAPE, are_published};
    use lightcast_core::test_data::real_maps;

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
        // Only the header where there are no maps.
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
            errors: Errors { irradiance: error, shadow: error, glossy: error },
            estimate: 0.0,
            power_difference: 0.0,
            time: Duration::ZERO,
        };
        let means = means(&[row(0.01), row(0.0001)]);
        assert!((means[0].2.glossy - 0.001).abs() < 1e-12);
    }
}
