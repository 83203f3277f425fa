use std::f64::consts::PI;

/// The odd polynomial `r(theta) = theta + k1 theta^3 + k2 theta^5 + k3 theta^7 + k4 theta^9` of Kannala and
/// Brandt 2004: distance from the principal point, in focal lengths, of a ray at `theta` from the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialPolynomial {
    /// k1 to k4.
    pub k: [f64; 4],
}

impl RadialPolynomial {
    /// r at an angle from the axis.
    pub fn radius(&self, theta_rad: f64) -> f64 {
        let [k1, k2, k3, k4] = self.k;
        let s = theta_rad * theta_rad;
        theta_rad * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4))))
    }

    /// `dr / dtheta` there.
    pub fn slope(&self, theta_rad: f64) -> f64 {
        let s = theta_rad * theta_rad;
        self.slope_in_square().iter().rev().fold(0.0, |sum, c| sum * s + c)
    }

    /// Coefficients of `dr / dtheta` as a polynomial in `theta^2`.
    fn slope_in_square(&self) -> [f64; 5] {
        let [k1, k2, k3, k4] = self.k;
        [1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3, 9.0 * k4]
    }

    /// The smallest angle in (0, pi] at which r stops increasing, if there is one.
    pub fn turning_angle_rad(&self) -> Option<f64> {
        smallest_non_positive(&self.slope_in_square(), PI * PI).map(f64::sqrt)
    }

    /// The angle in [0, theta_max] whose radius is `radius`, which must lie in [0, r(theta_max)], where r
    /// increases up to theta_max. Newton's method from `guess_rad`, kept inside a bracket that every step
    /// shrinks.
    pub fn invert(&self, radius: f64, theta_max_rad: f64, guess_rad: f64) -> f64 {
        let (mut low, mut high) = (0.0, theta_max_rad);
        let mut theta = if guess_rad > low && guess_rad < high { guess_rad } else { 0.5 * (low + high) };
        // Newton ends after 2-6 steps; 200 bounds a search that only bisects (f64 has 53 digits to find, and
        // a Newton step that lands beside the bracket may spend one step in two).
        for _ in 0..200 {
            let excess = self.radius(theta) - radius;
            if excess > 0.0 {
                high = theta;
            } else {
                low = theta;
            }
            let newton = theta - excess / self.slope(theta);
            let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
            let step = (next - theta).abs();
            theta = next;
            // A step of Newton's method squares the error and multiplies it by r'' / 2 r', which is 1e6 at
            // most (see the default field of view): the error after this step is below 1e-16.
            if step <= 1e-11 {
                break;
            }
        }
        theta
    }
}

/// The smallest x in (0, x_max] at which the polynomial `sum c_i x^i` is not positive, given c_0 > 0. Between
/// neighbouring extrema a polynomial is monotonic, so its sign there and bisection between them find every
/// root; the extrema are the roots of the derivative, found in the same way.
fn smallest_non_positive(coefficients: &[f64], x_max: f64) -> Option<f64> {
    roots(coefficients, x_max)
        .into_iter()
        .find(|&x| x > 0.0)
        .or_else(|| (evaluate(coefficients, x_max) <= 0.0).then_some(x_max))
}

fn evaluate(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// Roots in [0, x_max], ascending; roots of even multiplicity are found when an extremum rounds to zero.
fn roots(coefficients: &[f64], x_max: f64) -> Vec<f64> {
    if coefficients.len() < 2 {
        return Vec::new();
    }
    let derivative: Vec<f64> = coefficients.iter().enumerate().skip(1).map(|(i, c)| i as f64 * c).collect();
    let mut stops = vec![0.0];
    stops.extend(roots(&derivative, x_max));
    stops.push(x_max);
    let mut found = Vec::new();
    for pair in stops.windows(2) {
        let (mut low, mut high) = (pair[0], pair[1]);
        let (at_low, at_high) = (evaluate(coefficients, low), evaluate(coefficients, high));
        if at_low == 0.0 {
            found.push(low);
        }
        if at_low * at_high < 0.0 {
            while high - low > 4.0 * f64::EPSILON * high {
                let middle = 0.5 * (low + high);
                if evaluate(coefficients, middle) * at_low > 0.0 {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            found.push(0.5 * (low + high));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_angle_of_a_cubic_is_closed_form() {
        // r' = 1 - 3 a theta^2 vanishes at sqrt(1 / 3a).
        for a in [0.05, 0.1, 0.3, 2.0] {
            let turn = RadialPolynomial { k: [-a, 0.0, 0.0, 0.0] }.turning_angle_rad().unwrap();
            assert!((turn - (1.0 / (3.0 * a)).sqrt()).abs() < 1e-12, "{a}: {turn}");
        }
    }

    #[test]
    fn a_dip_between_two_increasing_stretches_is_found() {
        // r' = (s - 1)(s - 1.2) / 1.2 in s = theta^2: positive at 0 and at pi, negative only on (1, 1.2).
        let k = [-2.2 / 1.2 / 3.0, 1.0 / 1.2 / 5.0, 0.0, 0.0];
        let turn = RadialPolynomial { k }.turning_angle_rad().unwrap();
        assert!((turn - 1.0).abs() < 1e-12, "{turn}");
    }

    #[test]
    fn lenses_that_never_turn_have_no_turning_angle() {
        for k in [[0.0; 4], [0.1, 0.0, 0.0, 0.0], [0.1, -0.01, 0.002, 0.0]] {
            assert_eq!(RadialPolynomial { k }.turning_angle_rad(), None, "{k:?}");
        }
    }
}
