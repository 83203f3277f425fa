//! The result of a fit: the lens, its uncertainty, and the residuals of every view.

use super::adjust::{NormalEquations, State};
use super::search::{ALL, Found, refined};
use super::{BoardView, Corner, LensStart};
use crate::error::{Error, Result};
use glam::DVec2;
use lightcast_core::camera::RadialPolynomial;
use lightcast_core::camera::{Lens, LensParameters};

/// A fitted lens and the statistics of the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct LensFit {
    /// The lens; its field of view is the declared one, or less where r(theta) stops increasing earlier.
    pub lens: Lens,
    /// Uncertainties of its parameters.
    pub deviations: LensDeviations,
    /// Square root of the mean squared length of the residuals, in px (the RMS that OpenCV returns).
    pub rms_px: f64,
    /// Largest angle of a used corner from the axis.
    pub theta_max_rad: f64,
    /// All views, in the given order.
    pub views: Vec<ViewFit>,
    /// Residuals of all corners of the used views.
    pub residuals: Vec<CornerResidual>,
    /// What the user should know about the lens's field of view.
    pub notes: Vec<String>,
}

/// Standard deviations (1 sigma) of the parameters, from the inverse of the normal equations at the optimum
/// and the residuals' own variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensDeviations {
    /// Of fx, in px.
    pub fx: f64,
    /// Of fy, in px.
    pub fy: f64,
    /// Of cx, in px.
    pub cx: f64,
    /// Of cy, in px.
    pub cy: f64,
    /// Of k1 to k4.
    pub k: [f64; 4],
}

/// The result for one view.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewFit {
    /// The view's name.
    pub name: String,
    /// How many corners it has.
    pub corners: usize,
    /// RMS residual in px with the fitted lens; `None` where no pose was found.
    pub rms_px: Option<f64>,
    /// Largest residual in px and the number of its corner, counted from 0 in the order given.
    pub worst: Option<(f64, usize)>,
    /// Largest angle of a corner from the axis.
    pub theta_max_rad: Option<f64>,
    /// Why it was dropped; `None` for a view that was used.
    pub dropped: Option<String>,
}

/// The residual of one corner: its observed minus its predicted position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerResidual {
    /// Number of its view.
    pub view: usize,
    /// Angle of its ray from the axis.
    pub theta_rad: f64,
    /// Component away from the principal point, in px.
    pub radial_px: f64,
    /// Perpendicular component, clockwise in the picture, in px.
    pub across_px: f64,
}

/// A focal length or centre whose standard deviation exceeds this fraction of the focal length counts as
/// undetermined.
const DEVIATION_MAX: f64 = 0.05;

pub(super) fn outcome(views: &[BoardView], start: &LensStart, found: Found) -> Result<LensFit> {
    let Found { state, used, dropped } = found;
    let corners: Vec<&[Corner]> = used.iter().map(|&index| views[index].corners.as_slice()).collect();
    let count: usize = corners.iter().map(|corners| corners.len()).sum();
    let squares = state.cost(&corners, f64::INFINITY);
    let deviations = deviations(&state, &corners, squares)?;

    let mut residuals = Vec::with_capacity(count);
    for (pose, &index) in used.iter().enumerate() {
        for corner in &views[index].corners {
            residuals.push(corner_residual(&state, pose, index, corner));
        }
    }
    let theta_max_rad = residuals.iter().map(|residual| residual.theta_rad).fold(0.0, f64::max);
    let (lens, notes) = lens(&state, start, theta_max_rad)?;
    let view_fits = views.iter().zip(dropped).enumerate().map(|(index, (view, dropped))| {
        let alone = match used.iter().position(|&used| used == index) {
            Some(pose) => Some(State { lens: state.lens, poses: vec![state.poses[pose]] }),
            None => super::search::pose_from_rays(&state.lens, &view.corners).map(|pose| State {
                lens: state.lens,
                poses: vec![refined(&state.lens, pose, &view.corners).0],
            }),
        };
        view_fit(view, alone.as_ref(), index, dropped)
    });
    let views = view_fits.collect();
    Ok(LensFit {
        lens,
        deviations,
        rms_px: (squares / count as f64).sqrt(),
        theta_max_rad,
        views,
        residuals,
        notes,
    })
}

fn view_fit(view: &BoardView, alone: Option<&State>, index: usize, dropped: Option<String>) -> ViewFit {
    let residuals: Vec<CornerResidual> = alone
        .map(|state| view.corners.iter().map(|corner| corner_residual(state, 0, index, corner)).collect())
        .unwrap_or_default();
    ViewFit {
        name: view.name.clone(),
        corners: view.corners.len(),
        rms_px: alone.map(|state| state.view_rms(0, &view.corners)),
        worst: residuals
            .iter()
            .enumerate()
            .map(|(corner, residual)| (residual.radial_px.hypot(residual.across_px), corner))
            .max_by(|a, b| a.0.total_cmp(&b.0)),
        theta_max_rad: residuals.iter().map(|residual| residual.theta_rad).reduce(f64::max),
        dropped,
    }
}

