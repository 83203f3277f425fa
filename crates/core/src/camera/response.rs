//! Photometric response, METHODS section 2: raw codes to radiance by a table, and back for synthetic frames.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// How a sensor turns radiance into codes. The keys are those of the calibration file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(tag = "model", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ResponseModel {
    /// For frames that hold linear radiance; raw codes are refused.
    #[default]
    Identity,
    /// `code = a + b ln L` (HDRC class), b > 0.
    Logarithmic {
        /// Code of radiance 1.
        a: f64,
        /// Codes per factor e.
        b: f64,
        /// Codes up to this one are clipped at black.
        black_clip_code: u16,
        /// Codes from this one are saturated.
        saturation_code: u16,
    },
    /// `L = gain (code - black_level)`, black at and below `black_level`, saturated from `white_level`.
    Linear {
        /// Code without light.
        black_level: u16,
        /// Code at which the sensor saturates.
        white_level: u16,
        /// Radiance per code, > 0.
        gain: f64,
    },
    /// Straight lines between knees (companded sensors); black at and below the first knee's code, saturated
    /// from the last.
    PiecewiseLinear {
        /// Pairs of code and radiance, both strictly increasing, at least two.
        knees: Vec<(u16, f64)>,
    },
}

/// Number of 16-bit codes.
pub(super) const CODES: usize = 1 << 16;

/// A checked response: the table of radiance by raw code, and the limits of the clipped codes.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    model: ResponseModel,
    /// Radiance of every code that 16 bits can hold, so that no look-up needs a check; zeros for `Identity`.
    table: Box<[f32; CODES]>,
    black_clip_code: u16,
    saturation_code: u16,
}

/// The table that turns codes into radiance, and the limits of the clipped codes.
#[derive(Clone, Copy, Debug)]
pub(super) struct CodeLookup<'a> {
    /// Radiance by code.
    pub(super) radiance: &'a [f32; CODES],
    /// Codes up to this one are clipped at black.
    pub(super) black_clip_code: u16,
    /// Codes from this one are saturated.
    pub(super) saturation_code: u16,
}

impl Default for Response {
    /// The identity.
    fn default() -> Self {
        Self {
            model: ResponseModel::Identity,
            table: by_code(|_| 0.0),
            black_clip_code: 0,
            saturation_code: u16::MAX,
        }
    }
}

impl Response {
    /// Checks a model and builds its table.
    ///
    /// # Errors
    /// `Usage`, naming the key: numbers that are not finite, slopes that are not positive, clip codes or
    /// knees out of order, and models whose largest radiance is beyond the range of f32.
    pub fn new(model: ResponseModel) -> Result<Self> {
        let positive = |key: &str, value: f64| {
            if value.is_finite() && value > 0.0 {
                return Ok(());
            }
            Err(Error::usage("must be finite and positive").in_option(key, Some(&value)))
        };
        let ((black_key, black_clip_code), (saturation_key, saturation_code)) = match &model {
            ResponseModel::Identity => return Ok(Self::default()),
            ResponseModel::Logarithmic { a, b, black_clip_code, saturation_code } => {
                if !a.is_finite() {
                    return Err(Error::usage("must be finite").in_option("a", Some(a)));
                }
                positive("b", *b)?;
                (("black_clip_code", *black_clip_code), ("saturation_code", *saturation_code))
            }
            ResponseModel::Linear { black_level, white_level, gain } => {
                positive("gain", *gain)?;
                (("black_level", *black_level), ("white_level", *white_level))
            }
            ResponseModel::PiecewiseLinear { knees } => {
                let [first, .., last] = knees.as_slice() else {
                    return Err(Error::usage("must be at least two pairs of code and radiance")
                        .in_option("knees", None));
                };
                let wrong = |index: usize, fault: &str| {
                    let (code, radiance) = knees[index];
                    let value = format!("[{code}, {radiance:?}]");
                    Err(Error::usage(fault).in_option(&format!("knees[{index}]"), Some(&value)))
                };
                let is_sound = |radiance: f64| (0.0..=f64::from(f32::MAX)).contains(&radiance);
                if let Some(index) = knees.iter().position(|knee| !is_sound(knee.1)) {
                    return wrong(index, &format!("radiance must be 0 to {:e}", f32::MAX));
                }
                let is_rising = |pair: &[(u16, f64)]| pair[0].0 < pair[1].0 && pair[0].1 < pair[1].1;
                if let Some(index) = knees.windows(2).position(|pair| !is_rising(pair)) {
                    return wrong(index + 1, "code and radiance must be above those of the knee before");
                }
                (("knees", first.0), ("knees", last.0))
            }
        };
        if black_clip_code >= saturation_code {
            return Err(Error::usage(format!("must lie below {saturation_key} = {saturation_code}"))
                .in_option(black_key, Some(&black_clip_code)));
        }
        let table =
            by_code(|code| model.radiance(f64::from(code.clamp(black_clip_code, saturation_code))) as f32);
        // The saturation code has the largest radiance; the codes are monotonic.
        if !table[usize::from(saturation_code)].is_finite() {
            let fault = format!("stands for a radiance beyond {:e}; check the model's numbers", f32::MAX);
            return Err(Error::usage(fault).in_option(saturation_key, Some(&saturation_code)));
        }
        Ok(Self { model, table, black_clip_code, saturation_code })
    }

