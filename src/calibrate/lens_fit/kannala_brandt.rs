//! The projection of [`Lens`](lightcast_core::camera::Lens) with its derivatives, for any lens that the
//! search may try: nothing is checked, and rays at every angle are projected.

use glam::DVec2;
use lightcast_core::camera::RadialPolynomial;
use nalgebra::{SMatrix, Vector2, Vector3};
use std::f64::consts::PI;

/// Number of lens parameters.
pub(super) const COUNT: usize = 8;

/// fx, fy, cx, cy (px, half-pixel centres), k1 to k4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Parameters(pub(super) [f64; COUNT]);

/// A pixel and its derivatives.
pub(super) struct Projected {
    pub(super) pixel: Vector2<f64>,
    /// Derivatives by the lens parameters.
    pub(super) by_lens: SMatrix<f64, 2, COUNT>,
    /// Derivatives by the point in the camera frame.
    pub(super) by_point: SMatrix<f64, 2, 3>,
}

impl Parameters {
    fn polynomial(&self) -> RadialPolynomial {
        let [.., k1, k2, k3, k4] = self.0;
        RadialPolynomial { k: [k1, k2, k3, k4] }
    }

    /// Pixel of a point in the camera frame. Points on the axis behind the camera, where the azimuth is
    /// undefined, are projected with psi = 0.
    pub(super) fn project(&self, point: &Vector3<f64>) -> Vector2<f64> {
        let [fx, fy, cx, cy, ..] = self.0;
        let across = point.x.hypot(point.y);
        let radius = self.polynomial().radius(across.atan2(point.z));
        let (cos_psi, sin_psi) = if across > 0.0 { (point.x / across, point.y / across) } else { (1.0, 0.0) };
        Vector2::new(cx + fx * radius * cos_psi, cy + fy * radius * sin_psi)
    }

    /// Pixel of a point in the camera frame, with derivatives. With `rho = hypot(x, y)` and `q = r(theta) /
    /// rho`, the pixel is `c + f q (x, y)`.
    pub(super) fn project_with_derivatives(&self, point: &Vector3<f64>) -> Projected {
        let [fx, fy, ..] = self.0;
        let (x, y, z) = (point.x, point.y, point.z);
        let pixel = self.project(point);
        let rho = x.hypot(y);
        let mut by_lens = SMatrix::zeros();
        (by_lens[(0, 2)], by_lens[(1, 3)]) = (1.0, 1.0);
        let mut by_point = SMatrix::zeros();
        // On the axis q is 1 / z and its derivative across is 0; within 1e-9 of the distance from the axis
        // the error is as small.
        if rho <= 1e-9 * z.abs() {
            if z > 0.0 {
                by_lens[(0, 0)] = x / z;
                by_lens[(1, 1)] = y / z;
                by_point = SMatrix::<f64, 2, 3>::new(fx, 0.0, -fx * x / z, 0.0, fy, -fy * y / z) / z;
            }
            return Projected { pixel, by_lens, by_point };
        }
        let theta = rho.atan2(z);
        let polynomial = self.polynomial();
        let (radius, slope) = (polynomial.radius(theta), polynomial.slope(theta));
        let (cos_psi, sin_psi) = (x / rho, y / rho);
        by_lens[(0, 0)] = radius * cos_psi;
        by_lens[(1, 1)] = radius * sin_psi;
        let mut power = theta;
        for column in 4..COUNT {
            power *= theta * theta;
            by_lens[(0, column)] = fx * power * cos_psi;
            by_lens[(1, column)] = fy * power * sin_psi;
        }
        let squared = rho * rho + z * z;
        let q = radius / rho;
        let q_by_rho = (slope * z / squared - q) / rho;
        let q_by_z = -slope / squared;
        by_point[(0, 0)] = fx * (q + q_by_rho * cos_psi * x);
        by_point[(0, 1)] = fx * q_by_rho * sin_psi * x;
        by_point[(0, 2)] = fx * q_by_z * x;
        by_point[(1, 0)] = fy * q_by_rho * cos_psi * y;
        by_point[(1, 1)] = fy * (q + q_by_rho * sin_psi * y);
        by_point[(1, 2)] = fy * q_by_z * y;
        Projected { pixel, by_lens, by_point }
    }

