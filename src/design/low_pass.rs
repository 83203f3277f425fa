//! Equiripple linear-phase low-pass filters (Parks-McClellan), designed by the crate `pm-remez`.
//!
//! The nine weights printed in the paper result from order 8, a pass band up to 7 Hz and a stop band from 9.6
//! Hz at 25 Hz, not from the values 21, 7 and 9 Hz of its text. At other frame rates the bands stay the same
//! and the order is the even number whose delay is nearest to the paper's 4 frames at 25 Hz, 160 ms.

use crate::error::{Error, Place, Result};
use lightcast_core::temporal::{Directions, Taps};
use pm_remez::{Band, PMParameters, ParametersBuilder, pm_remez};
use serde::Deserialize;
use std::f64::consts::TAU;

/// Highest order that is designed. The design is tested up to this order (2000 frames/s at 160 ms, which
/// takes 27 ms once); a longer history of 300 lights would far exceed the cache.
const MAX_ORDER: usize = 640;

/// Highest attenuation that is designed, in decibels: the last bit of an f32, of which lights are made. Where
/// more is asked for, the ripple is lost in the rounding of f64, and the exchange finds no peaks (from 154 dB
/// on) or does not end (at 450 dB).
const ATTENUATION_MAX_DB: f64 = 140.0;

/// Relative difference of the ripple peaks at which the exchange stops, and above which a design is refused.
/// 1e-6 of a ripple of 0.09 changes taps by 1e-7.
const FLATNESS: f64 = 1e-6;
const FLATNESS_LIMIT: f64 = 1e-2;

/// Least width of the stop band in units of the frame rate: at a frame rate of twice the stop frequency the
/// band is a single point, and the exchange has no interval to search.
const MIN_BAND: f64 = 1e-6;

/// How lights are filtered over time.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FilterOptions {
    /// Whether lists are filtered at all.
    pub enabled: bool,
    /// Upper edge of the pass band.
    pub pass_hz: f64,
    /// Lower edge of the stop band. Sequences of fewer than twice as many frames per second are not filtered.
    pub stop_hz: f64,
    /// Desired delay in seconds; rounded to whole frames it determines the order.
    pub delay_s: f64,
    /// How frames are weighted in a light's direction.
    pub directions: Directions,
}

impl Default for FilterOptions {
    /// The published filter: 7 Hz, 9.6 Hz, 4 frames at 25 Hz.
    fn default() -> Self {
        Self { enabled: true, pass_hz: 7.0, stop_hz: 9.6, delay_s: 0.16, directions: Directions::ByPower }
    }
}

impl FilterOptions {
    /// Checks the values.
    ///
    /// # Errors
    /// Kind `Usage`, naming the key, unless `0 < pass_hz < stop_hz` and `delay_s >= 0`, all finite.
    pub fn check(&self) -> Result<()> {
        let Self { pass_hz, stop_hz, delay_s, .. } = *self;
        if !(pass_hz.is_finite() && pass_hz > 0.0) {
            return Err(Error::usage("must be a frequency above 0 Hz").at(Place::value("pass_hz", pass_hz)));
        }
        if !(stop_hz.is_finite() && stop_hz > pass_hz) {
            return Err(Error::usage(format!("must be a frequency above pass_hz = {pass_hz}"))
                .at(Place::value("stop_hz", stop_hz)));
        }
        if !(delay_s.is_finite() && delay_s >= 0.0) {
            return Err(Error::usage("must be a time of at least 0 s").at(Place::value("delay_s", delay_s)));
        }
        Ok(())
    }
}

