//! Bundle adjustment: the lens and the pose of every view that minimise the squared pixel residuals.
//!
//! Levenberg-Marquardt with Marquardt's scaling on the normal equations, reduced to the lens by the Schur
//! complement: a view's pose affects only that view's corners, so that the cost grows linearly with the
//! number of views and not with its cube (B. Triggs et al. 2000, *Bundle Adjustment - A Modern Synthesis*,
//! section 6.1). A pose costs 6 x 6.

use super::Corner;
use super::kannala_brandt::{COUNT, Parameters};
use super::pose::Pose;
use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector2, Vector6};

type LensMatrix = SMatrix<f64, COUNT, COUNT>;
type LensVector = SVector<f64, COUNT>;

/// Which of fx, fy, cx, cy, k1 to k4 are adjusted.
pub(super) type Free = [bool; COUNT];

/// Most steps; a start that is far off takes some dozens.
const STEPS_MAX: usize = 300;

/// The parameters that are adjusted.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) lens: Parameters,
    /// One per view.
    pub(super) poses: Vec<Pose>,
}

impl State {
    /// Observed minus predicted pixel.
    pub(super) fn residual(&self, view: usize, corner: &Corner) -> Vector2<f64> {
        let pixel = self.lens.project(&self.poses[view].point(corner.board_m));
        Vector2::new(corner.pixel.x, corner.pixel.y) - pixel
    }

    /// RMS length of the residuals of one view, in px.
    pub(super) fn view_rms(&self, view: usize, corners: &[Corner]) -> f64 {
        let sum: f64 = corners.iter().map(|corner| self.residual(view, corner).norm_squared()).sum();
        (sum / corners.len().max(1) as f64).sqrt()
    }

    /// Sum of squared residuals in px^2; beyond `huber_px` they count in proportion to their length.
    pub(super) fn cost(&self, views: &[&[Corner]], huber_px: f64) -> f64 {
        let residuals = views
            .iter()
            .enumerate()
            .flat_map(|(view, corners)| corners.iter().map(move |corner| self.residual(view, corner).norm()));
        residuals.map(|length| huber(length, huber_px).0).sum()
    }
}

/// Huber's loss of a residual's length, and its weight: `length^2` and 1 up to the limit.
fn huber(length: f64, limit: f64) -> (f64, f64) {
    if length <= limit {
        (length * length, 1.0)
    } else {
        (2.0 * limit * length - limit * limit, limit / length)
    }
}

/// Normal equations, block by block.
pub(super) struct NormalEquations {
    lens: LensMatrix,
    lens_right: LensVector,
    views: Vec<ViewBlock>,
}

struct ViewBlock {
    pose: Matrix6<f64>,
    across: SMatrix<f64, COUNT, 6>,
    right: Vector6<f64>,
}

impl NormalEquations {
    pub(super) fn new(views: &[&[Corner]], state: &State, free: Free, huber_px: f64) -> Self {
        let mut lens = LensMatrix::zeros();
        let mut lens_right = LensVector::zeros();
        let blocks = views.iter().zip(&state.poses).map(|(corners, pose)| {
            let mut block =
                ViewBlock { pose: Matrix6::zeros(), across: SMatrix::zeros(), right: Vector6::zeros() };
            for corner in *corners {
                let (by_lens, by_pose, residual) = linearise(&state.lens, pose, corner, free);
                let (_, weight) = huber(residual.norm(), huber_px);
                lens += by_lens.transpose() * by_lens * weight;
                lens_right += by_lens.transpose() * residual * weight;
                block.pose += by_pose.transpose() * by_pose * weight;
                block.across += by_lens.transpose() * by_pose * weight;
                block.right += by_pose.transpose() * residual * weight;
            }
            block
        });
        let views = blocks.collect();
        for column in (0..COUNT).filter(|&column| !free[column]) {
            lens[(column, column)] = 1.0;
        }
        Self { lens, lens_right, views }
    }

    /// The normal equations of the lens with all poses eliminated (Schur complement); without damping the
    /// inverse is the covariance of the lens for residuals of unit variance. `None` where a view's corners do
    /// not determine its pose.
    pub(super) fn reduced_lens(&self) -> Option<LensMatrix> {
        self.reduce(0.0).map(|(lens, ..)| lens)
    }

    #[expect(clippy::type_complexity, reason = "three parts of one elimination, taken apart at once")]
    fn reduce(
        &self,
        damping: f64,
    ) -> Option<(LensMatrix, LensVector, Vec<nalgebra::Cholesky<f64, nalgebra::U6>>)> {
        let mut lens = damped(self.lens, damping);
        let mut right = self.lens_right;
        let mut factors = Vec::with_capacity(self.views.len());
        for view in &self.views {
            let factor = damped(view.pose, damping).cholesky()?;
            lens -= view.across * factor.solve(&view.across.transpose());
            right -= view.across * factor.solve(&view.right);
            factors.push(factor);
        }
        Some((lens, right, factors))
    }

    /// The step of every parameter; `None` where the damped equations are singular.
    fn step(&self, damping: f64) -> Option<(LensVector, Vec<Vector6<f64>>)> {
        let (lens, right, factors) = self.reduce(damping)?;
        let lens_step = lens.cholesky()?.solve(&right);
        let pose_steps = self
            .views
            .iter()
            .zip(factors)
            .map(|(view, factor)| factor.solve(&(view.right - view.across.transpose() * lens_step)))
            .collect();
        Some((lens_step, pose_steps))
    }
}