    /// Unit direction of a pixel, up to the angle at which r stops increasing; pixels farther out are mapped
    /// to that angle.
    pub(super) fn bearing(&self, pixel: DVec2) -> Vector3<f64> {
        let [fx, fy, cx, cy, ..] = self.0;
        let (x, y) = ((pixel.x - cx) / fx, (pixel.y - cy) / fy);
        let polynomial = self.polynomial();
        let limit_rad = polynomial.turning_angle_rad().unwrap_or(PI);
        let radius = x.hypot(y);
        let theta = if radius < polynomial.radius(limit_rad) {
            polynomial.invert(radius, limit_rad, radius)
        } else {
            limit_rad
        };
        let across = if radius > 0.0 { theta.sin() / radius } else { 0.0 };
        Vector3::new(x * across, y * across, theta.cos())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use lightcast_core::camera::{Lens, LensParameters};

    const LENS: Parameters = Parameters([310.0, 305.0, 512.3, 509.8, 0.02, -0.004, 0.0008, -0.00003]);

    fn points() -> impl Iterator<Item = Vector3<f64>> {
        (0..60).map(|index| {
            let (theta, psi) = (f64::from(index) * 1.95 / 59.0, f64::from(index) * 1.7);
            Vector3::new(theta.sin() * psi.cos(), theta.sin() * psi.sin(), theta.cos())
                * (0.4 + 0.1 * f64::from(index % 7))
        })
    }

    #[test]
    fn pixels_and_bearings_are_those_of_the_lens_also_beyond_90_degrees() {
        let [fx, fy, cx, cy, k1, k2, k3, k4] = LENS.0;
        let lens = Lens::new(LensParameters {
            width: 1024,
            height: 1024,
            fx,
            fy,
            cx,
            cy,
            k: [k1, k2, k3, k4],
            field_of_view_rad: 4.0,
        })
        .unwrap();
        for point in points() {
            let expected = lens.project(DVec3::new(point.x, point.y, point.z)).unwrap();
            let pixel = LENS.project(&point);
            assert!((pixel - Vector2::new(expected.x, expected.y)).norm() < 1e-10);
            assert!((LENS.bearing(expected) - point.normalize()).norm() < 1e-9);
        }
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        for point in points() {
            let exact = LENS.project_with_derivatives(&point);
            assert_eq!(exact.pixel, LENS.project(&point));
            for column in 0..COUNT {
                let step = if column < 4 { 1e-3 } else { 1e-5 };
                let at = |sign: f64| {
                    let mut lens = LENS;
                    lens.0[column] += sign * step;
                    lens.project(&point)
                };
                let difference = (at(1.0) - at(-1.0)) / (2.0 * step);
                let error = (difference - exact.by_lens.column(column)).norm();
                assert!(error <= 1e-6 * (1.0 + difference.norm()), "{point} parameter {column}: {error:e}");
            }
            // Next to the axis the azimuth changes within the step.
            if point.x.hypot(point.y) == 0.0 {
                continue;
            }
            for row in 0..3 {
                let step = 1e-6;
                let at = |sign: f64| {
                    let mut moved = point;
                    moved[row] += sign * step;
                    LENS.project(&moved)
                };
                let difference = (at(1.0) - at(-1.0)) / (2.0 * step);
                let error = (difference - exact.by_point.column(row)).norm();
                assert!(error <= 1e-5 * (1.0 + difference.norm()), "{point} coordinate {row}: {error:e}");
            }
        }
    }

    #[test]
    fn derivatives_are_continuous_at_the_axis() {
        let on = LENS.project_with_derivatives(&Vector3::new(0.0, 0.0, 0.7));
        let beside = LENS.project_with_derivatives(&Vector3::new(1e-8, -1e-8, 0.7));
        assert!((on.by_point - beside.by_point).norm() < 1e-4, "{} {}", on.by_point, beside.by_point);
        assert!((on.by_lens - beside.by_lens).norm() < 1e-6);
        let behind = LENS.project_with_derivatives(&Vector3::new(0.0, 0.0, -0.7));
        assert!(behind.by_point.iter().all(|value| value.is_finite()));
    }
}