fn corner_residual(state: &State, pose: usize, view: usize, corner: &Corner) -> CornerResidual {
    let point = state.poses[pose].point(corner.board_m);
    let across = point.x.hypot(point.y);
    let residual = state.residual(pose, corner);
    let outwards = DVec2::new(point.x, point.y).try_normalize().unwrap_or(DVec2::X);
    let residual = DVec2::new(residual.x, residual.y);
    CornerResidual {
        view,
        theta_rad: across.atan2(point.z),
        radial_px: residual.dot(outwards),
        across_px: residual.dot(outwards.perp()),
    }
}

fn deviations(state: &State, corners: &[&[Corner]], squares: f64) -> Result<LensDeviations> {
    let undetermined = |what: String| {
        Error::failed(format!(
            "the views do not determine the lens ({what}): add pictures of the board, tilted in different ways, some of \
             them with the board close to the rim"
        ))
    };
    let equations = 2 * corners.iter().map(|corners| corners.len()).sum::<usize>();
    let unknowns = 8 + 6 * corners.len();
    if equations <= unknowns {
        return Err(undetermined(format!("{equations} coordinates of corners for {unknowns} unknowns")));
    }
    let covariance = NormalEquations::new(corners, state, ALL, f64::INFINITY)
        .reduced_lens()
        .and_then(nalgebra::SMatrix::cholesky)
        .map(|factor| factor.inverse())
        .ok_or_else(|| undetermined("many lenses fit equally well".to_owned()))?;
    let variance = squares / (equations - unknowns) as f64;
    let [fx, fy, cx, cy, k1, k2, k3, k4] = std::array::from_fn(|at| (variance * covariance[(at, at)]).sqrt());
    let focal = state.lens.0[0];
    for (name, value) in [("fx", fx), ("fy", fy), ("cx", cx), ("cy", cy)] {
        if value.is_nan() || value > DEVIATION_MAX * focal {
            return Err(undetermined(format!(
                "{name} is known to {value:.1} px only, of a focal length of {focal:.1} px"
            )));
        }
    }
    Ok(LensDeviations { fx, fy, cx, cy, k: [k1, k2, k3, k4] })
}

/// The lens with as much of the declared field of view as r(theta) allows.
fn lens(state: &State, start: &LensStart, theta_max_rad: f64) -> Result<(Lens, Vec<String>)> {
    let [fx, fy, cx, cy, k1, k2, k3, k4] = state.lens.0;
    let k = [k1, k2, k3, k4];
    let mut notes = Vec::new();
    let mut field_of_view_rad = start.field_of_view_rad;
    let widest_deg = theta_max_rad.to_degrees();
    if let Some(turn_rad) = (RadialPolynomial { k }).turning_angle_rad() {
        let turn_deg = turn_rad.to_degrees();
        if turn_rad <= theta_max_rad {
            return Err(Error::failed(format!(
                "the fitted r(theta) turns at {turn_deg:.1} degrees from the axis, inside the corners, which reach \
                 {widest_deg:.1} degrees: check the circle's diameter and field of view and add pictures with the board \
                 close to the rim"
            )));
        }
        // The limit is a millionth of a radian below the angle at which r stops increasing: closer to it the
        // inverse loses precision.
        let limit_rad = 2.0 * (turn_rad - 1e-6);
        if field_of_view_rad > limit_rad {
            notes.push(format!(
                "field of view cut from the declared {:.2} to {:.2} degrees: beyond it the fitted r(theta) no longer \
                 increases; corners closer to the rim than {widest_deg:.1} degrees from the axis would tell the lens there",
                field_of_view_rad.to_degrees(),
                limit_rad.to_degrees()
            ));
            field_of_view_rad = limit_rad;
        }
    }
    // A few degrees of extrapolation are usual: boards have a white border.
    if theta_max_rad > 0.5 * field_of_view_rad {
        notes.push(format!(
            "the corners reach {widest_deg:.1} degrees from the axis, beyond the declared field of view of {:.1}: rays \
             outside it will not be seen; declare the whole field of view",
            field_of_view_rad.to_degrees()
        ));
    } else if 0.5 * field_of_view_rad - theta_max_rad > 5f64.to_radians() {
        notes.push(format!(
            "the corners reach {widest_deg:.1} degrees from the axis, the field of view {:.1}: between them the lens is \
             extrapolated",
            (0.5 * field_of_view_rad).to_degrees()
        ));
    }
    let parameters =
        LensParameters { width: start.width, height: start.height, fx, fy, cx, cy, k, field_of_view_rad };
    let lens = Lens::new(parameters).map_err(|error| {
        Error::failed("the fit gave no lens; check the board, the circle's diameter and the field of view")
            .because(error)
    })?;
    Ok((lens, notes))
}
