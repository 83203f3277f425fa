//! A FIR for quantities that are energies: the output is never negative, and in total it equals the input.
//!
//! An equiripple filter has negative taps. After a flash, or where a light hands its power over to its
//! neighbour, the linear output `y_i(t) = sum_k h_k x_i(t - k)` of a light i falls below zero. Clipping it
//! there adds power. What was added is taken from other lights of the same *group* (one colour channel of a
//! list) in the same frame: a hand-over makes one light overshoot as far as the other undershoots, and only
//! together are they correct. What the group cannot pay at once stays as its *debt* d. With Y the sum of the
//! y_i, the group's output is, in general,
//!
//! ```text
//! out(t) = Y(t) - d(t - 1),        d(t) = d(t - 1) + out(t) - Y(t),
//! ```
//!
//! within two limits that keep the cost of a flash with the flash. Each light's window is split into its
//! least value b_i, the steady part, and the excess over it.
//!
//! - The output is at least the steady parts, `sum_i min(max(y_i, 0), b_i)`: a flash does not darken other
//!   lights.
//! - The excess gives no more than it holds. With `T_k = 1 - (h_0 + ... + h_(k-1))`, the share of an input of
//!   age k that has not been output before this frame, and D the delay, it holds `E = sum_i (sum_k T_k
//!   x_i(t - k) - (D + 1) b_i) - d(t - 1)`. Without this limit a flash of 1e6 over a steady 1 would end in a
//!   negative lobe for which the steady part would pay with 57,000 dark frames.
//!
//! So the debt is at most the excess that has not been output yet, `sum_i sum_k T_(k+1) (x_i(t - k) - b_i)`,
//! and nothing once the window is constant. One exception: while a debt is open, inputs may settle at a
//! higher level, which turns excess into steady part and makes E negative. Then the first limit is lowered by
//! -E, and a steady level s pays the debt within D + 1 frames, since the debt was at most about D s. Where no
//! light is clipped and no debt is open, the result is exactly that of the linear filter.

use super::history::History;

/// Columns that are summed together: their sums stay in registers and the first-level cache while the rows
/// stream by.
const BLOCK: usize = 64;

/// Filters the first columns of a [`History`], in groups that share a debt.
#[derive(Clone, Debug, Default)]
pub(super) struct EnergyFilter {
    taps: Vec<f64>,
    /// T_k above.
    pending: Vec<f64>,
    /// D + 1.
    steady_frames: f64,
    /// Columns and debt of every group.
    groups: Vec<(usize, f64)>,
    linear: Vec<f64>,
    stock: Vec<f64>,
    least: Vec<f32>,
}

impl EnergyFilter {
    /// For symmetric `taps` of sum 1 and groups of `group_sizes` columns, side by side from column 0, without
    /// debts.
    pub(super) fn new(taps: &[f64], group_sizes: impl Iterator<Item = usize>) -> Self {
        let leave = |left: &mut f64, tap: &f64| {
            let pending = *left;
            *left -= tap;
            Some(pending)
        };
        let groups: Vec<(usize, f64)> = group_sizes.map(|size| (size, 0.0)).collect();
        let columns = groups.iter().map(|&(size, _)| size).sum();
        Self {
            taps: taps.to_vec(),
            pending: taps.iter().scan(1.0, leave).collect(),
            steady_frames: (taps.len() / 2 + 1) as f64,
            groups,
            linear: vec![0.0; columns],
            stock: vec![0.0; columns],
            least: vec![0.0; columns],
        }
    }

    /// Forgives all debts: the history has been filled anew.
    pub(super) fn clear(&mut self) {
        self.groups.iter_mut().for_each(|(_, debt)| *debt = 0.0);
    }

    /// Output for the newest row of `history`: one finite value >= 0 per column.
    pub(super) fn step(&mut self, history: &History) -> &[f64] {
        self.convolve(history);
        let mut start = 0;
        for (size, debt) in &mut self.groups {
            let group = start..start + *size;
            start = group.end;
            let (stock, least) = (&self.stock[group.clone()], &self.least[group.clone()]);
            settle(&mut self.linear[group], stock, least, self.steady_frames, debt);
        }
        &self.linear
    }

    /// Per column: the linear output, `sum_k T_k x(t - k)`, and the least value of the window.
    fn convolve(&mut self, history: &History) {
        let columns = self.linear.len();
        for start in (0..columns).step_by(BLOCK) {
            let width = BLOCK.min(columns - start);
            let (mut linear, mut stock, mut least) = ([0.0; BLOCK], [0.0; BLOCK], [f32::INFINITY; BLOCK]);
            for (age, (&tap, &pending)) in self.taps.iter().zip(&self.pending).enumerate() {
                for (i, &value) in history.row(age)[start..start + width].iter().enumerate() {
                    linear[i] += tap * f64::from(value);
                    stock[i] += pending * f64::from(value);
                    least[i] = least[i].min(value);
                }
            }
            let block = start..start + width;
            self.linear[block.clone()].copy_from_slice(&linear[..width]);
            self.stock[block.clone()].copy_from_slice(&stock[..width]);
            self.least[block].copy_from_slice(&least[..width]);
        }
    }

    /// What each group has given in excess of the linear filter; negative where it holds something back.
    #[cfg(test)]
    pub(super) fn debts(&self) -> impl Iterator<Item = f64> {
        self.groups.iter().map(|&(_, debt)| debt)
    }
}