    /// The model it was made from.
    pub fn model(&self) -> &ResponseModel {
        &self.model
    }

    /// Whether frames hold radiance already.
    pub fn is_identity(&self) -> bool {
        self.model == ResponseModel::Identity
    }

    /// Codes from this one are saturated.
    pub fn saturation_code(&self) -> u16 {
        self.saturation_code
    }

    /// Codes up to this one are clipped at black.
    pub fn black_clip_code(&self) -> u16 {
        self.black_clip_code
    }

    /// Radiance by code, for codes 0 to the saturation code; codes above have the last entry's. Empty for the
    /// identity.
    pub fn table(&self) -> &[f32] {
        if self.is_identity() { &[] } else { &self.table[..=usize::from(self.saturation_code)] }
    }

    /// The look-up of every code; meaningless for the identity.
    pub(super) fn lookup(&self) -> CodeLookup<'_> {
        CodeLookup {
            radiance: &self.table,
            black_clip_code: self.black_clip_code,
            saturation_code: self.saturation_code,
        }
    }

    /// The code of a radiance: the nearest, clamped to the black-clip and the saturation code. NaN and
    /// radiances <= 0 give the black-clip code. For the identity the rounded radiance itself.
    pub fn encode(&self, radiance: f32) -> u16 {
        let radiance = f64::from(radiance);
        if radiance.is_nan() || radiance <= 0.0 {
            return self.black_clip_code;
        }
        let code = match &self.model {
            ResponseModel::Identity => radiance,
            ResponseModel::Logarithmic { a, b, .. } => a + b * radiance.ln(),
            ResponseModel::Linear { black_level, gain, .. } => f64::from(*black_level) + radiance / gain,
            ResponseModel::PiecewiseLinear { knees } => {
                let next = knees.partition_point(|knee| knee.1 <= radiance).clamp(1, knees.len() - 1);
                let (from, to) = (knees[next - 1], knees[next]);
                let share = (radiance - from.1) / (to.1 - from.1);
                f64::from(from.0) + share * (f64::from(to.0) - f64::from(from.0))
            }
        };
        code.round().clamp(f64::from(self.black_clip_code), f64::from(self.saturation_code)) as u16
    }
}

/// A table of `value` for every code.
fn by_code(value: impl Fn(u16) -> f32) -> Box<[f32; CODES]> {
    let table: Box<[f32]> = (0..=u16::MAX).map(value).collect();
    table.try_into().expect("as many as there are codes")
}

