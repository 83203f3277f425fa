//! How many lights a scene needs: as many as keep the error below a target, within a budget of time.
//!
//! Both are regulated one step at a time with a dead band, so that a static scene keeps its number of lights:
//! the next frame reacts to a limit that is exceeded, and lights that are no longer needed are given up after
//! half a second of calm, or sooner where there are far too many.

/// A step is the number of lights in use divided by this. The remaining lights could not make up for a larger
/// step at once.
const STEPS: usize = 16;

/// From this part of the target or the budget upwards nothing changes: this leaves room for two steps, and
/// for a fluctuating time.
const DEAD_BAND: f64 = 0.85;
const TIME_DEAD_BAND: f64 = 0.7;
/// Below this part of the target, which is many steps away, it is enough to wait until the remaining lights
/// have settled.
const FAR_BELOW: f64 = 0.6;
const SETTLE_S: f64 = 0.2;

/// How long it must otherwise have been calm before there may be fewer lights, or more within the budget.
const CALM_S: f64 = 0.5;

/// Where a number is held because fewer lights were too few: the factor by which the error must change, up or
/// down, to show that the scene has changed.
const OTHER_SCENE: f64 = 2.0;

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
    /// A number of lights that was tried and was too low: one light more or less may jump across the dead
    /// band, as where each lamp of a hall has one light.
    too_few: usize,
    /// The error, as a part of the target, when the number was first held for that reason.
    held_ratio: Option<f64>,
    /// Frames since lights were last given up.
    tried_age: u64,
    /// Whether the error was above the target in the last frame, and whether that was the reason.
    is_above: bool,
    is_too_few: bool,
    /// Frames since the error, and the time, were last in or above the dead band.
    calm_error: u64,
    calm_time: u64,
}

impl Count {
    /// For lists of `slots` slots; `None` where there is neither a target nor a budget, so that there is
    /// nothing to choose.
    pub(super) fn new(slots: usize, error_target: Option<f32>, budget_ms: Option<f64>) -> Option<Self> {
        let count = Self {
            slots,
            error_target,
            budget_ms,
            wanted: slots,
            allowed: slots,
            too_few: 0,
            held_ratio: None,
            tried_age: u64::MAX,
            is_above: false,
            is_too_few: false,
            calm_error: 0,
            calm_time: 0,
        };
        (error_target.is_some() || budget_ms.is_some()).then_some(count)
    }

    /// Whether [`Self::saw_error`] needs to be called.
    pub(super) fn needs_error(&self) -> bool {
        self.error_target.is_some()
    }

    /// Whether [`Self::saw_time`] needs to be called.
    pub(super) fn has_budget(&self) -> bool {
        self.budget_ms.is_some()
    }

    /// How many lights the next list should use.
    pub(super) fn lights(&self) -> usize {
        self.wanted.min(self.allowed)
    }

    /// Takes the error of a list that uses `used` lights.
    pub(super) fn saw_error(&mut self, error: f32, used: usize, frame_rate_hz: f64) {
        let Some(target) = self.error_target else { return };
        // Lights that the budget does not allow are not requested again and again.
        let (lights, ratio) = (self.lights(), f64::from(error / target));
        self.calm_error = if ratio < DEAD_BAND { self.calm_error + 1 } else { 0 };
        self.tried_age = self.tried_age.saturating_add(1);
        if ratio > 1.0 {
            if !self.is_above {
                self.is_too_few = self.tried_age <= frames(CALM_S, frame_rate_hz);
                if !self.is_too_few {
                    // A number that was too low for an easier scene says nothing about this one.
                    self.too_few = 0;
                }
            }
            if self.is_too_few {
                self.too_few = used.min(lights);
            }
            // Lights that were requested come when they have rested; until then no more are requested.
            if used >= lights {
                self.wanted = more(lights, self.slots);
            }
        } else if self.calm_error >= frames(if ratio < FAR_BELOW { SETTLE_S } else { CALM_S }, frame_rate_hz)
        {
            let is_other_scene = |held: f64| ratio > OTHER_SCENE * held || held > OTHER_SCENE * ratio;
            if self.held_ratio.is_some_and(is_other_scene) {
                self.too_few = 0;
            }
            self.wanted = fewer(lights, self.slots).max(lights.min(self.too_few + 1));
            self.calm_error = 0;
            if self.wanted < lights {
                (self.held_ratio, self.tried_age) = (None, 0);
            } else if self.held_ratio.is_none() {
                self.held_ratio = Some(ratio);
            }
        }
        self.is_above = ratio > 1.0;
    }

