use crate::error::{Error, Result};

/// By how much the sum may differ from 1: rounding of the last digits of a thousand coefficients.
const SUM_TOLERANCE: f64 = 1e-9;

/// Coefficients of a symmetric FIR of odd length whose sum is 1, newest frame first.
#[derive(Clone, Debug, PartialEq)]
pub struct Taps(Vec<f64>);

impl Taps {
    /// Checks coefficients, newest frame first.
    ///
    /// # Errors
    /// Kind `Usage`, saying what is wrong: an even number of them, values that are not finite, pairs about
    /// the middle that differ, a sum that is not 1.
    pub fn new(coefficients: Vec<f64>) -> Result<Self> {
        let refused = |message: String| Err(Error::usage(message).in_option("taps", None));
        let count = coefficients.len();
        if count.is_multiple_of(2) {
            return refused(format!("{count} coefficients, their number must be odd"));
        }
        if let Some(value) = coefficients.iter().find(|value| !value.is_finite()) {
            return refused(format!("{value} is not finite"));
        }
        let (sum, size): (f64, f64) =
            (coefficients.iter().sum(), coefficients.iter().map(|value| value.abs()).sum());
        if (0..count / 2)
            .any(|at| (coefficients[at] - coefficients[count - 1 - at]).abs() > SUM_TOLERANCE * size)
        {
            return refused(
                "must be the same from both ends, for a delay that is the same at every frequency".to_owned(),
            );
        }
        if (sum - 1.0).abs() > SUM_TOLERANCE * size {
            return refused(format!("their sum is {sum}, must be 1, for lists that stay the same to pass"));
        }
        Ok(Self(coefficients))
    }

    /// The filter that changes nothing.
    pub fn identity() -> Self {
        Self(vec![1.0])
    }

    /// The coefficients; an odd number of them.
    pub fn as_slice(&self) -> &[f64] {
        &self.0
    }

    /// Number of coefficients less one, even.
    pub fn order(&self) -> usize {
        self.0.len() - 1
    }

    /// Group delay at every frequency; 0 means that nothing is filtered.
    pub fn delay_frames(&self) -> u32 {
        (self.order() / 2) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_symmetric_filter_of_gain_one_is_refused() {
        assert_eq!(Taps::new(vec![0.25, 0.5, 0.25]).unwrap().delay_frames(), 1);
        assert_eq!(Taps::new(vec![1.0]).unwrap(), Taps::identity());
        for (coefficients, words) in [
            (vec![], "0 coefficients"),
            (vec![0.5, 0.5], "2 coefficients"),
            (vec![f64::NAN], "not finite"),
            (vec![0.2, 0.5, 0.3], "from both ends"),
            (vec![0.25, 0.25, 0.25], "sum is 0.75"),
        ] {
            let message = Taps::new(coefficients).unwrap_err().to_string();
            assert!(message.contains(words), "{words}: {message}");
        }
    }
}
