//! What changes with time: each is a pure function of the time in seconds since frame 0.

use crate::error::{Error, Place, Result};
use serde::Deserialize;
use std::f64::consts::TAU;

/// Sinusoidal brightness: `1 + depth sin(2 pi (frequency t + phase))`.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Flicker {
    /// Cycles per second.
    pub frequency_hz: f64,
    /// Amplitude as a fraction of the mean, 0 to 1.
    pub depth: f64,
    /// Phase at time 0 in turns.
    #[serde(default)]
    pub phase_turns: f64,
}

impl Flicker {
    /// Factor on the brightness, within `1 - depth` to `1 + depth`.
    pub fn factor(&self, time_s: f64) -> f64 {
        // The fraction of a turn is taken first: the sine of thousands of turns would lose digits.
        1.0 + self.depth * (TAU * (self.frequency_hz * time_s + self.phase_turns).fract()).sin()
    }

    pub(super) fn check(&self) -> Result<()> {
        // Beyond 1e9 a double cannot resolve fractions of a turn after a few seconds; infinity would give
        // NaN.
        let moderate = self.frequency_hz.abs() <= 1e9 && self.phase_turns.abs() <= 1e9;
        if moderate && (0.0..=1.0).contains(&self.depth) {
            return Ok(());
        }
        Err(Error::usage(
            "needs frequency_hz and phase_turns between -1e9 and 1e9 and a depth between 0 and 1",
        )
        .at(Place::key("flicker")))
    }
}

/// Whether something with these on-times `[start, end)` is on; an empty list means always.
pub fn is_on(on_s: &[[f64; 2]], time_s: f64) -> bool {
    on_s.is_empty() || on_s.iter().any(|[start, end]| (*start..*end).contains(&time_s))
}

/// A position in the sky at a time.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Waypoint {
    /// Seconds since frame 0.
    #[serde(default)]
    pub time_s: f64,
    /// From +X towards +Z, degrees.
    pub azimuth_deg: f64,
    /// Above the horizon, degrees.
    #[serde(alias = "altitude_deg")]
    pub elevation_deg: f64,
}

/// Azimuth and elevation in degrees on the path: both angles linear between waypoints (so a path may make
/// more than one turn), held before the first and after the last.
pub fn along(path: &[Waypoint], time_s: f64) -> (f64, f64) {
    let times = path.iter().map(|waypoint| waypoint.time_s);
    let (before, after, x) = segment(times, time_s);
    let mix = |a: f64, b: f64| a + (b - a) * x;
    (
        mix(path[before].azimuth_deg, path[after].azimuth_deg),
        mix(path[before].elevation_deg, path[after].elevation_deg),
    )
}

/// Exposure at a time.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exposure {
    /// Seconds since frame 0.
    pub time_s: f64,
    /// Exponent of two of the factor on the radiance that the sensor sees.
    pub stops: f64,
}

/// Gain at a time: stops are linear between the entries and constant outside them; 1 without entries.
pub fn gain(exposures: &[Exposure], time_s: f64) -> f64 {
    if exposures.is_empty() {
        return 1.0;
    }
    let (before, after, x) = segment(exposures.iter().map(|exposure| exposure.time_s), time_s);
    let (a, b) = (exposures[before].stops, exposures[after].stops);
    (a + (b - a) * x).exp2()
}

/// Indices of the entries on either side of `time_s` and the fraction of the way between them. There is at
/// least one entry, and times ascend.
fn segment(times: impl ExactSizeIterator<Item = f64> + Clone, time_s: f64) -> (usize, usize, f64) {
    let last = times.len() - 1;
    let Some(after) = times.clone().position(|time| time > time_s) else {
        return (last, last, 0.0);
    };
    if after == 0 {
        return (0, 0, 0.0);
    }
    let mut pair = times.skip(after - 1);
    let (start, end) = (pair.next().unwrap_or(0.0), pair.next().unwrap_or(0.0));
    (after - 1, after, (time_s - start) / (end - start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flicker_is_the_sine_that_the_hall_asks_for() {
        let hall = Flicker { frequency_hz: 9.5, depth: 0.5, phase_turns: 0.0 };
        for frame in 0..40 {
            let expected = 1.0 + 0.5 * (TAU * 0.38 * f64::from(frame)).sin();
            assert!((hall.factor(f64::from(frame) / 25.0) - expected).abs() < 1e-12);
        }
        let opposite = Flicker { phase_turns: 0.5, ..hall };
        assert!((hall.factor(0.013) + opposite.factor(0.013) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn switches_include_their_start_and_exclude_their_end() {
        let on = [[0.5, 1.0], [2.0, 3.0]];
        let states: Vec<bool> = [0.0, 0.5, 0.99, 1.0, 2.5, 3.0].iter().map(|t| is_on(&on, *t)).collect();
        assert_eq!(states, [false, true, true, false, true, false]);
        assert!(is_on(&[], 7.0));
    }

    #[test]
    fn paths_and_exposures_are_linear_and_held_at_their_ends() {
        let at = |time_s, azimuth_deg, elevation_deg| Waypoint { time_s, azimuth_deg, elevation_deg };
        let path = [at(1.0, 350.0, 10.0), at(2.0, 370.0, 30.0), at(4.0, 370.0, 90.0)];
        assert_eq!(along(&path, 0.0), (350.0, 10.0));
        assert_eq!(along(&path, 1.25), (355.0, 15.0));
        assert_eq!(along(&path, 3.0), (370.0, 60.0));
        assert_eq!(along(&path, 9.0), (370.0, 90.0));
        let stops = [Exposure { time_s: 0.0, stops: 0.0 }, Exposure { time_s: 1.0, stops: -2.0 }];
        assert_eq!([gain(&stops, 0.5), gain(&stops, 5.0), gain(&[], 1.0)], [0.5, 0.25, 1.0]);
    }
}
