use super::curve::Curve;
use super::samples::Places;
use crate::calibrate::normal_equations::NormalEquations;

/// A fitted curve.
pub(super) struct Solution {
    pub(super) curve: Curve,
    /// Sum of squared residuals over their variance, per degree of freedom.
    pub(super) misfit: f64,
    /// RMS of the residuals in g by picture.
    pub(super) misfit_by_picture: Vec<f64>,
    /// Logarithm of the time that was not given; 0 where all were.
    pub(super) free_log_time: f64,
}

/// Iterations of slope, weights and curve.
const TURNS: usize = 8;
/// Number of standard deviations beyond which residuals count linearly instead of quadratically.
const HUBER: f64 = 2.0;

/// Iterated least squares over all samples; `free` is a picture whose time is unknown. `None` where the
/// samples do not determine the curve.
pub(super) fn solve(
    places: &Places,
    start: Curve,
    log_times: &[f64],
    free: Option<usize>,
) -> Option<Solution> {
    let factors = start.factors.len();
    let unknowns = factors + usize::from(free.is_some());
    let mut curve = start;
    let mut log_times = log_times.to_vec();
    let mut is_first = true;
    for _ in 0..TURNS {
        let mut equations = NormalEquations::new(unknowns);
        let (mut row, mut mean_row) = (vec![0.0; unknowns], vec![0.0; unknowns]);
        for codes in places.iter() {
            let residuals = Residuals::of(codes, &curve, &log_times);
            mean_row.fill(0.0);
            let (mut mean_value, mut weights) = (0.0, 0.0);
            for (picture, &code) in codes.iter().enumerate().filter(|(_, code)| !code.is_nan()) {
                let is_free = free == Some(picture);
                row.fill(0.0);
                curve.row(code, &mut row[..factors]);
                if is_free {
                    row[factors] = -1.0;
                }
                let value = if is_free { 0.0 } else { log_times[picture] };
                let error = curve.error(code);
                let size = if is_first {
                    0.0
                } else {
                    (residuals.at(picture, code, &curve, &log_times) / error).abs()
                };
                let weight = (HUBER / size.max(HUBER)) / (error * error);
                equations.add(&row, value, weight);
                mean_row.iter_mut().zip(&row).for_each(|(mean, value)| *mean += weight * value);
                mean_value += weight * value;
                weights += weight;
            }
            mean_row.iter_mut().for_each(|mean| *mean /= weights);
            equations.add(&mean_row, mean_value / weights, -weights);
        }
        let solution = equations.solve()?;
        curve.factors.copy_from_slice(&solution[..factors]);
        if let Some(free) = free {
            log_times[free] = solution[factors];
        }
        is_first = false;
    }

    let mut sums = vec![(0.0, 0usize); log_times.len()];
    let (mut chi_square, mut equations) = (0.0, 0usize);
    for codes in places.iter() {
        let residuals = Residuals::of(codes, &curve, &log_times);
        for (picture, &code) in codes.iter().enumerate().filter(|(_, code)| !code.is_nan()) {
            let residual = residuals.at(picture, code, &curve, &log_times);
            let size = (residual / curve.error(code)).abs();
            chi_square += if size > HUBER { HUBER * (2.0 * size - HUBER) } else { size * size };
            equations += 1;
            sums[picture].0 += residual * residual;
            sums[picture].1 += 1;
        }
    }
    let freedom = equations.saturating_sub(places.len() + unknowns).max(1);
    Some(Solution {
        curve,
        misfit: chi_square / freedom as f64,
        misfit_by_picture: sums.iter().map(|&(sum, n)| (sum / n.max(1) as f64).sqrt()).collect(),
        free_log_time: free.map_or(0.0, |free| log_times[free]),
    })
}

/// A sample's ln E, from which its residuals follow.
struct Residuals {
    log_radiance: f64,
}

impl Residuals {
    fn of(codes: &[f64], curve: &Curve, log_times: &[f64]) -> Self {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (&code, time) in codes.iter().zip(log_times).filter(|(code, _)| !code.is_nan()) {
            let weight = curve.error(code).powi(-2);
            sum += weight * (curve.log_exposure(code) - time);
            weights += weight;
        }
        Self { log_radiance: sum / weights }
    }

    fn at(&self, picture: usize, code: f64, curve: &Curve, log_times: &[f64]) -> f64 {
        curve.log_exposure(code) - log_times[picture] - self.log_radiance
    }
}
