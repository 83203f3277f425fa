//! Measures maps and sequences and puts the figures into tables of a report.

use super::sequence::{Figures, Sequence, Timed};
use super::stills;
use super::table::{Measure, Row, Table};
use crate::compare::sequence_methods::SequenceMethod;
use crate::compare::still_methods::OURS;
use crate::error::Result;
use lightcast_core::image::PolarMap;

/// Default numbers of lights of a report.
pub const COUNTS: [usize; 9] = [4, 8, 16, 32, 64, 128, 256, 512, 1024];

/// The measures of single maps.
pub const OF_MAPS: [Measure; 5] = [
    Measure { key: "irradiance", name: "irradiance error", ranked: true },
    Measure { key: "shadow", name: "shadow error", ranked: true },
    Measure { key: "glossy", name: "glossy error", ranked: true },
    Measure { key: "estimate", name: "own estimate", ranked: false },
    Measure { key: "power_difference", name: "power off by", ranked: false },
];

/// The measures of sequences, with shadows softened by the lights' spread unless they are called hard; motion
/// is the angle that a light moves from one frame to the next.
pub const OF_SEQUENCES: [Measure; 10] = [
    Measure { key: "error", name: "error", ranked: true },
    Measure { key: "flicker", name: "flicker", ranked: true },
    Measure { key: "motion_p99_deg", name: "motion p99, deg", ranked: true },
    Measure { key: "motion_p50_deg", name: "p50, deg", ranked: false },
    Measure { key: "motion_max_deg", name: "max, deg", ranked: false },
    Measure { key: "error_hard", name: "hard shadows: error", ranked: false },
    Measure { key: "flicker_hard", name: "flicker", ranked: false },
    Measure { key: "error_unfiltered", name: "unfiltered: error", ranked: false },
    Measure { key: "flicker_unfiltered", name: "flicker", ranked: false },
    Measure { key: "motion_p99_unfiltered_deg", name: "motion p99, deg", ranked: false },
];

/// The input that figures belong to, and the command that prints them.
pub struct Origin {
    /// The input's name.
    pub name: String,
    /// Prints the figures again.
    pub command: String,
}

/// All methods on one map; `goes_on` is called after every row. `None` when it returns false.
///
/// # Errors
/// Those of [`stills::measure`].
pub fn of_map(
    origin: Origin,
    map: &PolarMap,
    counts: &[usize],
    mut goes_on: impl FnMut() -> bool,
) -> Result<Option<(Table, Vec<stills::Row>)>> {
    let mut is_whole = true;
    let measured = stills::measure(map, counts, || {
        is_whole = goes_on();
        is_whole
    })?;
    if !is_whole {
        return Ok(None);
    }
    let row = |row: &stills::Row| Row {
        method: row.method.name.to_owned(),
        lights: row.count,
        time_ms: row.time.as_secs_f64() * 1e3,
        values: vec![
            row.errors.irradiance,
            row.errors.shadow,
            row.errors.glossy,
            f64::from(row.estimate),
            row.power_difference.abs(),
        ],
        front: Vec::new(),
    };
    let rows = measured.iter().map(row).collect();
    Ok(Some((Table::new(origin.name, origin.command, &OF_MAPS, OURS, rows), measured)))
}

/// The result of one method with some number of lights on a sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// How the lights were found.
    pub method: SequenceMethod,
    /// Number of lights.
    pub count: usize,
    /// The measured figures.
    pub timed: Timed,
}

/// All methods on one sequence, and the results from which the rows were made. `goes_on` is called after
/// every frame; `None` when it returns false. `row_done` is called after every row.
///
/// # Errors
/// Those of [`Sequence::measure`].
pub fn of_sequence(
    origin: Origin,
    sequence: &Sequence,
    counts: &[usize],
    goes_on: &dyn Fn() -> bool,
    mut row_done: impl FnMut(),
) -> Result<Option<(Table, Vec<Measured>)>> {
    let (mut rows, mut measured) = (Vec::new(), Vec::new());
    for method in SequenceMethod::ALL {
        for &count in counts {
            let Some(timed) = sequence.measure(method, count, goes_on)? else { return Ok(None) };
            measured.push(Measured { method, count, timed });
            let Figures { error, flicker, motion_deg: [p50, p99, max] } = timed.measured.soft_after;
            let (before, hard) = (timed.measured.soft_before, timed.measured.after);
            rows.push(Row {
                method: method.name().to_owned(),
                lights: count,
                time_ms: timed.time.as_secs_f64() * 1e3,
                values: vec![
                    error,
                    flicker,
                    p99,
                    p50,
                    max,
                    hard.error,
                    hard.flicker,
                    before.error,
                    before.flicker,
                    before.motion_deg[1],
                ],
                front: Vec::new(),
            });
            row_done();
        }
    }
    let mut table = Table::new(origin.name, origin.command, &OF_SEQUENCES, SequenceMethod::OURS.name(), rows);
    let (frames, rate_hz) = (sequence.frame_count(), sequence.frame_rate_hz());
    table.notes = if sequence.is_filtered() {
        format!("{frames} frames at {rate_hz} frames/s, after the filter unless said otherwise.")
    } else if rate_hz > 0.0 {
        format!("{frames} frames at {rate_hz} frames/s, too few a second to be filtered.")
    } else {
        format!("{frames} frames without a known rate, so not filtered.")
    };
    Ok(Some((table, measured)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::still_methods::METHODS;
    use lightcast_core::image::PolarShape;

    const SHAPE: PolarShape = PolarShape::hemisphere(36, 9);

    fn origin() -> Origin {
        Origin { name: "small".to_owned(), command: "lightcast report".to_owned() }
    }

    #[test]
    fn a_black_map_has_no_errors_and_a_front() {
        let (table, _) = of_map(origin(), &PolarMap::black(SHAPE), &[4, 8], || true).unwrap().unwrap();
        assert_eq!(table.rows.len(), 2 * METHODS.len());
        assert!(table.rows.iter().all(|row| row.values == [0.0; 5] && row.time_ms > 0.0), "{table:?}");
        for count in [4, 8] {
            // Only the quickest, for every measure.
            let on_front = table.rows.iter().filter(|row| row.lights == count && row.front[0]);
            assert!(on_front.clone().count() >= 1);
            assert!(on_front.clone().all(|row| row.front == [true, true, true, false, false]));
        }
        assert_eq!(table.findings().len(), 3);
    }

    #[test]
    fn a_measurement_that_is_stopped_is_no_table() {
        let mut asked = 0;
        let stop_after_three = || {
            asked += 1;
            asked < 3
        };
        let map = PolarMap::from_fn(SHAPE, |row, _| [row as f32; 3]);
        assert!(of_map(origin(), &map, &[4, 8], stop_after_three).unwrap().is_none());
        assert_eq!(asked, 3);
    }

    #[test]
    fn ours_are_among_the_methods() {
        assert!(METHODS.iter().any(|method| method.name == OURS));
        assert!(SequenceMethod::ALL.contains(&SequenceMethod::OURS));
    }
}
