//! The pose of a flat board relative to the camera, from rays.

use super::Corner;
use glam::DVec2;
use nalgebra::{Matrix3, Rotation3, SMatrix, SymmetricEigen, Unit, Vector3};

/// Camera from board: `rotation * (x, y, 0) + translation`, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    pub(super) rotation: Matrix3<f64>,
    pub(super) translation: Vector3<f64>,
}

impl Pose {
    /// A point of the board, rotated but not translated.
    pub(super) fn turned(&self, board_m: DVec2) -> Vector3<f64> {
        self.rotation.column(0) * board_m.x + self.rotation.column(1) * board_m.y
    }

    /// A point of the board in the camera frame.
    pub(super) fn point(&self, board_m: DVec2) -> Vector3<f64> {
        self.turned(board_m) + self.translation
    }

    /// The pose rotated further by a rotation vector in the camera frame, and translated: a step of the
    /// search.
    pub(super) fn stepped(&self, turn: Vector3<f64>, shift: Vector3<f64>) -> Self {
        Self {
            rotation: Rotation3::from_scaled_axis(turn).into_inner() * self.rotation,
            translation: self.translation + shift,
        }
    }

    /// The other pose from which a small board looks nearly the same: its normal mirrored at the line of
    /// sight to the board's middle, whose position is unchanged.
    pub(super) fn mirrored(&self, middle_m: DVec2) -> Self {
        let middle = self.point(middle_m);
        let normal = self.rotation.column(2).into_owned();
        let Some(sight) = middle.try_normalize(0.0) else { return *self };
        let mirrored = sight * (2.0 * normal.dot(&sight)) - normal;
        let turn = match Unit::try_new(normal.cross(&mirrored), 1e-12) {
            Some(axis) => Rotation3::from_axis_angle(&axis, normal.angle(&mirrored)).into_inner(),
            None => Matrix3::identity(),
        };
        let rotation = turn * self.rotation;
        let turned = Self { rotation, translation: Vector3::zeros() }.point(middle_m);
        Self { rotation, translation: middle - turned }
    }
}

/// Direct linear transform on rays: with `H = s [r1 r2 t]`, every ray b and board point p give `b x (H p) =
/// 0`. Because rays and not picture points are compared, boards that extend behind the camera plane need no
/// special treatment; the sign of H is chosen so that the points lie on the side of the rays. (The homography
/// of Zhang 2000, *A Flexible New Technique for Camera Calibration*, section 3.1, with rays for image
/// points.)
///
/// `None` where the points do not determine it: fewer than four, or all on a line.
pub(super) fn planar_pose(corners: &[Corner], bearings: &[Vector3<f64>]) -> Option<Pose> {
    let middle = middle(corners);
    let spread = (corners.iter().map(|corner| corner.board_m.distance_squared(middle)).sum::<f64>()
        / corners.len() as f64)
        .sqrt();
    if corners.len() < 4 || !(spread > 0.0 && spread.is_finite()) {
        return None;
    }
    let mut normal_matrix = SMatrix::<f64, 9, 9>::zeros();
    let scaled = |corner: &Corner| {
        let at = (corner.board_m - middle) / spread;
        Vector3::new(at.x, at.y, 1.0)
    };
    for (corner, bearing) in corners.iter().zip(bearings) {
        let p = scaled(corner);
        let cross = bearing.cross_matrix();
        for row in 0..3 {
            // Row-major elements of H.
            let equation = SMatrix::<f64, 9, 1>::from_fn(|at, _| cross[(row, at / 3)] * p[at % 3]);
            normal_matrix += equation * equation.transpose();
        }
    }
    if normal_matrix.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(normal_matrix);
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    // Two null vectors mean that the points are on a line. The threshold allows for eigenvalues being squares
    // of singular values.
    if eigen.eigenvalues[order[1]] <= 1e-12 * eigen.eigenvalues[order[8]] {
        return None;
    }
    let h = eigen.eigenvectors.column(order[0]);
    let mut h = Matrix3::from_fn(|row, column| h[3 * row + column]);
    let in_front: f64 = corners
        .iter()
        .zip(bearings)
        .map(|(corner, bearing)| bearing.dot(&(h * scaled(corner))).signum())
        .sum();
    if in_front < 0.0 {
        h = -h;
    }
    let scale = 0.5 * (h.column(0).norm() + h.column(1).norm());
    let (first, second) = (h.column(0) / scale, h.column(1) / scale);
    // The rotation closest to [r1 r2 r1 x r2].
    let svd = Matrix3::from_columns(&[first, second, first.cross(&second)]).svd(true, true);
    let rotation = svd.u? * svd.v_t?;
    if !rotation.iter().all(|value| value.is_finite()) || rotation.determinant() < 0.0 {
        return None;
    }
    let turned_middle = rotation.column(0) * middle.x + rotation.column(1) * middle.y;
    Some(Pose { rotation, translation: h.column(2) * (spread / scale) - turned_middle })
}

/// The mean of the corners on the board, in metres.
pub(super) fn middle(corners: &[Corner]) -> DVec2 {
    corners.iter().map(|corner| corner.board_m).sum::<DVec2>() / corners.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn board() -> Vec<Corner> {
        (0..48)
            .map(|index| Corner {
                board_m: DVec2::new(f64::from(index % 8), f64::from(index / 8)) * 0.03,
                pixel: DVec2::ZERO,
            })
            .collect()
    }

    #[test]
    fn exact_rays_give_the_pose_also_across_the_camera_plane() {
        for (turn, translation) in [
            ([0.1, -0.2, 0.3], [-0.1, -0.05, 0.3]),
            // Half of the board is behind the plane z = 0.
            ([0.2, 1.4, -0.1], [0.3, -0.1, 0.1]),
            ([0.0, 1.7, 0.4], [0.25, 0.0, -0.05]),
        ] {
            let pose = Pose {
                rotation: Rotation3::from_scaled_axis(Vector3::from(turn)).into_inner(),
                translation: Vector3::from(translation),
            };
            let corners = board();
            let rays: Vec<_> = corners.iter().map(|c| pose.point(c.board_m).normalize()).collect();
            let found = planar_pose(&corners, &rays).unwrap();
            assert!((found.rotation - pose.rotation).norm() < 1e-7, "{} {}", found.rotation, pose.rotation);
            assert!((found.translation - pose.translation).norm() < 1e-7);
            // Mirroring twice restores the pose.
            let twice = pose.mirrored(middle(&corners)).mirrored(middle(&corners));
            assert!((twice.rotation - pose.rotation).norm() < 1e-9);
            assert!((twice.translation - pose.translation).norm() < 1e-9);
        }
    }

    #[test]
    fn points_on_a_line_and_too_few_give_none() {
        let line: Vec<Corner> = board().into_iter().take(8).collect();
        let rays: Vec<_> = line.iter().map(|c| Vector3::new(c.board_m.x, 0.1, 1.0).normalize()).collect();
        assert_eq!(planar_pose(&line, &rays), None);
        assert_eq!(planar_pose(&board()[..3], &rays[..3]), None);
        assert_eq!(planar_pose(&[], &[]), None);
    }
}
