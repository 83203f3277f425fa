//! The search for the lens from the start: poses, adjustment in stages, and rejection of views that do not
//! fit.

use super::adjust::{Free, State, adjust};
use super::kannala_brandt::{COUNT, Parameters};
use super::pose::{Pose, middle, planar_pose};
use super::{BoardView, Corner, LensFitOptions, VIEWS_MIN, unusable};
use crate::error::{Error, Result};
use lightcast_core::camera::Lens;

const NOTHING: Free = [false; COUNT];
const PINHOLE: Free = [true, true, true, true, false, false, false, false];
pub(super) const ALL: Free = [true; COUNT];

/// Views with an RMS below this are never dropped: it is what good detectors achieve.
const DROP_FLOOR_PX: f64 = 0.1;

/// Ratio of the limit for the worst corner to that for a view's RMS, each relative to its median; among
/// thousands of corners some are in the tail of the distribution.
const CORNER_FACTOR: f64 = 5.0;

/// Most rounds in which Huber's limit is adapted to the residuals.
const ROBUST_ROUNDS_MAX: usize = 20;

/// Most rounds in which poses are searched again with a better lens; two are usual.
const POSE_ROUNDS_MAX: usize = 5;

/// A lens, and which views it was fitted to.
pub(super) struct Found {
    pub(super) state: State,
    /// For every pose the number of its view.
    pub(super) used: Vec<usize>,
    /// For every view the reason why it was dropped, if it was.
    pub(super) dropped: Vec<Option<String>>,
}

pub(super) fn search(views: &[BoardView], start: &Lens, options: &LensFitOptions) -> Result<Found> {
    let p = start.parameters();
    let [k1, k2, k3, k4] = p.k;
    let lens = Parameters([p.fx, p.fy, p.cx, p.cy, k1, k2, k3, k4]);
    let mut found = Found {
        state: State { lens, poses: Vec::new() },
        used: Vec::new(),
        dropped: views.iter().map(unusable).collect(),
    };
    for (index, view) in views.iter().enumerate() {
        if found.dropped[index].is_some() {
            continue;
        }
        match pose_from_rays(&lens, &view.corners) {
            Some(pose) => {
                found.used.push(index);
                found.state.poses.push(pose);
            }
            None => {
                found.dropped[index] = Some(
                    "no pose of a flat board looks like its corners; are they in the board's order?"
                        .to_owned(),
                );
            }
        }
    }
    found.check_count(views)?;
    let usable = found.used.len();

    found.retry_poses(views);
    found.fit(views, PINHOLE, found.huber_px(views));
    for _ in 0..POSE_ROUNDS_MAX {
        found.fit_robustly(views);
        if !found.retry_poses(views) {
            break;
        }
    }
    loop {
        if found.drop_worst(views, options.drop_factor) {
            if 2 * found.used.len() < usable {
                return Err(found.disagreement(views, usable));
            }
            found.check_count(views)?;
            found.fit_robustly(views);
            found.retry_poses(views);
            continue;
        }
        found.fit(views, ALL, f64::INFINITY);
        if found.worst(views, options.drop_factor).is_none() {
            return Ok(found);
        }
    }
}

