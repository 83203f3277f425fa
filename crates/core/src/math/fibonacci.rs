use glam::DVec3;

/// `count` directions spread evenly over the whole sphere: point i lies at height `y = 1 - (2 i + 1) / count`
/// and azimuth `i` times the golden angle.
pub fn fibonacci_sphere(count: usize) -> impl Iterator<Item = DVec3> {
    let golden_angle_rad = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count).map(move |i| {
        let y = 1.0 - (2 * i + 1) as f64 / count as f64;
        let radius = (1.0 - y * y).sqrt();
        let (sin_phi, cos_phi) = (golden_angle_rad * i as f64).sin_cos();
        DVec3::new(radius * cos_phi, y, radius * sin_phi)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_unit_and_their_second_moments_isotropic() {
        let points: Vec<DVec3> = fibonacci_sphere(300).collect();
        assert!(points.iter().all(|p| (p.length() - 1.0).abs() < 1e-12));
        let mean = points.iter().sum::<DVec3>() / 300.0;
        assert!(mean.length() < 2e-3, "{mean}");
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let second = points.iter().map(|p| p.dot(axis).powi(2)).sum::<f64>() / 300.0;
            assert!((second - 1.0 / 3.0).abs() < 1e-3, "{axis}: {second}");
        }
    }
}
