//! A FIR for quantities that are energies: what leaves is never negative, and in total as much leaves as came in.
//!
//! An equiripple filter has negative taps. After a flash its output y would fall below zero; clipped there, it
//! would give more than it got. So what clipping added is carried as a *debt* d and taken from later output:
//!
//!     out(t) = max(0, y(t) - d(t - 1)),        d(t) = d(t - 1) + out(t) - y(t).
//!
//! Alone that rule has a fault. A flash of 1e6 over a steady 1 ends in a negative lobe whose debt the steady part
//! would pay with 57,000 dark frames. Hence a second limit: the window is split into its least value b, the steady
//! part, and the excess over it, and the excess may never give more than it holds. With T_i = 1 - (h_0 + ... +
//! h_(i-1)), the share of an input of age i that has yet to leave before this frame's output, and D the delay,
//!
//!     stock(t) = sum_i T_i x(t - i) - D b - d(t - 1),        out(t) <= stock(t).
//!
//! The debt is then at most the excess still on its way, `sum_i T_(i+1) (x(t - i) - b)`: bounded by D times the
//! largest input of the window (plus overshoot) and nothing once the window is constant, at zero or elsewhere.
//! Where d < 0 (the limit held something back) the rest leaves as soon as the taps allow.

use super::history::History;

/// Columns that are filtered together: their sums stay in the first-level cache while the rows stream by.
const BLOCK: usize = 64;

/// Filters the first `count` columns of a [`History`].
#[derive(Clone, Debug, Default)]
pub(super) struct EnergyFilter {
    taps: Vec<f64>,
    /// T_i above.
    pending: Vec<f64>,
    delay_frames: f64,
    /// Given so far in excess of the linear filter's output.
    debt: Vec<f64>,
    out: Vec<f64>,
}

impl EnergyFilter {
    /// For symmetric `taps` of sum 1 and `count` columns, without debts.
    pub(super) fn new(taps: &[f64], count: usize) -> Self {
        let leave = |left: &mut f64, tap: &f64| {
            let pending = *left;
            *left -= tap;
            Some(pending)
        };
        let pending = taps.iter().scan(1.0, leave).collect();
        Self {
            taps: taps.to_vec(),
            pending,
            delay_frames: (taps.len() / 2) as f64,
            debt: vec![0.0; count],
            out: vec![0.0; count],
        }
    }

    /// Forgives all debts: the history has been filled anew.
    pub(super) fn clear(&mut self) {
        self.debt.fill(0.0);
    }

    /// Output for the newest row of `history`: one finite value >= 0 a column.
    pub(super) fn step(&mut self, history: &History) -> &[f64] {
        let count = self.debt.len();
        for start in (0..count).step_by(BLOCK) {
            let width = BLOCK.min(count - start);
            let (mut linear, mut stock, mut least) = ([0.0; BLOCK], [0.0; BLOCK], [f32::INFINITY; BLOCK]);
            for (age, (&tap, &pending)) in self.taps.iter().zip(&self.pending).enumerate() {
                let row = &history.row(age)[start..start + width];
                for (i, &value) in row.iter().enumerate() {
                    linear[i] += tap * f64::from(value);
                    stock[i] += pending * f64::from(value);
                    least[i] = least[i].min(value);
                }
            }
            let block = start..start + width;
            for (i, (debt, out)) in self.debt[block.clone()].iter_mut().zip(&mut self.out[block]).enumerate()
            {
                if linear[i] == 0.0 && stock[i] == 0.0 {
                    // A dark window holds nothing, so that a debt here is rounding: it must not glow.
                    (*debt, *out) = (0.0, 0.0);
                    continue;
                }
                let stock = stock[i] - self.delay_frames * f64::from(least[i]) - *debt;
                *out = (linear[i] - *debt).min(stock).max(0.0);
                *debt += *out - linear[i];
            }
        }
        &self.out
    }