impl ResponseModel {
    /// Radiance of a code, which may lie between two; not clamped to the clip codes.
    pub fn radiance(&self, code: f64) -> f64 {
        match self {
            Self::Identity => code,
            Self::Logarithmic { a, b, .. } => ((code - a) / b).exp(),
            Self::Linear { black_level, gain, .. } => gain * (code - f64::from(*black_level)),
            Self::PiecewiseLinear { knees } => {
                let next = knees.partition_point(|knee| f64::from(knee.0) <= code).clamp(1, knees.len() - 1);
                let (from, to) = (knees[next - 1], knees[next]);
                let share = (code - f64::from(from.0)) / (f64::from(to.0) - f64::from(from.0));
                from.1 + share * (to.1 - from.1)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn models() -> Vec<ResponseModel> {
        vec![
            ResponseModel::Logarithmic { a: 500.0, b: 60.0, black_clip_code: 20, saturation_code: 1000 },
            ResponseModel::Linear { black_level: 64, white_level: 4095, gain: 0.25 },
            ResponseModel::PiecewiseLinear {
                knees: vec![(16, 0.0), (1024, 1.0), (2048, 16.0), (4000, 4096.0)],
            },
            ResponseModel::Linear { black_level: 0, white_level: u16::MAX, gain: 1e-3 },
        ]
    }

    #[test]
    fn codes_survive_the_way_to_radiance_and_back() {
        for model in models() {
            let response = Response::new(model.clone()).unwrap();
            for code in response.black_clip_code()..=response.saturation_code() {
                let radiance = response.table()[usize::from(code)];
                assert_eq!(response.encode(radiance), code, "{model:?}");
            }
            assert!(response.table().windows(2).all(|pair| pair[0] <= pair[1]));
            assert_eq!(response.encode(f32::INFINITY), response.saturation_code());
            for dark in [0.0, -1.0, f32::NAN, f32::NEG_INFINITY] {
                assert_eq!(response.encode(dark), response.black_clip_code());
            }
        }
    }

    #[test]
    fn tables_hold_the_closed_forms() {
        let [logarithmic, linear, piecewise, _] =
            <[_; 4]>::try_from(models()).unwrap().map(|model| Response::new(model).unwrap());
        assert_eq!(logarithmic.table()[500], 1.0);
        assert!((f64::from(logarithmic.table()[560]) - 1f64.exp()).abs() < 1e-6);
        assert_eq!(logarithmic.table()[3], logarithmic.table()[20]);
        assert_eq!((linear.table()[64], linear.table()[68], linear.table()[10]), (0.0, 1.0, 0.0));
        assert_eq!(
            (piecewise.table()[1024], piecewise.table()[1536], piecewise.table()[4000]),
            (1.0, 8.5, 4096.0)
        );
    }

    #[test]
    fn encode_rounds_to_the_nearest_code() {
        let linear =
            Response::new(ResponseModel::Linear { black_level: 10, white_level: 100, gain: 2.0 }).unwrap();
        assert_eq!((linear.encode(0.9), linear.encode(1.1), linear.encode(1e30)), (10, 11, 100));
    }

    #[test]
    fn unsound_models_are_refused() {
        let cases = [
            (
                ResponseModel::Logarithmic { a: f64::NAN, b: 1.0, black_clip_code: 0, saturation_code: 9 },
                "a = NaN: must be finite",
            ),
            (
                ResponseModel::Logarithmic { a: 0.0, b: 0.0, black_clip_code: 0, saturation_code: 9 },
                "b = 0: must be finite and positive",
            ),
            (
                ResponseModel::Logarithmic { a: 0.0, b: 1.0, black_clip_code: 0, saturation_code: 900 },
                "saturation_code = 900: stands for a radiance",
            ),
            (
                ResponseModel::Linear { black_level: 9, white_level: 9, gain: 1.0 },
                "black_level = 9: must lie below white_level = 9",
            ),
            (ResponseModel::Linear { black_level: 0, white_level: 9, gain: -1.0 }, "gain = -1: must be"),
            (ResponseModel::PiecewiseLinear { knees: vec![(0, 0.0)] }, "knees: must be at least two pairs"),
            (
                ResponseModel::PiecewiseLinear { knees: vec![(0, 0.0), (5, 2.0), (9, 1.5)] },
                "knees[2] = [9, 1.5]: code and radiance must be above",
            ),
            (
                ResponseModel::PiecewiseLinear { knees: vec![(0, -1.0), (5, 2.0)] },
                "knees[0] = [0, -1.0]: radiance must be 0 to",
            ),
            (
                ResponseModel::PiecewiseLinear { knees: vec![(0, 0.0), (5, 1e39)] },
                "knees[1] = [5, 1e39]: radiance must",
            ),
        ];
        for (model, start) in cases {
            let message = Response::new(model).unwrap_err().to_string();
            assert!(message.starts_with(start), "{start}: {message}");
        }
    }
}