    /// The time that making a list took.
    pub(super) fn saw_time(&mut self, time_ms: f64, frame_rate_hz: f64) {
        let Some(budget_ms) = self.budget_ms else { return };
        let ratio = time_ms / budget_ms;
        self.calm_time = if ratio < TIME_DEAD_BAND { self.calm_time + 1 } else { 0 };
        if ratio > 1.0 {
            // The time does not fall in proportion, because the map has a fixed cost. One step per frame is
            // enough.
            self.allowed = fewer(self.lights(), self.slots);
        } else if self.calm_time >= frames(CALM_S, frame_rate_hz) {
            self.allowed = more(self.allowed, self.slots);
            self.calm_time = 0;
        }
    }
}

/// With an unknown frame rate, any time is one frame.
fn frames(seconds: f64, frame_rate_hz: f64) -> u64 {
    ((seconds * frame_rate_hz).ceil() as u64).max(1)
}

fn more(lights: usize, slots: usize) -> usize {
    (lights + (lights / STEPS).max(1)).min(slots)
}

fn fewer(lights: usize, slots: usize) -> usize {
    (lights * (STEPS - 1) / STEPS).max(FEWEST.min(slots))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(error_target: Option<f32>, budget_ms: Option<f64>) -> Count {
        Count::new(256, error_target, budget_ms).unwrap()
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
            // Either it is the lowest or the highest number, or the error is in the dead band.
            assert!(
                error <= 0.003 && (error >= 0.8 * 0.003 || last == FEWEST) || last == 256,
                "{start_error}: {last} lights, error {error}"
            );
        }
    }

    #[test]
    fn lamps_of_which_each_needs_a_light_get_one_each_and_are_not_tried_again_and_again() {
        let error_of = |lights: usize, lamps: usize, rest: f32| {
            if lights < lamps { 0.02 } else { rest / lights as f32 }
        };
        let mut count = count(Some(0.01), None);
        // Errors far below the target, further below, and less far.
        for (lamps, rest, fewest) in
            [(51, 0.06, 51), (20, 0.004, 20), (90, 0.09, 90), (10, 0.27, 28), (20, 0.02, 20), (5, 0.1, 10)]
        {
            let mut history = Vec::new();
            for _ in 0..3000 {
                count.saw_error(error_of(count.lights(), lamps, rest), count.lights(), 25.0);
                history.push(count.lights());
            }
            let last = history[2999];
            assert!(history[1500..].iter().all(|&lights| lights == last), "{:?}", &history[1500..]);
            assert!((fewest..=fewest + fewest / 8).contains(&last), "{lamps}: {last}");
        }
    }

    #[test]
    fn a_harder_scene_gets_more_at_once_and_an_easier_one_fewer_after_some_calm() {
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
        // Half a second if a step may be too much, a fifth if not.
        for (error, calm_frames) in [(0.0021, 13), (0.001, 5)] {
            let lights = count.lights();
            for _ in 1..calm_frames {
                count.saw_error(error, lights, 25.0);
                assert_eq!(count.lights(), lights);
            }
            count.saw_error(error, lights, 25.0);
            assert!(count.lights() < lights);
        }
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
    fn nothing_is_chosen_without_a_target_and_a_budget() {
        assert!(Count::new(64, None, None).is_none());
    }
}
