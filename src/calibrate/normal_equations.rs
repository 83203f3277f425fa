//! Weighted linear least squares with few unknowns, by the normal equations.

use nalgebra::{DMatrix, DVector};

/// Sums of a system of equations `row . unknowns = value`, each with a weight (one over its variance).
#[derive(Clone, Debug)]
pub(super) struct NormalEquations {
    unknowns: usize,
    /// Row-major, symmetric.
    matrix: Vec<f64>,
    right: Vec<f64>,
}

/// A pivot of the scaled matrix (its diagonal is 1) below this means that the equations do not determine an
/// unknown.
const SMALLEST_PIVOT: f64 = 1e-13;

impl NormalEquations {
    pub(super) fn new(unknowns: usize) -> Self {
        Self { unknowns, matrix: vec![0.0; unknowns * unknowns], right: vec![0.0; unknowns] }
    }

    /// Adds an equation. A negative weight subtracts one: an unknown that only some equations share is
    /// eliminated by subtracting their weighted mean.
    pub(super) fn add(&mut self, row: &[f64], value: f64, weight: f64) {
        for (at, &left) in row.iter().enumerate() {
            if left == 0.0 {
                continue;
            }
            self.right[at] += weight * left * value;
            for (sum, &right) in self.matrix[at * self.unknowns..].iter_mut().zip(row) {
                *sum += weight * left * right;
            }
        }
    }

    /// The unknowns, by Cholesky factorisation of the matrix scaled to a unit diagonal; `None` where the
    /// equations do not determine them.
    pub(super) fn solve(&self) -> Option<Vec<f64>> {
        let n = self.unknowns;
        let scale: Vec<f64> = (0..n).map(|at| self.matrix[at * n + at].sqrt().recip()).collect();
        if scale.iter().any(|scale| !scale.is_finite()) {
            return None;
        }
        let scaled =
            DMatrix::from_fn(n, n, |row, column| self.matrix[row * n + column] * scale[row] * scale[column]);
        let factors = scaled.cholesky()?;
        if factors.l_dirty().diagonal().iter().any(|pivot| pivot * pivot <= SMALLEST_PIVOT) {
            return None;
        }
        let right =
            DVector::from_iterator(n, self.right.iter().zip(&scale).map(|(value, scale)| value * scale));
        let mut unknowns: Vec<f64> = factors.solve(&right).iter().copied().collect();
        unknowns.iter_mut().zip(&scale).for_each(|(unknown, scale)| *unknown *= scale);
        unknowns.iter().all(|unknown| unknown.is_finite()).then_some(unknowns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_through_its_points_is_found_and_a_shared_unknown_eliminated() {
        let cubic = [2.0, -1.0, 0.5, 1e-3];
        let row = |x: f64| [1.0, x, x * x, x * x * x];
        let value = |x: f64| row(x).iter().zip(&cubic).map(|(power, factor)| power * factor).sum::<f64>();
        let mut equations = NormalEquations::new(4);
        for (x, weight) in [(-3.0, 1.0), (-1.0, 5.0), (0.5, 2.0), (2.0, 0.1), (4.0, 1.0)] {
            equations.add(&row(x), value(x), weight);
        }
        for (found, expected) in equations.solve().unwrap().iter().zip(cubic) {
            assert!((found - expected).abs() < 1e-10, "{found} {expected}");
        }
        // Pairs that each have an unknown offset determine only the slope.
        let mut slope = NormalEquations::new(1);
        for (offset, x) in [(100.0, [1.0, 2.0]), (-7.0, [5.0, 9.0])] {
            x.iter().for_each(|&x| slope.add(&[x], 3.0 * x + offset, 1.0));
            let mean = (x[0] + x[1]) / 2.0;
            slope.add(&[mean], 3.0 * mean + offset, -2.0);
        }
        assert!((slope.solve().unwrap()[0] - 3.0).abs() < 1e-12);
    }

    #[test]
    fn undetermined_unknowns_have_no_answer() {
        let mut equations = NormalEquations::new(2);
        equations.add(&[1.0, 2.0], 3.0, 1.0);
        equations.add(&[2.0, 4.0], 6.0, 1.0);
        assert_eq!(equations.solve(), None);
        assert_eq!(NormalEquations::new(1).solve(), None);
    }
}