    /// What each column has given in excess of the linear filter; negative where it holds something back.
    #[cfg(test)]
    pub(super) fn debt(&self) -> &[f64] {
        &self.debt
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::temporal::{FilterOptions, design};

    /// Runs one signal from a filled history; returns outputs and debts in step.
    fn run(rate: f64, signal: &[f32]) -> (Vec<f64>, Vec<f64>) {
        let taps = design(rate, &FilterOptions::default()).unwrap();
        let mut history = History::new(taps.as_slice().len(), 1);
        let mut filter = EnergyFilter::new(taps.as_slice(), 1);
        history.newest_mut()[0] = signal[0];
        (1..taps.as_slice().len()).for_each(|_| history.repeat());
        let step = |&value: &f32| {
            history.push()[0] = value;
            let out = filter.step(&history)[0];
            (out, filter.debt()[0])
        };
        signal.iter().map(step).unzip()
    }

    /// Deterministic noise in [0, 1): the top bits of a 64-bit linear congruential generator (Knuth's MMIX).
    fn noise(seed: u64) -> impl FnMut() -> f32 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        }
    }

    fn sum(values: &[f64]) -> f64 {
        values.iter().sum()
    }

    #[test]
    fn strobe_at_every_frame_is_never_negative_and_keeps_its_energy() {
        for period in 2..=12 {
            for rate in [19.2, 24.0, 25.0, 30.0, 60.0] {
                let mut signal: Vec<f32> =
                    (0..600).map(|t| if t % period == 1 { 1e4 } else { 0.0 }).collect();
                signal.extend([0.0; 40]);
                let (out, _) = run(rate, &signal);
                assert!(out.iter().all(|&y| y >= 0.0));
                let given: f64 = signal.iter().copied().map(f64::from).sum();
                assert!((sum(&out) / given - 1.0).abs() < 1e-12, "{period} {rate}: {}", sum(&out) / given);
            }
        }
    }

    #[test]
    fn single_flash_gives_its_energy_within_the_filter_length_at_every_rate() {
        for rate in [19.2, 20.0, 24.0, 25.0, 30.0, 50.0, 60.0, 120.0, 1000.0] {
            let length = design(rate, &FilterOptions::default()).unwrap().order() + 1;
            let mut signal = vec![0.0; 2 * length + 5];
            signal[3] = 1e6;
            let (out, debt) = run(rate, &signal);
            assert!(out.iter().all(|&y| y >= 0.0));
            assert!((sum(&out[3..3 + length]) / 1e6 - 1.0).abs() < 1e-12, "{rate} Hz: {}", sum(&out));
            assert!(out[..3].iter().chain(&out[3 + length..]).all(|&y| y == 0.0));
            assert_eq!(debt[debt.len() - 1], 0.0);
        }
    }

    #[test]
    fn flash_over_a_dim_background_does_not_darken_it_for_longer_than_the_filter_lasts() {
        let mut signal = [1.0; 40];
        signal[10] = 1e6;
        let (out, debt) = run(25.0, &signal);
        assert!(out.iter().all(|&y| y >= 0.0));
        for t in (0..10).chain(19..40) {
            assert!((out[t] - 1.0).abs() < 1e-9 && debt[t].abs() < 1e-9, "frame {t}: {} {}", out[t], debt[t]);
        }
        assert!((sum(&out) / (1e6 + 39.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn steps_keep_their_energy_up_and_down() {
        for (before, after) in [(0.0, 1.0), (1.0, 0.0), (1.0, 1e5), (1e5, 1.0)] {
            let signal: Vec<f32> = (0..60).map(|t| if t < 20 { before } else { after }).collect();
            let (out, debt) = run(25.0, &signal);
            // The first list stands for all time before: 4 frames of `before` are on their way in at the start,
            // 4 frames of `after` at the end.
            let given = 24.0 * f64::from(before) + 36.0 * f64::from(after);
            assert!((sum(&out) / given - 1.0).abs() < 1e-12, "{before} {after}: {}", sum(&out) / given);
            assert!(out.iter().all(|&y| y >= 0.0) && debt[59].abs() < 1e-9);
            assert!((out[59] - f64::from(after)).abs() < 1e-9 * f64::from(before.max(after)));
        }
    }

    #[test]
    fn debt_stays_below_what_is_on_its_way_and_is_paid_when_the_light_stays() {
        // Spikes of very different height, each followed by a steady stretch of random level.
        let mut random = noise(7);
        let (mut worst, mut settled, mut signal) = (0.0f64, 0, Vec::new());
        for _ in 0..2000 {
            let level = random();
            let height = 10f32.powf(6.0 * random());
            let run = 1 + (random() * 4.0) as usize;
            signal.extend(std::iter::repeat_n(height, run));
            signal.extend(std::iter::repeat_n(level, 1 + (random() * 20.0) as usize));
        }
        let (out, debt) = run(25.0, &signal);
        for t in 8..signal.len() {
            let window = &signal[t - 8..=t];
            let (least, most) = window.iter().fold((f32::MAX, 0.0f32), |(a, b), &x| (a.min(x), b.max(x)));
            let excess = f64::from(most - least);
            // 4 frames of delay and the overshoot of the step response, 0.058 of a frame at a time.
            assert!(debt[t] <= 4.13 * excess + 1e-6, "frame {t}: {} of {excess}", debt[t]);
            worst = worst.max(debt[t] / f64::from(most));
            // At most 4.13 frames of the steady level, so paid after five frames of constant window.
            if t >= 13 && signal[t - 13..=t].iter().all(|&x| x == least) {
                assert!(debt[t].abs() < 1e-6 && (out[t] - f64::from(least)).abs() < 1e-6, "frame {t}");
                settled += 1;
            }
        }
        assert!(settled > 1000, "{settled}");
        assert!(worst > 0.05, "the signal must cause debts: {worst}");
        println!("largest debt: {worst:.3} of the window's largest input");
    }

    #[test]
    fn energy_is_kept_over_a_long_random_sequence() {
        for rate in [20.0, 25.0, 60.0] {
            let mut random = noise(1);
            let mut signal: Vec<f32> = vec![0.0];
            // Mostly dim with sudden peaks, so that clipping happens all the time.
            signal.extend((0..100_000).map(|_| 1e3 * random().powi(12)));
            signal.extend([0.0; 40]);
            let (out, _) = run(rate, &signal);
            let given: f64 = signal.iter().copied().map(f64::from).sum();
            let relative = sum(&out) / given - 1.0;
            println!("{rate} Hz: 100,000 frames, energy off by {relative:.1e}");
            assert!(relative.abs() < 1e-12 && out.iter().all(|&y| y >= 0.0));
        }
    }

    #[test]
    fn output_without_clipping_is_the_plain_convolution() {
        let taps = design(25.0, &FilterOptions::default()).unwrap();
        let mut random = noise(3);
        // Level 1 to 1.5: the negative taps (-0.25 in sum) cannot reach below zero.
        let signal: Vec<f32> = (0..200).map(|_| 1.0 + 0.5 * random()).collect();
        let (out, debt) = run(25.0, &signal);
        for t in 8..200 {
            let direct: f64 = (0..9).map(|k| taps.as_slice()[k] * f64::from(signal[t - k])).sum();
            assert!((out[t] - direct).abs() < 1e-12 && debt[t].abs() < 1e-12);
        }
    }
}
