//! The transfer function of sRGB (IEC 61966-2-1); this is its only implementation in Rust.

/// Linear value of a coded one, both in [0, 1].
pub fn linear_from_srgb(coded: f32) -> f32 {
    if coded <= 0.040_45 { coded / 12.92 } else { ((coded + 0.055) / 1.055).powf(2.4) }
}

/// Coded value of a linear one, both in [0, 1].
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_follow_the_standard_and_go_both_ways() {
        assert_eq!([0.0, 1.0].map(linear_from_srgb), [0.0, 1.0]);
        // Both pieces meet; 0.5 is 0.21404 (computed with 20 digits).
        assert!((linear_from_srgb(0.040_45) - linear_from_srgb(0.040_450_1)).abs() < 1e-6);
        assert!((linear_from_srgb(0.5) - 0.214_041_14).abs() < 1e-6);
        for code in 0..=255u8 {
            let coded = f32::from(code) / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(coded)) - coded).abs() < 1e-6, "{code}");
        }
    }
}