/// The matrix with its diagonal scaled up (Marquardt 1963).
fn damped<const N: usize>(mut matrix: SMatrix<f64, N, N>, damping: f64) -> SMatrix<f64, N, N> {
    for at in 0..N {
        matrix[(at, at)] *= 1.0 + damping;
    }
    matrix
}

/// Derivatives of a corner's pixel by the lens and by the pose (rotation vector in the camera frame,
/// translation), and its residual.
pub(super) fn linearise(
    lens: &Parameters,
    pose: &Pose,
    corner: &Corner,
    free: Free,
) -> (SMatrix<f64, 2, COUNT>, SMatrix<f64, 2, 6>, Vector2<f64>) {
    let turned = pose.turned(corner.board_m);
    let projected = lens.project_with_derivatives(&(turned + pose.translation));
    let mut by_lens = projected.by_lens;
    for column in (0..COUNT).filter(|&column| !free[column]) {
        by_lens.set_column(column, &Vector2::zeros());
    }
    let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
    // d(exp(w) v) / dw at 0 is -[v]x.
    by_pose.fixed_columns_mut::<3>(0).copy_from(&(projected.by_point * -turned.cross_matrix()));
    by_pose.fixed_columns_mut::<3>(3).copy_from(&(projected.by_point * Matrix3::identity()));
    (by_lens, by_pose, Vector2::new(corner.pixel.x, corner.pixel.y) - projected.pixel)
}

/// Adjusts `state` until no step makes the cost smaller; `views[i]` are the corners that pose i sees. The
/// cost never grows, so a start that cannot be improved stays unchanged. Returns the cost in px^2.
pub(super) fn adjust(views: &[&[Corner]], state: &mut State, free: Free, huber_px: f64) -> f64 {
    let mut cost = state.cost(views, huber_px);
    let mut damping = 1e-3;
    let mut equations = NormalEquations::new(views, state, free, huber_px);
    for _ in 0..STEPS_MAX {
        let tried = equations.step(damping).map(|steps| {
            let next = stepped(state, &steps);
            let cost = next.cost(views, huber_px);
            (next, cost)
        });
        match tried {
            Some((next, next_cost)) if next_cost <= cost && is_lens(&next.lens) => {
                let gain = cost - next_cost;
                *state = next;
                cost = next_cost;
                damping = (damping * 0.1).max(1e-12);
                if gain <= 1e-13 * cost {
                    break;
                }
                equations = NormalEquations::new(views, state, free, huber_px);
            }
            _ => {
                damping *= 5.0;
                // Steps this short change nothing in 16 digits.
                if damping > 1e14 {
                    break;
                }
            }
        }
    }
    cost
}

fn stepped(state: &State, (lens_step, pose_steps): &(LensVector, Vec<Vector6<f64>>)) -> State {
    let mut lens = state.lens;
    for (value, step) in lens.0.iter_mut().zip(lens_step) {
        *value += step;
    }
    let poses = state.poses.iter().zip(pose_steps).map(|(pose, step)| {
        pose.stepped(step.fixed_rows::<3>(0).into_owned(), step.fixed_rows::<3>(3).into_owned())
    });
    State { lens, poses: poses.collect() }
}

fn is_lens(lens: &Parameters) -> bool {
    lens.0[0] > 0.0 && lens.0[1] > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use nalgebra::Vector3;

    #[test]
    fn derivatives_by_the_pose_are_those_of_finite_differences() {
        let lens = Parameters([310.0, 305.0, 512.3, 509.8, 0.02, -0.004, 0.0008, -0.00003]);
        let corner = Corner { board_m: DVec2::new(0.12, -0.07), pixel: DVec2::new(3.0, 4.0) };
        for turn in [[0.1, 0.2, -0.3], [0.3, 1.5, 0.2], [-1.2, 0.4, 2.0]] {
            for shift in [[0.1, -0.2, 0.3], [0.3, 0.1, -0.1]] {
                let pose = Pose { rotation: Matrix3::identity(), translation: Vector3::zeros() }
                    .stepped(Vector3::from(turn), Vector3::from(shift));
                let (_, by_pose, residual) = linearise(&lens, &pose, &corner, [true; COUNT]);
                let state = State { lens, poses: vec![pose] };
                assert_eq!(residual, state.residual(0, &corner));
                for column in 0..6 {
                    let at = |step: f64| {
                        let mut steps = [0.0; 6];
                        steps[column] = step;
                        let [a, b, c, d, e, f] = steps;
                        lens.project(
                            &pose.stepped(Vector3::new(a, b, c), Vector3::new(d, e, f)).point(corner.board_m),
                        )
                    };
                    let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
                    let error = (difference - by_pose.column(column)).norm();
                    assert!(
                        error < 1e-6 * (1.0 + difference.norm()),
                        "{turn:?} {shift:?} {column}: {error:e}"
                    );
                }
            }
        }
    }

    #[test]
    fn hubers_loss_is_smooth_where_it_changes() {
        assert_eq!(huber(0.5, 1.0), (0.25, 1.0));
        assert_eq!(huber(1.0, 1.0), (1.0, 1.0));
        assert_eq!(huber(3.0, 1.0), (5.0, 1.0 / 3.0));
        assert_eq!(huber(3.0, f64::INFINITY), (9.0, 1.0));
    }
}
