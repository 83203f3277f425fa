//! The total reflectance of a rough surface: the directional albedo of GGX with Smith masking, without
//! Fresnel reflectance, for single scattering. The energy that it lacks leaves a real surface after multiple
//! scattering (Turquin 2019).

use std::f64::consts::TAU;

/// Side of the table: view cosines along its rows, roughnesses down its columns, at (i + 1/2) / SIDE.
pub(super) const SIDE: usize = 32;

/// Points of the quadrature for each entry.
const POINTS: usize = 1024;

/// The table, row-major.
pub(super) fn table() -> Vec<f32> {
    let place = |i: usize| (i as f64 + 0.5) / SIDE as f64;
    (0..SIDE * SIDE).map(|i| directional_albedo(place(i % SIDE), place(i / SIDE)) as f32).collect()
}

/// Share of the light from a direction of cosine `n_v` that a surface of this roughness (alpha = roughness^2)
/// reflects, in (0, 1]. Quadrature over half vectors distributed according to GGX.
pub(super) fn directional_albedo(n_v: f64, roughness: f64) -> f64 {
    let n_v = n_v.clamp(1e-3, 1.0);
    let alpha = (roughness * roughness).clamp(1e-3, 1.0);
    let a2 = alpha * alpha;
    let view = [(1.0 - n_v * n_v).sqrt(), 0.0, n_v];
    let mut sum = 0.0;
    for i in 0..POINTS {
        // The R2 sequence of Roberts (2018): evenly distributed in both coordinates.
        let u = (0.5 + 0.754_877_666_246_692_8 * i as f64).fract();
        let phi = TAU * (0.5 + 0.569_840_290_998_053_2 * i as f64).fract();
        let n_h = ((1.0 - u) / (1.0 + (a2 - 1.0) * u)).sqrt();
        let s_h = (1.0 - n_h * n_h).max(0.0).sqrt();
        let v_h = view[0] * s_h * phi.cos() + view[2] * n_h;
        let n_l = 2.0 * v_h * n_h - n_v;
        if v_h <= 0.0 || n_l <= 0.0 {
            continue;
        }
        let l = n_v * ((n_l - a2 * n_l) * n_l + a2).sqrt();
        let v = n_l * ((n_v - a2 * n_v) * n_v + a2).sqrt();
        let visibility = 0.5 / (l + v);
        sum += 4.0 * visibility * n_l * v_h / n_h;
    }
    (sum / POINTS as f64).clamp(1e-3, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_surfaces_reflect_all_and_rough_ones_less() {
        assert!(directional_albedo(0.7, 0.05) > 0.995);
        let mut last = 1.0;
        for roughness in [0.2, 0.4, 0.6, 0.8, 1.0] {
            let albedo = directional_albedo(0.8, roughness);
            assert!(albedo < last && albedo > 0.3, "{roughness}: {albedo}");
            last = albedo;
        }
    }

    #[test]
    fn agrees_with_a_slow_integral_over_the_hemisphere() {
        // Direct sum of D V cos over directions, where the lobe is wide enough for the grid.
        for (n_v, roughness) in [(0.9f64, 0.6f64), (0.5, 0.8), (0.3, 1.0)] {
            let a2 = roughness.powi(4);
            let steps = 600;
            let mut sum = 0.0;
            for row in 0..steps {
                let n_l = (row as f64 + 0.5) / steps as f64;
                for column in 0..steps {
                    let phi = TAU * (column as f64 + 0.5) / steps as f64;
                    let s_l = (1.0 - n_l * n_l).sqrt();
                    let h = [(1.0 - n_v * n_v).sqrt() + s_l * phi.cos(), s_l * phi.sin(), n_v + n_l];
                    let n_h = h[2] / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
                    let d = (n_h * a2 - n_h) * n_h + 1.0;
                    let lambda_l = n_v * ((n_l - a2 * n_l) * n_l + a2).sqrt();
                    let lambda_v = n_l * ((n_v - a2 * n_v) * n_v + a2).sqrt();
                    sum += a2 / (std::f64::consts::PI * d * d) * 0.5 / (lambda_l + lambda_v) * n_l;
                }
            }
            let slow = sum * TAU / f64::from(steps * steps);
            let fast = directional_albedo(n_v, roughness);
            assert!((fast / slow - 1.0).abs() < 5e-3, "{n_v} {roughness}: {fast} {slow}");
        }
    }
}
