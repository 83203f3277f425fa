use glam::DVec3;
use std::f64::consts::TAU;

/// Unit vector `(sin theta cos phi, cos theta, sin theta sin phi)`; angles in radians.
#[inline]
pub fn direction(theta_rad: f64, phi_rad: f64) -> DVec3 {
    let (sin_theta, cos_theta) = theta_rad.sin_cos();
    let (sin_phi, cos_phi) = phi_rad.sin_cos();
    DVec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi)
}

/// Unit vector at the height `z = 1 - cos theta`, from 0 to 2, and an azimuth in radians.
#[inline]
pub fn direction_at_height(z: f64, phi_rad: f64) -> DVec3 {
    let sin_theta = (z * (2.0 - z)).max(0.0).sqrt();
    let (sin_phi, cos_phi) = phi_rad.sin_cos();
    DVec3::new(sin_theta * cos_phi, 1.0 - z, sin_theta * sin_phi)
}

/// `(theta, phi)` of a vector of any positive length: theta in [0, pi], phi in [0, 2 pi). The inverse of
/// [`direction`]; exact near the poles, where an arc cosine would lose half the digits. The zero vector gives
/// (0, 0).
#[inline]
pub fn polar(v: DVec3) -> (f64, f64) {
    let theta_rad = v.x.hypot(v.z).atan2(v.y);
    let phi_rad = v.z.atan2(v.x).rem_euclid(TAU);
    // rem_euclid rounds tiny negative angles up to the modulus itself.
    (theta_rad, if phi_rad >= TAU { 0.0 } else { phi_rad })
}

/// Angle between two vectors of any positive length, radians in [0, pi], exact for small angles.
#[inline]
pub fn angle_between(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn polar_inverts_direction_also_near_poles_and_seam() {
        for theta in [1e-12, 1e-6, 0.3, PI / 2.0, PI - 1e-6] {
            for phi in [0.0, 1e-9, 1.0, PI, 4.0, TAU - 1e-9] {
                let (t, p) = polar(direction(theta, phi));
                assert!((t - theta).abs() < 1e-15 * 8.0 + 1e-15 * theta, "{theta} {phi}: {t}");
                assert!((p - phi).abs() < 1e-9 * 1e-3, "{theta} {phi}: {p}");
            }
        }
    }

    #[test]
    fn azimuth_never_reaches_a_full_turn() {
        assert_eq!(polar(DVec3::new(1.0, 0.0, -1e-300)).1, 0.0);
        assert_eq!(polar(DVec3::ZERO), (0.0, 0.0));
    }

    #[test]
    fn small_angles_are_exact() {
        let a = direction(1.0, 2.0);
        let b = direction(1.0 + 1e-9, 2.0);
        assert!((angle_between(a, b) - 1e-9).abs() < 1e-15);
        assert_eq!(angle_between(a, a), 0.0);
    }
}
