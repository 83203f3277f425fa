//! FLIP's filters. All of them are separable (products of a horizontal and a vertical kernel) or sums of
//! separable filters, which costs 2 (2 r + 1) multiplications per pixel instead of (2 r + 1)^2. Beyond the
//! border the border's pixels are repeated.

use std::f64::consts::PI;

/// One Gaussian of a contrast sensitivity function: a exp(-b f^2) over frequency f in cycles per degree is a
/// sqrt(pi / b) exp(-pi^2 x^2 / b) over x in degrees. Pairs (a, b).
type Gaussian = (f64, f64);

/// How the eye blurs one opponent channel: one Gaussian or the sum of two, with the paper's a and b.
pub struct Sensitivity(&'static [Gaussian]);

impl Sensitivity {
    /// Achromatic.
    pub const LUMINANCE: Self = Self(&[(1.0, 0.0047)]);
    /// Red-green.
    pub const RED_GREEN: Self = Self(&[(1.0, 0.0053)]);
    /// Blue-yellow.
    pub const BLUE_YELLOW: Self = Self(&[(34.1, 0.04), (13.5, 0.025)]);
    /// The largest b, which sets the radius of all kernels: three standard deviations.
    const WIDEST: f64 = 0.04;

    /// The channel as it is perceived. The sum of the two-dimensional kernel is 1.
    pub fn blur(&self, plane: &[f64], width: usize, pixels_per_degree: f64) -> Vec<f64> {
        let radius = (3.0 * (Self::WIDEST / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
        // The weights are those of the one-dimensional Gaussians, as in the reference implementation.
        let parts: Vec<(f64, Vec<f64>)> = self
            .0
            .iter()
            .map(|&(a, b)| {
                let kernel = samples(radius, |x| (-(PI * x / pixels_per_degree).powi(2) / b).exp());
                let sum: f64 = kernel.iter().sum();
                (a * (PI / b).sqrt() * sum * sum, kernel.iter().map(|value| value / sum).collect())
            })
            .collect();
        let total: f64 = parts.iter().map(|(weight, _)| weight).sum();
        let mut blurred = vec![0.0; plane.len()];
        for (weight, kernel) in &parts {
            add_scaled(&mut blurred, &separable(plane, width, kernel, kernel), weight / total);
        }
        blurred
    }
}

/// Which derivative of a Gaussian.
#[derive(Clone, Copy, PartialEq)]
pub enum Derivative {
    /// The Gaussian itself; its sum is 1.
    None,
    /// Responds to edges.
    First,
    /// Responds to points and lines.
    Second,
}

/// A derivative of a Gaussian, out to three standard deviations; its positive values sum to 1, its negative
/// ones to -1.
pub fn derivative(order: Derivative, deviation_px: f64) -> Vec<f64> {
    let radius = (3.0 * deviation_px).ceil() as i32;
    let mut kernel = samples(radius, |x| {
        let t = x / deviation_px;
        let gaussian = (-0.5 * t * t).exp();
        match order {
            Derivative::None => gaussian,
            Derivative::First => -t * gaussian,
            Derivative::Second => (t * t - 1.0) * gaussian,
        }
    });
    let positive: f64 = kernel.iter().filter(|value| **value > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|value| **value < 0.0).sum::<f64>();
    for value in &mut kernel {
        *value /= if *value > 0.0 { positive } else { negative.max(f64::MIN_POSITIVE) };
    }
    kernel
}

fn samples(radius: i32, value: impl Fn(f64) -> f64) -> Vec<f64> {
    (-radius..=radius).map(|x| value(f64::from(x))).collect()
}

/// The plane correlated with `across` along its rows and with `down` along its columns. Both kernels have odd
/// length.
pub fn separable(plane: &[f64], width: usize, across: &[f64], down: &[f64]) -> Vec<f64> {
    let height = plane.len() / width;
    let mut rows = vec![0.0; plane.len()];
    let reach = across.len() / 2;
    let mut padded = vec![0.0; width + 2 * reach];
    for (source, target) in plane.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        padded[..reach].fill(source[0]);
        padded[reach..reach + width].copy_from_slice(source);
        padded[reach + width..].fill(source[width - 1]);
        for (at, &weight) in across.iter().enumerate() {
            add_scaled(target, &padded[at..at + width], weight);
        }
    }
    let mut filtered = vec![0.0; plane.len()];
    let reach = down.len() / 2;
    for (y, target) in filtered.chunks_exact_mut(width).enumerate() {
        for (at, &weight) in down.iter().enumerate() {
            let from = (y + at).saturating_sub(reach).min(height - 1);
            add_scaled(target, &rows[from * width..(from + 1) * width], weight);
        }
    }
    filtered
}

fn add_scaled(sums: &mut [f64], values: &[f64], weight: f64) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += weight * value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separable_equals_the_double_sum_also_where_the_kernel_is_larger_than_the_picture() {
        let (width, height) = (5, 4);
        let plane: Vec<f64> = (0..width * height).map(|i| ((i * 7) % 11) as f64).collect();
        let across = derivative(Derivative::First, 1.7);
        let down = derivative(Derivative::Second, 0.6);
        let filtered = separable(&plane, width, &across, &down);
        let clamped = |x: i64, size: usize| x.clamp(0, size as i64 - 1) as usize;
        for y in 0..height {
            for x in 0..width {
                let mut sum = 0.0;
                for (j, v) in down.iter().enumerate() {
                    for (i, h) in across.iter().enumerate() {
                        let column = clamped(x as i64 + i as i64 - across.len() as i64 / 2, width);
                        let row = clamped(y as i64 + j as i64 - down.len() as i64 / 2, height);
                        sum += v * h * plane[row * width + column];
                    }
                }
                assert!((filtered[y * width + x] - sum).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn kernels_are_normalised_as_said() {
        for deviation_px in [0.041, 0.5, 2.75, 41.0] {
            for (order, sum) in [(Derivative::None, 1.0), (Derivative::First, 0.0), (Derivative::Second, 0.0)]
            {
                let kernel = derivative(order, deviation_px);
                assert!((kernel.iter().sum::<f64>() - sum).abs() < 1e-12, "{kernel:?}");
                assert!((kernel.iter().filter(|value| **value > 0.0).sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
        let constant = vec![0.3; 12 * 7];
        for sensitivity in [Sensitivity::LUMINANCE, Sensitivity::RED_GREEN, Sensitivity::BLUE_YELLOW] {
            let blurred = sensitivity.blur(&constant, 12, 67.0);
            assert!(blurred.iter().all(|value| (value - 0.3).abs() < 1e-14));
        }
    }
}
