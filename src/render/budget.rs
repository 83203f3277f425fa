//! A steady frame rate: the number of lights and shadow maps that the next frame may have (Havran et al.
//! 2005, section 3.2: the list is progressive, so its length can be adapted to the frame rate).
//!
//! Every frame time gives the number of lights that the frame could have *afforded*: its lights times the
//! target over its time, as if all the time were spent on lights. A fixed cost makes that number inaccurate,
//! but the error is harmless: the number increases with the lights and equals them where the target is met,
//! so moving towards it approaches the target from either side without overshoot. The controller uses only
//! medians of it, so that single slow frames have no effect, and once it has converged it changes nothing
//! until a median leaves a band around the target.

use crate::error::{Error, Place, Result};
use lightcast_core::light::MAX_LIGHTS;
use serde::Deserialize;

/// Frames whose median indicates overload: four slow ones of seven are rarely chance, and an eighth of a
/// second at 60 Hz is short.
const FAST: usize = 7;
/// Frames whose median indicates spare time, about half a second.
const SLOW: usize = 31;
/// Relative deviation of a frame time from the target before anything changes. The requirement is 10 %; this
/// allows for twice the 5 % noise of frame times.
const BAND: f64 = 0.1;
/// A fall aims at this fraction of the affordable lights: medians of noisy times fluctuate, and a fall
/// follows their minimum.
const FALL_TO: f64 = 0.99;
/// A fall ends when this fraction of the lights can be afforded: below [`FALL_TO`], which is approached but
/// not reached.
const FALL_ENDS: f64 = 0.98;
/// Spare time is used up when no more than this multiple of the lights can be afforded.
const RISE_ENDS: f64 = 1.03;
/// Largest fractions of the lights that may be removed and added in one frame.
const MOST_FALL: f64 = 0.1;
const MOST_RISE: f64 = 0.02;
/// Fraction of the spare lights that is added in one frame: slow enough that frame times which arrive three
/// frames late can still stop it.
const RISE_PART: f64 = 0.1;
/// Frames without another attempt after additional lights have caused overload, for example where the next
/// light brings a costly shadow map: ten seconds at 60 Hz. It doubles with every failure, up to the maximum.
const PATIENCE: u32 = 600;
const MOST_PATIENCE: u32 = 8 * PATIENCE;

/// The frame time to keep, and the range of quality within which it is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct BudgetOptions {
    /// Target time of a frame, in nanoseconds.
    pub target_frame_time_ns: u64,
    /// The fewest lights, at least 1.
    pub least_lights: usize,
    /// The most lights, up to [`MAX_LIGHTS`].
    pub most_lights: usize,
    /// The fewest shadow maps; there are never more than lights.
    pub least_shadow_maps: usize,
    /// The most shadow maps, reached with the most lights.
    pub most_shadow_maps: usize,
}

impl Default for BudgetOptions {
    /// 60 frames a second; the paper's 300 lights and 72 shadow maps at most.
    fn default() -> Self {
        Self {
            target_frame_time_ns: 16_666_667,
            least_lights: 16,
            most_lights: 300,
            least_shadow_maps: 4,
            most_shadow_maps: 72,
        }
    }
}

/// Numbers of lights and shadow maps of the next frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quality {
    /// Length of the prefix.
    pub lights: usize,
    /// Number of shadow maps: in proportion to the lights, within their own bounds, never more than lights.
    pub shadow_maps: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Steady,
    Falling,
    Rising,
}

/// The controller. Its output depends only on the frame times it was given.
#[derive(Clone, Debug)]
pub struct Budget {
    options: BudgetOptions,
    phase: Phase,
    /// The number of lights, with the fractional part that slow changes need.
    level: f64,
    /// Affordable lights of the last frames, a ring buffer.
    affordable: [f64; SLOW],
    /// Number of frames in the ring, and the index of the next.
    filled: usize,
    next: usize,
    /// Lights when the phase began.
    entered_lights: f64,
    /// Number of frames for which the condition to end the fall or rise, or the condition for spare time, has
    /// held: medians lag behind recent changes, and a single one may be chance.
    leaving_frames: usize,
    /// Frames until spare time may be used again, and the number of such frames after the next failure.
    barred_frames: u32,
    patience_frames: u32,
}

impl Budget {
    /// Starts at the geometric mean of the bounds.
    ///
    /// # Errors
    /// `Usage` for a target of 0, for bounds in the wrong order, for 0 or more than [`MAX_LIGHTS`] lights,
    /// and for more shadow maps than lights.
    pub fn new(options: BudgetOptions) -> Result<Self> {
        let BudgetOptions {
            target_frame_time_ns,
            least_lights,
            most_lights,
            least_shadow_maps,
            most_shadow_maps,
        } = options;
        if target_frame_time_ns == 0 {
            return Err(Error::usage("give the time of a frame, such as 16666667")
                .at(Place::value("target_frame_time_ns", 0)));
        }
        if !(1 <= least_lights && least_lights <= most_lights && most_lights <= MAX_LIGHTS) {
            return Err(Error::usage(format!(
                "with most_lights = {most_lights}; give 1 to {MAX_LIGHTS}, the least first"
            ))
            .at(Place::value("least_lights", least_lights)));
        }
        if !(least_shadow_maps <= most_shadow_maps && most_shadow_maps <= most_lights) {
            return Err(Error::usage(format!(
                "with most_shadow_maps = {most_shadow_maps}; give 0 to most_lights ({most_lights}), the least first"
            ))
            .at(Place::value("least_shadow_maps", least_shadow_maps)));
        }
        Ok(Self {
            options,
            phase: Phase::Steady,
            level: (least_lights as f64 * most_lights as f64).sqrt().floor(),
            affordable: [0.0; SLOW],
            filled: 0,
            next: 0,
            entered_lights: 0.0,
            leaving_frames: 0,
            barred_frames: 0,
            patience_frames: PATIENCE,
        })
    }

