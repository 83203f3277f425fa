//! Taps for tests of this module.

use super::Taps;
use pm_remez::{Band, PMParameters, ParametersBuilder, pm_remez};

/// The published filter at a frame rate, designed as the program does: 7 Hz to 9.6 Hz, 160 ms.
pub(super) fn taps(frame_rate_hz: f64) -> Taps {
    let delay_frames = (0.16 * frame_rate_hz).round();
    if frame_rate_hz.is_nan() || frame_rate_hz < 2.0 * 9.6 {
        return Taps::identity();
    }
    let (pass, stop) = (7.0 / frame_rate_hz, (9.6 / frame_rate_hz).min(0.5 - 1e-6));
    let bands = vec![Band::new(0.0, pass).unwrap(), Band::new(stop, 0.5).unwrap()];
    let desired = move |f: f64| if f < 0.5 * (pass + stop) { 1.0 } else { 0.0 };
    let mut parameters = PMParameters::new(2 * delay_frames as usize + 1, bands, desired, |_| 1.0).unwrap();
    parameters.set_flatness_threshold(1e-6);
    let mut taps = pm_remez(&parameters).unwrap().impulse_response;
    let sum: f64 = taps.iter().sum();
    taps.iter_mut().for_each(|tap| *tap /= sum);
    Taps::new(taps).unwrap()
}
