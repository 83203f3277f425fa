//! From radiance to sensor output: photon noise, response, read noise.

use super::noise::{hash, normal_pair};
use crate::error::{Error, Result};
use lightcast_core::camera::Response;
use serde::Deserialize;

/// Noise that depends only on the seed, the frame and the sample.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Seed of the noise.
    #[serde(default)]
    pub seed: u64,
    /// Radiance that one photon stands for: the variance of radiance L is this times L.
    #[serde(default)]
    pub photon_radiance: f64,
    /// Standard deviation added to raw codes.
    #[serde(default)]
    pub read_codes: f64,
}

impl Noise {
    /// Noise of one frame.
    pub fn at(self, frame: u64) -> FrameNoise {
        FrameNoise { noise: self, key: hash(self.seed ^ hash(frame)) }
    }

    pub(super) fn check(&self) -> Result<()> {
        let sound = |value: f64| value.is_finite() && value >= 0.0;
        if sound(self.photon_radiance) && sound(self.read_codes) {
            return Ok(());
        }
        Err(Error::usage("needs photon_radiance and read_codes finite and not negative"))
    }
}

/// The noise of one frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameNoise {
    noise: Noise,
    key: u64,
}

impl FrameNoise {
    /// Radiance of sample number `sample` with its photon noise, not below 0.
    pub fn radiance(&self, radiance: f64, sample: u64) -> f64 {
        let [value, _] = normal_pair(self.key ^ sample);
        (radiance + (self.noise.photon_radiance * radiance).sqrt() * value).max(0.0)
    }

    /// Code of sample number `sample` with its read noise, between 0 and the saturation code.
    pub fn code(&self, code: u16, sample: u64, response: &Response) -> u16 {
        let [_, value] = normal_pair(self.key ^ sample);
        let code = f64::from(code) + self.noise.read_codes * value;
        code.round().clamp(0.0, f64::from(response.saturation_code())) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::camera::ResponseModel;

    #[test]
    fn photon_noise_grows_with_the_root_of_radiance_and_read_noise_does_not() {
        let noise = Noise { seed: 3, photon_radiance: 0.01, read_codes: 4.0 }.at(17);
        let response =
            Response::new(ResponseModel::Linear { black_level: 0, white_level: 4095, gain: 1.0 }).unwrap();
        let n = 40_000;
        for radiance in [1.0, 100.0] {
            let variance =
                (0..n).map(|i| (noise.radiance(radiance, i) - radiance).powi(2)).sum::<f64>() / n as f64;
            // The bound is four standard errors of sqrt(2 / n) = 0.7 %.
            assert!((variance / (0.01 * radiance) - 1.0).abs() < 0.03, "{radiance}: {variance}");
        }
        let variance =
            (0..n).map(|i| (f64::from(noise.code(2000, i, &response)) - 2000.0).powi(2)).sum::<f64>()
                / n as f64;
        // Rounding adds 1/12.
        assert!((variance / (16.0 + 1.0 / 12.0) - 1.0).abs() < 0.03, "{variance}");
        assert!((0..n).all(|i| noise.code(4095, i, &response) <= 4095 && noise.radiance(0.0, i) == 0.0));
    }

    #[test]
    fn noise_repeats_for_a_frame_and_differs_between_frames_and_seeds() {
        let noise = Noise { seed: 3, photon_radiance: 0.01, read_codes: 0.0 };
        let value = noise.at(17).radiance(1.0, 5);
        assert_eq!(noise.at(17).radiance(1.0, 5), value);
        assert_ne!(noise.at(18).radiance(1.0, 5), value);
        assert_ne!(Noise { seed: 4, ..noise }.at(17).radiance(1.0, 5), value);
    }
}