    /// The quality of the next frame.
    pub fn quality(&self) -> Quality {
        let BudgetOptions { most_lights, least_shadow_maps, most_shadow_maps, .. } = self.options;
        let lights = self.level as usize;
        let share = (lights * most_shadow_maps) as f64 / most_lights as f64;
        let shadow_maps = (share.round() as usize).clamp(least_shadow_maps, most_shadow_maps).min(lights);
        Quality { lights, shadow_maps }
    }

    /// Takes the time of a frame that was rendered at [`Budget::quality`] and returns the quality of the
    /// next.
    ///
    /// Frame times converge to within 10 % of the target, or as close as the bounds allow; where one more
    /// light (below ten lights) or one more shadow map costs more than a tenth, they may stay lower. From
    /// then on nothing changes while frame times scatter by 5 %. In overload at most a tenth of the lights is
    /// removed per frame, from the fourth slow frame on; with spare time at most a fiftieth is added, after a
    /// second. (Numbers are integers: either may be one light more.) Frame times that arrive a few frames
    /// late only make a fall overshoot by as many frames.
    pub fn step(&mut self, frame_time_ns: u64) -> Quality {
        let time = frame_time_ns.max(1) as f64 / self.options.target_frame_time_ns as f64;
        self.affordable[self.next] = self.level.floor() / time;
        self.next = (self.next + 1) % SLOW;
        self.filled = (self.filled + 1).min(SLOW);
        self.barred_frames = self.barred_frames.saturating_sub(1);
        if self.filled >= FAST {
            self.adapt();
        }
        self.quality()
    }

    fn adapt(&mut self) {
        let (least, most) = (self.options.least_lights as f64, self.options.most_lights as f64);
        let lights = self.level.floor();
        let (fast, slow) = (self.median(FAST), self.median(SLOW));
        let is_overloaded = fast < lights / (1.0 + BAND) && lights > least;
        // Lights are integers: room for less than one more light is not spare time.
        let can_rise = |multiple: f64| slow >= (multiple * lights).max(lights + 1.0) && lights < most;
        let is_full = self.filled == SLOW;
        let may_leave = match self.phase {
            Phase::Steady => is_full && self.barred_frames == 0 && can_rise(1.0 / (1.0 - BAND)),
            Phase::Falling => fast >= FALL_ENDS * lights || lights <= least,
            Phase::Rising => is_full && !can_rise(RISE_ENDS),
        };
        self.leaving_frames = if may_leave { self.leaving_frames + 1 } else { 0 };
        let has_ended = self.leaving_frames >= if self.phase == Phase::Falling { FAST } else { SLOW };
        match self.phase {
            Phase::Steady if is_overloaded => {
                self.patience_frames = PATIENCE;
                self.enter(Phase::Falling);
            }
            Phase::Steady if has_ended => self.enter(Phase::Rising),
            // The last light may have brought a shadow map, and both together may cost too much.
            Phase::Rising if is_overloaded || has_ended && RISE_ENDS * slow < lights => {
                if lights > self.entered_lights {
                    self.barred_frames = self.patience_frames;
                    self.patience_frames = (2 * self.patience_frames).min(MOST_PATIENCE);
                }
                self.enter(Phase::Falling);
            }
            Phase::Rising if has_ended => self.enter(Phase::Steady),
            Phase::Falling if has_ended => {
                // Frames from before the overload would indicate spare time that no longer exists. A fall in
                // large steps may have overshot; the remaining time is then used, unless a rise has just
                // failed.
                self.filled = 0;
                self.enter(if self.barred_frames == 0 { Phase::Rising } else { Phase::Steady });
            }
            _ => {}
        }
        match self.phase {
            Phase::Steady => {}
            Phase::Falling => {
                let aim = FALL_TO * fast;
                self.level = (self.level * (1.0 - MOST_FALL)).max(aim).min(self.level).max(least);
            }
            Phase::Rising if !is_full => {}
            Phase::Rising => {
                let step = (RISE_PART * (slow - self.level)).min(MOST_RISE * self.level);
                self.level = (self.level + step.max(0.0)).min(most);
            }
        }
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.leaving_frames = 0;
        self.level = self.level.floor();
        self.entered_lights = self.level;
    }

    /// Median of the affordable lights of the last `count` frames, or of as many as there are.
    fn median(&self, count: usize) -> f64 {
        let count = count.min(self.filled);
        let mut sorted = [0.0; SLOW];
        for (age, value) in sorted.iter_mut().take(count).enumerate() {
            *value = self.affordable[(self.next + SLOW - 1 - age) % SLOW];
        }
        let sorted = &mut sorted[..count];
        sorted.sort_unstable_by(f64::total_cmp);
        sorted[count / 2]
    }
}

#[cfg(test)]
mod tests;
