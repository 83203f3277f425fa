//! How many lights a scene needs: as many as keep the error below a target, within a budget of time.
//!
//! Both are regulated one step at a time with a dead band, so that a scene that stands still keeps its number: what
//! overshoots is answered in the next frame, what has become too much is given up after a second of calm.

use crate::error::{Error, Result};

/// A step is this part of the lights that are in use ...
const STEPS: usize = 16;
/// ... and where the error is below this part of the target, far more than a step away, up to a half is given up at once.
/// After larger steps than needed the error overshoots until the lights that are left have settled.
const FAR_BELOW: f64 = 0.45;
const LEAST_KEPT: f64 = 0.5;

/// From this part of the target or the budget upwards nothing is changed.
const DEAD_BAND: f64 = 0.7;
/// Where in the dead band a change is to end: with n lights the error goes as 1 / n or faster.
const AIM: f64 = 0.85;

/// How long it must have been calm before there may be fewer lights, or more within the budget.
const CALM_S: f64 = 1.0;

/// The fewest lights that are chosen.
const FEWEST: usize = 4;

/// Chooses the number of lights of the next list.
#[derive(Clone, Debug)]
pub(super) struct Count {
    slots: usize,
    error_target: Option<f32>,
    budget_ms: Option<f64>,
    /// What the error asks for, and what the budget allows.
    wanted: usize,
    allowed: usize,
    /// A number that was tried and was too few, and frames since the last was tried: with few lights one more or less may
    /// leap over the dead band.
    too_few: usize,
    tried_age: u64,
    /// Frames since the error, and the time, were last in or above the dead band.
    calm_error: u64,
    calm_time: u64,
}

impl Count {
    /// For lists of so many slots; `None` where nothing is to be chosen.
    ///
    /// # Errors
    /// `Usage`, naming the key, for a target or a budget that is not a number above 0.
    pub(super) fn new(
        slots: usize,
        error_target: Option<f32>,
        budget_ms: Option<f64>,
    ) -> Result<Option<Self>> {
        let is_sound = |value: f64| value.is_finite() && value > 0.0;
        if let Some(target) = error_target.filter(|&target| !is_sound(f64::from(target))) {
            return Err(Error::usage(format!(
                "error_target = {target}: must be a relative error above 0, such as 0.003"
            )));
        }
        if let Some(budget) = budget_ms.filter(|&budget| !is_sound(budget)) {
            return Err(Error::usage(format!("budget_ms = {budget}: must be a time above 0 ms")));
        }
        let count = Self {
            slots,
            error_target,
            budget_ms,
            wanted: slots,
            allowed: slots,
            too_few: 0,
            tried_age: u64::MAX,
            calm_error: 0,
            calm_time: 0,
        };
        Ok((error_target.is_some() || budget_ms.is_some()).then_some(count))
    }

    /// Whether [`Self::saw_error`] is of use.
    pub(super) fn needs_error(&self) -> bool {
        self.error_target.is_some()
    }

    /// Whether [`Self::saw_time`] is of use.
    pub(super) fn has_budget(&self) -> bool {
        self.budget_ms.is_some()
    }

    /// How many lights the next list is to use.
    pub(super) fn lights(&self) -> usize {
        self.wanted.min(self.allowed)
    }

    /// The error of a list that uses so many lights.
    pub(super) fn saw_error(&mut self, error: f32, used: usize, frame_rate_hz: f64) {
        let Some(target) = self.error_target else { return };
        // What the budget does not allow is not asked for again and again.
        let (lights, ratio) = (self.lights(), f64::from(error / target));
        self.calm_error = if ratio < DEAD_BAND { self.calm_error + 1 } else { 0 };
        self.tried_age = self.tried_age.saturating_add(1);
        if ratio > 1.0 {
            if self.tried_age <= calm_frames(frame_rate_hz) {
                self.too_few = lights;
            }
            // Lights that were asked for come when they have rested; until then no more are.
            if used >= lights {
                self.wanted = more(lights, self.slots);
            }
        } else if self.calm_error >= calm_frames(frame_rate_hz) {
            if ratio < FAR_BELOW {
                self.too_few = 0;
            }
            self.wanted = fewer(lights, ratio, self.slots).max(lights.min(self.too_few + 1));
            self.calm_error = 0;
            // After a leap the error overshoots, which says nothing.
            self.tried_age = if ratio < FAR_BELOW { u64::MAX } else { 0 };
        }
    }

