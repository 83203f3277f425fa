//! The table of METHODS section 7: what was measured there beside what is measured here.

use super::sequence::{BeforeAndAfter, Method, Sequence};
use crate::error::Result;
use crate::image::PolarMap;

/// Figures of METHODS section 7, made with a float64 reference model. Its row "the paper" normalises the rows'
/// distribution functions before it interpolates them, ours does not (METHODS section 5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// Error and flicker before the filter.
    pub before: [f64; 2],
    /// 99th percentile of light motion before the filter, in degrees a frame.
    pub motion_p99_deg: f64,
    /// Error and flicker after the filter.
    pub after: [f64; 2],
}

/// One method on one sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// `garden` or `hall`.
    pub sequence: &'static str,
    /// How the lights were found.
    pub method: Method,
    /// What came out.
    pub measured: BeforeAndAfter,
    /// What METHODS found.
    pub published: Published,
}

impl Row {
    /// Largest of error, flicker and motion p99 before and error and flicker after the filter, each relative to what
    /// is published. The published figures are rounded to their last digit (0.0001, 1 or 0.1 degrees), so half of
    /// that is granted first.
    pub fn worst_ratio(&self) -> f64 {
        let (Row { measured: BeforeAndAfter { before, after }, published, .. }, half) = (self, 0.00005);
        let motion_half = if published.motion_p99_deg < 10.0 { 0.05 } else { 0.5 };
        [
            before.error / (published.before[0] + half),
            before.flicker / (published.before[1] + half),
            before.motion_deg[1] / (published.motion_p99_deg + motion_half),
            after.error / (published.after[0] + half),
            after.flicker / (published.after[1] + half),
        ]
        .into_iter()
        .fold(0.0, f64::max)
    }

    /// How far above the published figures this row may lie: 1.25 for the paper, whose distribution functions differ,
    /// 1.15 for the others.
    pub fn limit(&self) -> f64 {
        if self.method == Method::Paper { 1.25 } else { 1.15 }
    }
}

/// Measures all methods on both sequences: `garden` is `chinese_garden_1k`, `hall` is `dancing_hall_1k`, both as upper
/// hemispheres of 360 x 90. About ten seconds.
///
/// # Errors
/// Kind `Usage` for maps of another shape.
pub fn measure(garden: &PolarMap, hall: &PolarMap) -> Result<Vec<Row>> {
    let published = |before, motion_p99_deg, after| Published { before, motion_p99_deg, after };
    let mut rows = Vec::new();
    for (name, sequence, methods) in [
        (
            "garden",
            Sequence::garden(garden)?,
            [
                (Method::Paper, published([0.0268, 0.0149], 18.0, [0.0298, 0.0151])),
                (Method::Refined, published([0.0012, 0.0005], 12.0, [0.0454, 0.0896])),
                (Method::Persistent, published([0.0030, 0.0070], 1.7, [0.0113, 0.0268])),
            ],
        ),
        (
            "hall",
            Sequence::hall(hall)?,
            [
                (Method::Paper, published([0.0343, 0.0656], 100.0, [0.0763, 0.0563])),
                (Method::Refined, published([0.0017, 0.0024], 82.0, [0.0450, 0.0458])),
                (Method::Persistent, published([0.0012, 0.0008], 1.5, [0.0011, 0.0002])),
            ],
        ),
    ] {
        for (method, published) in methods {
            rows.push(Row { sequence: name, method, measured: sequence.measure(method)?, published });
        }
    }
    Ok(rows)
}

/// Lines of a table, header first: measured figures with the published ones in brackets, and whether the row keeps
/// its limit.
pub fn lines(rows: &[Row]) -> Vec<String> {
    let mut lines = vec![format!(
        "{:<7} {:<11} {:>15}  {:>15}  {:>26}  {:>15}  {:>15}  {:>17}",
        "",
        "",
        "error before",
        "flicker before",
        "motion p50/p99/max deg",
        "error after",
        "flicker after",
        "motion after"
    )];
    let pair = |value: f64, published: f64| format!("{value:.4} ({published:.4})");
    for row in rows {
        let Row { sequence, method, measured: BeforeAndAfter { before, after }, published, .. } = row;
        let method = method.name();
        let [p50, p99, max] = before.motion_deg;
        let [p50_after, p99_after, max_after] = after.motion_deg;
        lines.push(format!(
            "{sequence:<7} {method:<11} {:>15}  {:>15}  {:>26}  {:>15}  {:>15}  {:>17}  {}",
            pair(before.error, published.before[0]),
            pair(before.flicker, published.before[1]),
            format!("{p50:.1}/{p99:.1} ({})/{max:.1}", published.motion_p99_deg),
            pair(after.error, published.after[0]),
            pair(after.flicker, published.after[1]),
            format!("{p50_after:.1}/{p99_after:.1}/{max_after:.1}"),
            if row.worst_ratio() <= row.limit() {
                "ok".to_owned()
            } else {
                format!("{:.2} times the published figure", row.worst_ratio())
            }
        ));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::test_maps::real_map;
    use crate::report::sequence::SHAPE;

    #[test]
    fn garden_and_hall_are_as_steady_as_published() {
        let Some(garden) = real_map("chinese_garden_1k.hdr", SHAPE) else { return };
        let Some(hall) = real_map("dancing_hall_1k.hdr", SHAPE) else { return };
        let rows = measure(&garden, &hall).unwrap();
        let lines = lines(&rows);
        lines.iter().for_each(|line| println!("{line}"));
        assert_eq!(lines.len(), 7);
        for (row, line) in rows.iter().zip(&lines[1..]) {
            assert!(row.worst_ratio() <= row.limit(), "{line}");
        }
    }

    #[test]
    fn the_worst_figure_of_a_row_decides() {
        use crate::report::sequence::Figures;
        let figures = |error, flicker| Figures { error, flicker, motion_deg: [0.1, 1.0, 2.0] };
        let mut row = Row {
            sequence: "hall",
            method: Method::Persistent,
            measured: BeforeAndAfter { before: figures(0.0012, 0.0008), after: figures(0.0011, 0.0002) },
            published: Published { before: [0.0012, 0.0008], motion_p99_deg: 1.5, after: [0.0011, 0.0002] },
        };
        assert!(row.worst_ratio() < 1.0 && lines(&[row])[1].ends_with("ok"));
        row.measured.after.flicker = 0.0005;
        assert!((row.worst_ratio() - 2.0).abs() < 1e-12);
        assert!(lines(&[row])[1].ends_with("2.00 times the published figure"));
    }
}