/// Turns the linear outputs `values` of a group into its output.
fn settle(values: &mut [f64], stock: &[f64], least: &[f32], steady_frames: f64, debt: &mut f64) {
    let (mut linear, mut positive, mut floor, mut steady, mut held) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ((&value, &stock), &least) in values.iter().zip(stock).zip(least) {
        let least = f64::from(least);
        linear += value;
        positive += value.max(0.0);
        floor += value.clamp(0.0, least);
        steady += least;
        held += stock;
    }
    if positive == 0.0 && held == 0.0 {
        // A dark window holds nothing, so a debt here is rounding and must not become light.
        *debt = 0.0;
        values.fill(0.0);
        return;
    }
    let excess = held - steady_frames * steady - *debt;
    let at_least = (floor + excess.min(0.0)).max(0.0);
    let wanted = (linear - *debt).min(steady + excess).max(at_least);
    // Shares of the steady parts and of the parts above them that are given. Where nothing lies above,
    // nothing more is given.
    let of_floor = if wanted < floor { wanted / floor } else { 1.0 };
    let of_rest =
        if wanted > floor && positive > floor { (wanted - floor) / (positive - floor) } else { 0.0 };
    let mut given = 0.0;
    for (value, &least) in values.iter_mut().zip(least) {
        let part = value.clamp(0.0, f64::from(least));
        *value = part * of_floor + (value.max(0.0) - part) * of_rest;
        given += *value;
    }
    *debt += given - linear;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::temporal::test_taps::taps;

    /// Runs one signal from a filled history; returns outputs and debts in step.
    fn run(rate: f64, signal: &[f32]) -> (Vec<f64>, Vec<f64>) {
        let taps = taps(rate);
        let mut history = History::new(taps.as_slice().len(), 1);
        let mut filter = EnergyFilter::new(taps.as_slice(), std::iter::once(1));
        history.newest_mut()[0] = signal[0];
        (1..taps.as_slice().len()).for_each(|_| history.repeat());
        let step = |&value: &f32| {
            history.push()[0] = value;
            let out = filter.step(&history)[0];
            (out, filter.debts().next().unwrap())
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
            let length = taps(rate).order() + 1;
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
            // The first list stands for all time before: 4 frames of `before` are on their way in at the
            // start, 4 frames of `after` at the end.
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
        let taps = taps(25.0);
        let mut random = noise(3);
        // Level 1 to 1.5: the negative taps (-0.25 in sum) cannot reach below zero.
        let signal: Vec<f32> = (0..200).map(|_| 1.0 + 0.5 * random()).collect();
        let (out, debt) = run(25.0, &signal);
        for t in 8..200 {
            let direct: f64 = (0..9).map(|k| taps.as_slice()[k] * f64::from(signal[t - k])).sum();
            assert!((out[t] - direct).abs() < 1e-12 && debt[t].abs() < 1e-12);
        }
    }

    /// Runs lights of one group; returns the outputs of each frame.
    fn run_group(signal: &[[f32; 3]]) -> Vec<[f64; 3]> {
        let taps = taps(25.0);
        let mut history = History::new(9, 3);
        let mut filter = EnergyFilter::new(taps.as_slice(), std::iter::once(3));
        history.newest_mut().copy_from_slice(&signal[0]);
        (1..9).for_each(|_| history.repeat());
        let step = |values: &[f32; 3]| {
            history.push().copy_from_slice(values);
            filter.step(&history).try_into().unwrap()
        };
        signal.iter().map(step).collect()
    }

    #[test]
    fn a_light_that_hands_its_power_over_keeps_the_sum_in_every_frame() {
        let signal: Vec<[f32; 3]> =
            (0..40).map(|t| if t < 15 { [500.0, 0.0, 2.0] } else { [0.0, 500.0, 2.0] }).collect();
        for (t, out) in run_group(&signal).iter().enumerate() {
            assert!(out.iter().all(|&y| y >= 0.0));
            assert!((out[0] + out[1] - 500.0).abs() < 1e-9 && (out[2] - 2.0).abs() < 1e-12, "{t}: {out:?}");
        }
    }

    #[test]
    fn a_flash_leaves_the_other_lights_alone_and_keeps_its_energy() {
        let mut signal = vec![[0.0, 1.0, 3.0]; 40];
        signal[12][0] = 1e6;
        signal[13][0] = 1e6;
        let out = run_group(&signal);
        for (t, out) in out.iter().enumerate() {
            assert!(
                out[0] >= 0.0 && (out[1] - 1.0).abs() < 1e-9 && (out[2] - 3.0).abs() < 1e-9,
                "{t}: {out:?}"
            );
        }
        let flash: f64 = out.iter().map(|out| out[0]).sum();
        assert!((flash / 2e6 - 1.0).abs() < 1e-12, "{flash}");
    }

    #[test]
    fn groups_do_not_pay_for_each_other() {
        let taps = taps(25.0);
        let mut history = History::new(9, 2);
        let mut filter = EnergyFilter::new(taps.as_slice(), [1, 1].into_iter());
        for t in 0..30 {
            history.push().copy_from_slice(&[if t == 10 { 1e6 } else { 0.0 }, 1.0 + (t % 3) as f32 * 0.1]);
            let other = filter.step(&history)[1];
            if t >= 8 {
                let linear: f64 = (0..9).map(|k| taps.as_slice()[k] * f64::from(history.row(k)[1])).sum();
                assert!((other - linear).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn energy_of_a_group_is_kept_when_its_lights_flash_in_turn() {
        let mut random = noise(11);
        let mut signal = vec![[0.0f32; 3]];
        signal.extend((0..20_000).map(|_| [0; 3].map(|_| 1e3 * random().powi(12))));
        signal.extend([[0.0; 3]; 20]);
        let out = run_group(&signal);
        let given: f64 = signal.iter().flatten().copied().map(f64::from).sum();
        let left: f64 = out.iter().flatten().sum();
        assert!((left / given - 1.0).abs() < 1e-12 && out.iter().flatten().all(|&y| y >= 0.0));
        assert_eq!(out[out.len() - 1], [0.0; 3]);
    }
}
