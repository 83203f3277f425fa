use std::f64::consts::TAU;

/// Solid angle in steradians of the zone between two polar angles over a fraction of a turn: `(cos theta_0 -
/// cos theta_1) 2 pi fraction`. Written as a product of sines, which keeps all digits for thin zones near the
/// pole.
#[inline]
pub fn zone_solid_angle(theta_0_rad: f64, theta_1_rad: f64, fraction_of_turn: f64) -> f64 {
    2.0 * (0.5 * (theta_0_rad + theta_1_rad)).sin()
        * (0.5 * (theta_1_rad - theta_0_rad)).sin()
        * TAU
        * fraction_of_turn
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn whole_sphere_and_thin_cap() {
        assert!((zone_solid_angle(0.0, PI, 1.0) - 4.0 * PI).abs() < 1e-14);
        let theta = 1e-8;
        assert!((zone_solid_angle(0.0, theta, 1.0) / (PI * theta * theta) - 1.0).abs() < 1e-12);
    }
}