impl Found {
    fn corners<'a>(&self, views: &'a [BoardView]) -> Vec<&'a [Corner]> {
        self.used.iter().map(|&index| views[index].corners.as_slice()).collect()
    }

    fn fit(&mut self, views: &[BoardView], free: Free, huber_px: f64) {
        adjust(&self.corners(views), &mut self.state, free, huber_px);
    }

    /// Adjusts everything with Huber's loss, adapting its limit to the residuals until both agree: which
    /// views are dropped must not depend on the start of the search.
    fn fit_robustly(&mut self, views: &[BoardView]) {
        let mut huber_px = self.huber_px(views);
        for _ in 0..ROBUST_ROUNDS_MAX {
            self.fit(views, ALL, huber_px);
            let next = self.huber_px(views);
            if (next / huber_px - 1.0).abs() < 1e-3 {
                break;
            }
            huber_px = next;
        }
    }

    /// The limit of Huber's loss: three standard deviations of the residuals, estimated from their median so
    /// that bad views do not affect it (the median length of a two-dimensional normal residual is 1.18
    /// deviations).
    fn huber_px(&self, views: &[BoardView]) -> f64 {
        (3.0 / 1.18 * median(&mut self.lengths(views))).max(1e-3)
    }

    /// Lengths of the residuals of all corners, in px.
    fn lengths(&self, views: &[BoardView]) -> Vec<f64> {
        let views = self.corners(views).into_iter().enumerate();
        views
            .flat_map(|(pose, corners)| {
                corners.iter().map(move |corner| self.state.residual(pose, corner).norm())
            })
            .collect()
    }

    /// Searches every pose again with the current lens, also mirrored, and keeps the one with the smallest
    /// residuals. Returns true if any view has clearly improved.
    fn retry_poses(&mut self, views: &[BoardView]) -> bool {
        let mut is_changed = false;
        for (pose, &index) in self.state.poses.iter_mut().zip(&self.used) {
            let corners = views[index].corners.as_slice();
            let before = refined(&self.state.lens, *pose, corners).1;
            let fresh = pose_from_rays(&self.state.lens, corners);
            let tries = [
                Some(*pose),
                fresh,
                Some(pose.mirrored(middle(corners))),
                fresh.map(|f| f.mirrored(middle(corners))),
            ];
            for tried in tries.into_iter().flatten() {
                let (better, cost) = refined(&self.state.lens, tried, corners);
                if cost < refined(&self.state.lens, *pose, corners).1 {
                    *pose = better;
                }
            }
            is_changed |= refined(&self.state.lens, *pose, corners).1 < 0.9 * before;
        }
        is_changed
    }

    /// The view that exceeds the limit set by `drop_factor` most: its index among the poses, and the reason.
    fn worst(&self, views: &[BoardView], drop_factor: f64) -> Option<(usize, String)> {
        let corners = self.corners(views);
        let rms: Vec<f64> = (0..corners.len()).map(|pose| self.state.view_rms(pose, corners[pose])).collect();
        let rms_median = median(&mut rms.clone());
        let corner_median = median(&mut self.lengths(views));
        let rms_limit = (drop_factor * rms_median).max(DROP_FLOOR_PX);
        let corner_limit = (CORNER_FACTOR * drop_factor * corner_median).max(CORNER_FACTOR * DROP_FLOOR_PX);
        let judge = |pose: usize| {
            let lengths = corners[pose].iter().map(|corner| self.state.residual(pose, corner).norm());
            let (at, worst) = lengths.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
            let excess = (rms[pose] / rms_limit).max(worst / corner_limit);
            Some((pose, excess, at, worst))
        };
        let (pose, excess, at, worst) =
            (0..corners.len()).filter_map(judge).max_by(|a, b| a.1.total_cmp(&b.1))?;
        let reason = if rms[pose] > rms_limit {
            format!(
                "its RMS residual {:.3} px is {:.1} times the median of the pictures, {rms_median:.3} px; a blurred picture, \
                 a bent board or corners in a wrong order look so",
                rms[pose],
                rms[pose] / rms_median
            )
        } else {
            format!(
                "its corner {at} is {worst:.2} px off, {:.1} times the median corner, {corner_median:.3} px; something \
                 else may have been taken for it",
                worst / corner_median
            )
        };
        (excess > 1.0).then_some((pose, reason))
    }

    fn drop_worst(&mut self, views: &[BoardView], drop_factor: f64) -> bool {
        let Some((pose, reason)) = self.worst(views, drop_factor) else { return false };
        self.state.poses.remove(pose);
        self.dropped[self.used.remove(pose)] = Some(reason);
        true
    }

    fn check_count(&self, views: &[BoardView]) -> Result<()> {
        if self.used.len() >= VIEWS_MIN {
            return Ok(());
        }
        Err(Error::failed(format!(
            "{} of {} views can be used, at least {VIEWS_MIN} are needed: take 10 to 30 pictures of the board, tilted in \
             different ways, some of them with the board at the rim{}",
            self.used.len(),
            views.len(),
            self.reasons(views)
        )))
    }

    fn disagreement(&self, views: &[BoardView], usable: usize) -> Error {
        Error::failed(format!(
            "fewer than half of {usable} views agree on one lens: check the board's columns, rows and size, the order of \
             its corners, and the circle's diameter and field of view{}",
            self.reasons(views)
        ))
    }

    /// The first few dropped views with their reasons.
    fn reasons(&self, views: &[BoardView]) -> String {
        let mut reasons = self
            .dropped
            .iter()
            .zip(views)
            .filter_map(|(reason, view)| Some(format!("; view {}: {}", view.name, reason.as_ref()?)));
        let first: String = reasons.by_ref().take(3).collect();
        match reasons.count() {
            0 => first,
            more => format!("{first}; and {more} more"),
        }
    }
}

pub(super) fn pose_from_rays(lens: &Parameters, corners: &[Corner]) -> Option<Pose> {
    let bearings: Vec<_> = corners.iter().map(|corner| lens.bearing(corner.pixel)).collect();
    planar_pose(corners, &bearings)
}

/// The pose of one view, adjusted alone, and its sum of squared residuals.
pub(super) fn refined(lens: &Parameters, pose: Pose, corners: &[Corner]) -> (Pose, f64) {
    let mut state = State { lens: *lens, poses: vec![pose] };
    let cost = adjust(&[corners], &mut state, NOTHING, f64::INFINITY);
    (state.poses[0], cost)
}

/// The median, 0 if there are no values. Reorders the values.
fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = values.len() / 2;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}