/// Taps for a frame rate: order `2 round(delay_s * frame_rate_hz)`, gain 1 at 0 Hz.
///
/// Returns [`Taps::identity`] where nothing is filtered: options not `enabled`, a rate below `2 stop_hz` (the
/// stop band lies above the Nyquist frequency), an unknown rate (NaN, zero or negative), a delay that rounds
/// to zero frames.
///
/// # Errors
/// Kind `Usage` for options that [`FilterOptions::check`] refuses, for an order above 640 (rates above 2000
/// Hz at the default delay) and for bands that no filter of this order can separate.
pub fn low_pass(frame_rate_hz: f64, options: &FilterOptions) -> Result<Taps> {
    options.check()?;
    // The condition is written so that NaN also fails it.
    let sampled = frame_rate_hz > 0.0 && frame_rate_hz >= 2.0 * options.stop_hz;
    let delay_frames = (options.delay_s * frame_rate_hz).round();
    if !options.enabled || !sampled || delay_frames == 0.0 {
        return Ok(Taps::identity());
    }
    if delay_frames > (MAX_ORDER / 2) as f64 {
        return Err(Error::usage(format!(
            "a delay of delay_s = {} s at {frame_rate_hz} frames/s needs a filter of an order above {MAX_ORDER}, the \
             highest that is designed: lower delay_s or the frame rate, or switch the filter off",
            options.delay_s,
        )));
    }
    check_attenuation(2 * delay_frames as usize, frame_rate_hz, options)?;
    let mut taps = equiripple(2 * delay_frames as usize, frame_rate_hz, options.pass_hz, options.stop_hz)?;
    let sum: f64 = taps.iter().sum();
    // The gain at 0 Hz is 1 plus or minus the ripple; with a ripple this large there is no pass band.
    if !(0.5..=1.5).contains(&sum) {
        return Err(cannot_tell_apart(options.pass_hz, options.stop_hz, frame_rate_hz, taps.len() - 1));
    }
    taps.iter_mut().for_each(|tap| *tap /= sum);
    Ok(Taps::new(taps)?)
}

/// Refuses an order that attenuates more than anybody could see; by Kaiser's estimate, the attenuation is
/// 8 dB + 2.285 dB times the order and the width of the transition in radians per frame.
fn check_attenuation(order: usize, frame_rate_hz: f64, options: &FilterOptions) -> Result<()> {
    let transition_rad = TAU * (options.stop_hz - options.pass_hz) / frame_rate_hz;
    let order_max = (ATTENUATION_MAX_DB - 8.0) / (2.285 * transition_rad);
    if order as f64 <= order_max.max(2.0) {
        return Ok(());
    }
    let delay_max_s = (0.5 * order_max).floor().max(1.0) / frame_rate_hz;
    Err(Error::usage(format!(
        "a filter of order {order}, for a delay of delay_s = {} s at {frame_rate_hz} frames/s, stops more than \
         {ATTENUATION_MAX_DB} dB between {} and {} Hz, which nobody can see: {delay_max_s:.2} s are enough",
        options.delay_s, options.pass_hz, options.stop_hz,
    )))
}

/// Equiripple low-pass of even `order` with the same weight on both bands, not normalised.
fn equiripple(order: usize, frame_rate_hz: f64, pass_hz: f64, stop_hz: f64) -> Result<Vec<f64>> {
    let failed = || cannot_tell_apart(pass_hz, stop_hz, frame_rate_hz, order);
    let (pass, stop) = (pass_hz / frame_rate_hz, (stop_hz / frame_rate_hz).min(0.5 - MIN_BAND));
    if stop - pass < MIN_BAND || pass < MIN_BAND {
        return Err(failed());
    }
    let bands = [Band::new(0.0, pass), Band::new(stop, 0.5)];
    let bands = bands.into_iter().collect::<Result<Vec<_>, _>>().map_err(|e| failed().because(e))?;
    let middle = 0.5 * (pass + stop);
    let desired = move |f: f64| if f < middle { 1.0 } else { 0.0 };
    let mut parameters =
        PMParameters::new(order + 1, bands, desired, |_| 1.0).map_err(|e| failed().because(e))?;
    parameters.set_flatness_threshold(FLATNESS);
    let design = pm_remez(&parameters).map_err(|e| failed().because(e))?;
    if !(design.flatness <= FLATNESS_LIMIT && design.impulse_response.iter().all(|tap| tap.is_finite())) {
        return Err(failed());
    }
    Ok(design.impulse_response)
}

