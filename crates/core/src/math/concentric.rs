//! Shirley and Chiu, A Low Distortion Map Between Disk and Square (1997).

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// Point `[r, phi]` of the unit disc, r in [0, 1] and phi in [0, 2 pi), for a point of the unit square.
///
/// The map keeps ratios of areas, is continuous with its inverse, and turns concentric squares into
/// concentric circles. Coordinates are clamped to the square; NaN counts as 0.
pub fn disc_from_square(u: [f64; 2]) -> [f64; 2] {
    let [a, b] = u.map(|x| 2.0 * clamped(x, 1.0) - 1.0);
    let (r, phi) = if a.abs() > b.abs() {
        (a, FRAC_PI_4 * (b / a))
    } else if b != 0.0 {
        (b, FRAC_PI_2 - FRAC_PI_4 * (a / b))
    } else {
        return [0.0, 0.0];
    };
    let phi = if r < 0.0 { phi + PI } else { phi };
    // A tiny negative angle plus a full turn rounds to the full turn itself.
    let phi = if phi < 0.0 { phi + TAU } else { phi };
    [r.abs(), if phi >= TAU { 0.0 } else { phi }]
}

/// Point of the unit square for `[r, phi]` of the unit disc, phi in [0, 2 pi): the inverse of
/// [`disc_from_square`]. Values outside are clamped; NaN counts as 0.
pub fn square_from_disc([r, phi]: [f64; 2]) -> [f64; 2] {
    let (r, phi) = (clamped(r, 1.0), clamped(phi, TAU));
    // Quadrants are the four triangles of the square, each a quarter turn about an axis.
    let [a, b] = if phi < FRAC_PI_4 {
        [r, phi / FRAC_PI_4 * r]
    } else if phi < 3.0 * FRAC_PI_4 {
        [(FRAC_PI_2 - phi) / FRAC_PI_4 * r, r]
    } else if phi < 5.0 * FRAC_PI_4 {
        [-r, (PI - phi) / FRAC_PI_4 * r]
    } else if phi < 7.0 * FRAC_PI_4 {
        [(phi - 3.0 * FRAC_PI_2) / FRAC_PI_4 * r, -r]
    } else {
        [r, (phi - TAU) / FRAC_PI_4 * r]
    };
    [a, b].map(|x| (0.5 * (x + 1.0)).clamp(0.0, 1.0))
}

/// Within [0, `most`]; NaN is 0, which `clamp` would pass on.
fn clamped(x: f64, most: f64) -> f64 {
    if x > 0.0 { x.min(most) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_and_corners_lie_where_shirley_and_chiu_put_them() {
        for (u, expected) in [
            ([0.5, 0.5], [0.0, 0.0]),
            ([1.0, 0.5], [1.0, 0.0]),
            ([1.0, 1.0], [1.0, FRAC_PI_4]),
            ([0.5, 1.0], [1.0, FRAC_PI_2]),
            ([0.0, 0.5], [1.0, PI]),
            ([0.5, 0.0], [1.0, 3.0 * FRAC_PI_2]),
            ([0.75, 0.5], [0.5, 0.0]),
        ] {
            let disc = disc_from_square(u);
            assert!((disc[0] - expected[0]).abs() < 1e-15 && (disc[1] - expected[1]).abs() < 1e-14, "{u:?}");
        }
    }

    #[test]
    fn inverse_returns_every_point_of_a_grid() {
        for i in 0..=64 {
            for j in 0..=64 {
                let u = [f64::from(i) / 64.0, f64::from(j) / 64.0];
                let back = square_from_disc(disc_from_square(u));
                assert!((back[0] - u[0]).abs() < 1e-14 && (back[1] - u[1]).abs() < 1e-14, "{u:?}: {back:?}");
            }
        }
    }

    #[test]
    fn areas_keep_their_ratio() {
        // Area element on the disc is r dr dphi; over the unit square it is pi everywhere.
        let h = 1e-6;
        for u in [[0.3, 0.2], [0.9, 0.45], [0.52, 0.97], [0.1, 0.4]] {
            let cartesian = |u| {
                let [r, phi] = disc_from_square(u);
                [r * phi.cos(), r * phi.sin()]
            };
            let difference = |axis: usize| {
                let (mut plus, mut minus) = (u, u);
                plus[axis] += h;
                minus[axis] -= h;
                let (p, m) = (cartesian(plus), cartesian(minus));
                [(p[0] - m[0]) / (2.0 * h), (p[1] - m[1]) / (2.0 * h)]
            };
            let (du, dv) = (difference(0), difference(1));
            assert!((du[0] * dv[1] - du[1] * dv[0] - PI).abs() < 1e-7, "{u:?}");
        }
    }

    #[test]
    fn azimuth_stays_below_a_full_turn_and_nan_is_a_point() {
        assert_eq!(disc_from_square([1.0, 0.5 - 1e-17])[1], 0.0);
        assert!(disc_from_square([1.0, 0.5 - 1e-16])[1] < TAU);
        assert!(disc_from_square([f64::NAN, 2.0]).iter().all(|x| x.is_finite()));
        assert!(square_from_disc([f64::NAN, f64::NAN]).iter().all(|x| x.is_finite()));
    }
}
