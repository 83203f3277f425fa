/// The logarithm of exposure as a function of the code: `c ln(code - black + 1/2)` plus a polynomial of
/// `(code - black) / range` without a constant term, offset so that it is 0 half the range above black.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Curve {
    black: f64,
    range: f64,
    /// c, then the coefficients of the powers from 1 on.
    pub(super) factors: Vec<f64>,
}

/// Sensors and JPEG coders round and smear codes by about this many ...
const CODE_ERROR: f64 = 0.5;
/// ... and this share of their range.
const RANGE_ERROR: f64 = 1e-3;
/// Gamma of most displays, from which the fit starts.
const FIRST_GAMMA: f64 = 2.2;

impl Curve {
    pub(super) fn new(black: u16, saturation: u16, degree: usize) -> Self {
        let mut factors = vec![0.0; degree + 1];
        factors[0] = FIRST_GAMMA;
        Self { black: f64::from(black), range: f64::from(saturation - black), factors }
    }

    /// The basis functions at a code.
    pub(super) fn row(&self, code: f64, row: &mut [f64]) {
        let (above, share) = (code - self.black + 0.5, (code - self.black) / self.range);
        row[0] = (above / (self.range / 2.0 + 0.5)).ln();
        let (mut power, mut middle) = (1.0, 1.0);
        for value in &mut row[1..self.factors.len()] {
            power *= share;
            middle *= 0.5;
            *value = power - middle;
        }
    }

    /// g at a code.
    pub(super) fn log_exposure(&self, code: f64) -> f64 {
        let mut row = vec![0.0; self.factors.len()];
        self.row(code, &mut row);
        row.iter().zip(&self.factors).map(|(value, factor)| value * factor).sum()
    }

    /// Derivative of g by the code.
    pub(super) fn slope(&self, code: f64) -> f64 {
        let share = (code - self.black) / self.range;
        let mut slope = self.factors[0] / (code - self.black + 0.5);
        let mut power = 1.0;
        for (at, factor) in self.factors[1..].iter().enumerate() {
            slope += factor * (at + 1) as f64 * power / self.range;
            power *= share;
        }
        slope
    }

    /// Standard deviation of g at a code: that of the code, and 1 % of the exposure for the error of the
    /// model.
    pub(super) fn error(&self, code: f64) -> f64 {
        // Before convergence the curve may be flat or fall; a tenth of the slope of gamma 1 is as flat as
        // cameras are.
        let slope = self.slope(code).max(0.1 / (code - self.black + 0.5));
        (slope * (CODE_ERROR + RANGE_ERROR * self.range)).hypot(0.01)
    }

    /// g at any code; beyond the observed codes it is extrapolated as a power of the code.
    pub(super) fn continued(&self, code: f64, seen: (f64, f64)) -> f64 {
        let nearest = code.clamp(seen.0, seen.1);
        let above = |code: f64| code - self.black + 0.5;
        let power = self.slope(nearest) * above(nearest);
        self.log_exposure(nearest) + power * (above(code) / above(nearest)).ln()
    }

    /// Whether g rises from each code to the next.
    pub(super) fn is_rising(&self, seen: (f64, f64)) -> bool {
        let codes = (self.black as u32)..=((self.black + self.range) as u32);
        let mut last = f64::NEG_INFINITY;
        codes.map(|code| self.continued(f64::from(code), seen)).all(|value| {
            let rises = value > last;
            last = value;
            rises
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slope_is_the_derivative_and_the_continuation_is_smooth() {
        let mut curve = Curve::new(16, 1023, 3);
        curve.factors = vec![1.3, 0.4, -0.2, 0.7];
        for code in [20.0, 300.5, 1000.0] {
            let difference = (curve.log_exposure(code + 1e-3) - curve.log_exposure(code - 1e-3)) / 2e-3;
            assert!((curve.slope(code) / difference - 1.0).abs() < 1e-6);
        }
        assert!(curve.log_exposure(519.5).abs() < 1e-12);
        let seen = (40.0, 900.0);
        assert_eq!(curve.continued(500.0, seen), curve.log_exposure(500.0));
        for edge in [40.0, 900.0] {
            let steps = [-1e-3, 0.0, 1e-3].map(|step| curve.continued(edge + step, seen));
            assert!(((steps[2] - steps[1]) / (steps[1] - steps[0]) - 1.0).abs() < 1e-3);
        }
        assert!(curve.is_rising(seen));
        curve.factors = vec![1.0, -3.0];
        assert!(!curve.is_rising(seen));
    }
}