fn cannot_tell_apart(pass_hz: f64, stop_hz: f64, frame_rate_hz: f64, order: usize) -> Error {
    Error::usage(format!(
        "no filter of order {order} at {frame_rate_hz} frames/s passes {pass_hz} Hz and stops {stop_hz} Hz: \
         move pass_hz and stop_hz apart or change delay_s"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;

    /// Amplitude response of symmetric taps: `h_m + 2 sum_k h_(m-k) cos(2 pi f k)`, f in units of the frame
    /// rate.
    fn gain(taps: &[f64], f: f64) -> f64 {
        let middle = taps.len() / 2;
        taps[middle] + 2.0 * (1..=middle).map(|k| taps[middle - k] * (TAU * f * k as f64).cos()).sum::<f64>()
    }

    /// Largest distance of the response from 1 in the pass band and from 0 in the stop band, on a fine grid.
    fn ripples(taps: &[f64], frame_rate_hz: f64, pass_hz: f64, stop_hz: f64) -> (f64, f64) {
        let steps = 40 * taps.len();
        let worst = |from: f64, to: f64, wanted: f64| {
            (0..=steps)
                .map(|i| (gain(taps, from + (to - from) * i as f64 / steps as f64) - wanted).abs())
                .fold(0.0, f64::max)
        };
        (worst(0.0, pass_hz / frame_rate_hz, 1.0), worst(stop_hz / frame_rate_hz, 0.5, 0.0))
    }

    fn assert_near(taps: &[f64], expected: [f64; 5], tolerance: f64) {
        assert_eq!(taps.len(), 9);
        for (k, expected) in expected.into_iter().enumerate() {
            assert!((taps[k] - expected).abs() < tolerance, "tap {k}: {} and {expected}", taps[k]);
            assert_eq!(taps[k], taps[8 - k]);
        }
    }

    #[test]
    fn published_taps_come_out_of_25_7_and_9_6_hz() {
        let taps = equiripple(8, 25.0, 7.0, 9.6).unwrap();
        assert_near(&taps, [0.06216, 0.01296, -0.13816, 0.28315, 0.65223], 5e-5);
        let sum: f64 = taps.iter().sum();
        assert!((sum - 1.09245).abs() < 1e-4, "{sum}");
        // Divided by their sum, these are the taps in use.
        let used = low_pass(25.0, &FilterOptions::default()).unwrap();
        assert!(used.as_slice().iter().zip(&taps).all(|(used, tap)| (used * sum - tap).abs() < 1e-15));
        assert_eq!((used.order(), used.delay_frames()), (8, 4));
    }

    #[test]
    fn text_of_the_paper_gives_other_taps() {
        let taps = equiripple(8, 21.0, 7.0, 9.0).unwrap();
        assert_near(&taps, [0.0245, 0.0984, -0.1550, 0.2147, 0.7611], 5e-5);
    }

    #[test]
    fn gain_is_one_at_0_hz_and_ripples_are_equal_at_every_rate() {
        for rate in [19.2, 19.3, 20.0, 21.0, 23.976, 24.0, 25.0, 29.97, 30.0, 50.0, 60.0, 90.0, 120.0, 240.0]
        {
            let taps = low_pass(rate, &FilterOptions::default()).unwrap();
            assert_eq!(taps.order(), 2 * (0.16 * rate).round() as usize, "{rate} Hz");
            assert!((gain(taps.as_slice(), 0.0) - 1.0).abs() < 1e-12);
            // Chebyshev's alternation theorem: the best filter has equal ripples in both bands. At a frame
            // rate of twice the stop frequency the stop band is one point.
            let (pass, stop) = ripples(&equiripple(taps.order(), rate, 7.0, 9.6).unwrap(), rate, 7.0, 9.6);
            assert!((pass / stop - 1.0).abs() < 2e-3, "{rate} Hz: {pass} {stop}");
            assert!(pass < 0.13, "{rate} Hz: {pass}");
        }
    }

    #[test]
    fn error_alternates_at_one_more_point_than_there_are_cosines() {
        // 5 cosines at 25 Hz: the best approximation has 6 extrema of alternating sign.
        let taps = equiripple(8, 25.0, 7.0, 9.6).unwrap();
        let (ripple, _) = ripples(&taps, 25.0, 7.0, 9.6);
        let mut signs = Vec::new();
        for i in 0..=100_000 {
            let f = 0.5 * f64::from(i) / 100_000.0;
            let error = match f * 25.0 {
                hz if hz <= 7.0 => gain(&taps, f) - 1.0,
                hz if hz >= 9.6 => gain(&taps, f),
                _ => continue,
            };
            if error.abs() > ripple * 0.999 && signs.last() != Some(&error.signum()) {
                signs.push(error.signum());
            }
        }
        assert_eq!(signs.len(), 6, "{signs:?}");
    }

    #[test]
    fn high_rates_work_up_to_order_640_and_are_refused_in_words_above() {
        for rate in [500.0, 1000.0, 2000.0] {
            let taps = low_pass(rate, &FilterOptions::default()).unwrap();
            assert_eq!(taps.delay_frames(), (0.16 * rate) as u32);
            assert!((gain(taps.as_slice(), 0.0) - 1.0).abs() < 1e-12);
            let (pass, stop) = ripples(taps.as_slice(), rate, 7.0, 9.6);
            // Ripple 0.0812 before, at most (1 +- 0.0812) / 1.0812 after normalisation.
            assert!(pass < 0.151 && stop < 0.0752, "{rate} Hz: {pass} {stop}");
        }
        for rate in [2010.0, 1e300, f64::INFINITY] {
            let error = low_pass(rate, &FilterOptions::default()).unwrap_err();
            assert_eq!(error.kind(), Kind::Usage);
            assert!(error.to_string().contains("above 640"), "{error}");
        }
    }

    #[test]
    fn slow_and_unknown_rates_are_not_filtered() {
        for rate in [10.0, 19.199, 0.0, -25.0, f64::NAN, f64::NEG_INFINITY] {
            assert_eq!(low_pass(rate, &FilterOptions::default()).unwrap(), Taps::identity(), "{rate}");
        }
        let off = FilterOptions { enabled: false, ..FilterOptions::default() };
        assert_eq!(low_pass(25.0, &off).unwrap().delay_frames(), 0);
        let at_once = FilterOptions { delay_s: 0.0, ..FilterOptions::default() };
        assert_eq!(low_pass(25.0, &at_once).unwrap(), Taps::identity());
    }

    #[test]
    fn options_that_make_no_filter_are_refused_naming_the_key() {
        let default = FilterOptions::default();
        for (options, key) in [
            (FilterOptions { pass_hz: 0.0, ..default }, "pass_hz = 0"),
            (FilterOptions { pass_hz: f64::NAN, ..default }, "pass_hz = NaN"),
            (FilterOptions { stop_hz: 7.0, ..default }, "stop_hz = 7"),
            (FilterOptions { stop_hz: f64::INFINITY, ..default }, "stop_hz = inf"),
            (FilterOptions { delay_s: -0.1, ..default }, "delay_s = -0.1"),
        ] {
            let error = low_pass(25.0, &options).unwrap_err();
            assert_eq!(error.kind(), Kind::Usage);
            assert!(error.to_string().contains(key), "{error}");
        }
    }

    #[test]
    fn odd_bands_give_a_filter_or_an_error_and_never_a_panic() {
        let (mut designed, mut refused) = (0, 0);
        for pass_hz in [1e-9, 1e-3, 0.5, 7.0, 9.0, 12.0] {
            for factor in [1.0 + 1e-12, 1.001, 1.1, 2.0, 40.0] {
                for delay_s in [0.02, 0.1, 0.5] {
                    for rate in [24.0, 60.0, 400.0] {
                        let options = FilterOptions {
                            pass_hz,
                            stop_hz: pass_hz * factor,
                            delay_s,
                            ..Default::default()
                        };
                        match low_pass(rate, &options) {
                            Ok(taps) => {
                                assert!((taps.as_slice().iter().sum::<f64>() - 1.0).abs() < 1e-9);
                                designed += 1;
                            }
                            Err(error) => {
                                assert_eq!(error.kind(), Kind::Usage);
                                refused += 1;
                            }
                        }
                    }
                }
            }
        }
        assert!(designed > 100 && refused > 20, "{designed} {refused}");
    }

    #[test]
    fn unknown_keys_are_refused_and_missing_ones_have_defaults() {
        let options: FilterOptions = toml::from_str("pass_hz = 5.0").unwrap();
        assert_eq!(options, FilterOptions { pass_hz: 5.0, ..FilterOptions::default() });
        assert!(toml::from_str::<FilterOptions>("pas_hz = 5.0").unwrap_err().to_string().contains("pas_hz"));
    }

    #[test]
    fn a_delay_for_which_the_design_would_not_end_is_refused_with_one_that_suffices() {
        let options = FilterOptions { delay_s: 6.0, ..FilterOptions::default() };
        let error = low_pass(25.0, &options).unwrap_err().to_string();
        assert!(error.contains("order 300") && error.contains("1.76 s are enough"), "{error}");
        for (rate_hz, pass_hz, stop_hz) in
            [(25.0, 7.0, 9.6), (60.0, 7.0, 9.6), (25.0, 2.0, 11.0), (25.0, 0.5, 12.0)]
        {
            let mut designed = 0;
            for delay_frames in 1..=60 {
                let delay_s = f64::from(delay_frames) / rate_hz;
                let options = FilterOptions { pass_hz, stop_hz, delay_s, ..FilterOptions::default() };
                match low_pass(rate_hz, &options) {
                    Ok(_) => designed += 1,
                    Err(error) => assert!(error.to_string().contains("are enough"), "{error}"),
                }
            }
            assert!(designed >= 9, "{rate_hz} {pass_hz} {stop_hz}: {designed}");
        }
    }
}