    /// The time that making a list took.
    pub(super) fn saw_time(&mut self, time_ms: f64, frame_rate_hz: f64) {
        let Some(budget_ms) = self.budget_ms else { return };
        let ratio = time_ms / budget_ms;
        self.calm_time = if ratio < DEAD_BAND { self.calm_time + 1 } else { 0 };
        if ratio > 1.0 {
            // Time does not fall in proportion: the map costs what it costs. One step is enough for one frame.
            self.allowed = fewer(self.lights(), 1.0, self.slots);
        } else if self.calm_time >= calm_frames(frame_rate_hz) {
            self.allowed = more(self.allowed, self.slots);
            self.calm_time = 0;
        }
    }
}

/// A rate that is not known counts as one frame.
fn calm_frames(frame_rate_hz: f64) -> u64 {
    ((CALM_S * frame_rate_hz).ceil() as u64).max(1)
}

fn more(lights: usize, slots: usize) -> usize {
    (lights + (lights / STEPS).max(1)).min(slots)
}

fn fewer(lights: usize, ratio: f64, slots: usize) -> usize {
    let step = (STEPS - 1) as f64 / STEPS as f64;
    let kept = if ratio < FAR_BELOW { (ratio / AIM).max(LEAST_KEPT) } else { step };
    ((lights as f64 * kept) as usize).max(FEWEST.min(slots))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(error_target: Option<f32>, budget_ms: Option<f64>) -> Count {
        Count::new(256, error_target, budget_ms).unwrap().unwrap()
    }

    #[test]
    fn the_number_settles_where_the_error_is_below_the_target_and_stays() {
        for start_error in [0.01f32, 0.2, 3.0] {
            let mut count = count(Some(0.003), None);
            let mut history = Vec::new();
            for _ in 0..1000 {
                count.saw_error(start_error / count.lights() as f32, count.lights(), 25.0);
                history.push(count.lights());
            }
            let (last, error) = (history[999], start_error / history[999] as f32);
            assert!(history[500..].iter().all(|&lights| lights == last), "{start_error}: {last}");
            // As few as there are, or as many, or in the dead band.
            assert!(
                error <= 0.003 && (error >= 0.65 * 0.003 || last == FEWEST) || last == 256,
                "{start_error}: {last} lights, error {error}"
            );
        }
    }

    #[test]
    fn a_harder_scene_gets_more_at_once_and_an_easier_one_fewer_after_a_second() {
        let mut count = count(Some(0.003), None);
        for _ in 0..500 {
            count.saw_error(0.1 / count.lights() as f32, count.lights(), 25.0);
        }
        let easy = count.lights();
        assert!((33..48).contains(&easy), "{easy}");
        count.saw_error(0.3 / easy as f32, easy - 1, 25.0);
        assert_eq!(count.lights(), easy);
        count.saw_error(0.3 / easy as f32, easy, 25.0);
        assert!(count.lights() > easy);
        for _ in 0..40 {
            count.saw_error(0.3 / count.lights() as f32, count.lights(), 25.0);
        }
        let hard = count.lights();
        assert!((100..140).contains(&hard), "{hard}");
        for _ in 0..24 {
            count.saw_error(0.1 / hard as f32, hard, 25.0);
            assert_eq!(count.lights(), hard);
        }
        count.saw_error(0.1 / hard as f32, hard, 25.0);
        assert!(count.lights() < hard);
    }

    #[test]
    fn the_budget_limits_what_the_error_asks_for() {
        let mut count = count(Some(0.003), Some(1.0));
        let (mut least, mut most) = (usize::MAX, 0);
        for frame in 0..2000 {
            let lights = count.lights();
            count.saw_error(3.0 / lights as f32, lights, 25.0);
            // 0.4 ms and 6 us a light: 100 lights in the budget.
            count.saw_time(0.4 + 0.006 * lights as f64, 25.0);
            if frame > 200 {
                (least, most) = (least.min(count.lights()), most.max(count.lights()));
            }
        }
        assert!(least >= 50 && most <= 101, "{least} {most}");
        // A budget that nothing can keep leaves the fewest.
        for _ in 0..200 {
            count.saw_time(2.0, 25.0);
        }
        assert_eq!(count.lights(), FEWEST);
    }

    #[test]
    fn targets_and_budgets_that_are_none_are_refused_by_key() {
        assert!(Count::new(64, None, None).unwrap().is_none());
        for wrong in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let message = Count::new(64, Some(wrong), None).unwrap_err().to_string();
            assert!(message.starts_with("error_target = "), "{message}");
            let message = Count::new(64, None, Some(wrong.into())).unwrap_err().to_string();
            assert!(message.starts_with("budget_ms = "), "{message}");
        }
    }
}
