//! A Kannala-Brandt lens (METHODS section 3) from views of a flat board whose corners were found in the
//! pictures.
//!
//! Solvers that start from a pinhole diverge on fisheye pictures. Here the start is the equidistant lens that
//! maps the declared field of view onto the declared circle; poses are found from rays and not from picture
//! points, so that corners more than 90 degrees off the axis need no special treatment (`pose`). All
//! parameters are then adjusted together by least squares of the pixel residuals (`adjust`), at first with
//! Huber's loss, so that a bad view does not distort the lens before it is found and dropped (`search`).

mod adjust;
mod kannala_brandt;
mod outcome;
mod pose;
mod search;
#[cfg(test)]
mod tests;

use crate::error::{Error, Place, Result};
use glam::DVec2;
use lightcast_core::camera::{Lens, LensParameters};

pub use outcome::{CornerResidual, LensDeviations, LensFit, ViewFit};

/// A corner of a flat board and where a picture shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Position on the board, in metres.
    pub board_m: DVec2,
    /// Position in the picture, in pixels with half-pixel centres (OpenCV's coordinates + 0.5).
    pub pixel: DVec2,
}

/// The corners that were found in one picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoardView {
    /// The picture's name, for messages.
    pub name: String,
    /// In any order.
    pub corners: Vec<Corner>,
}

/// Assumptions about a lens before any view: it is equidistant, and its image circle has the given field of
/// view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensStart {
    /// Columns of the pictures.
    pub width: usize,
    /// Rows of the pictures.
    pub height: usize,
    /// Full field of view of the circle, in (0, 2 pi]; the fitted lens declares it too.
    pub field_of_view_rad: f64,
    /// Diameter of the circle in pixels; it may be larger than the picture.
    pub circle_diameter_px: f64,
    /// Centre of the circle in pixels, half-pixel centres.
    pub circle_centre_px: DVec2,
}

impl LensStart {
    /// The equidistant lens: f is half the diameter divided by half the field of view.
    ///
    /// # Errors
    /// `Usage`, naming the impossible number.
    pub fn lens(&self) -> Result<Lens> {
        let &Self { width, height, field_of_view_rad, circle_diameter_px, circle_centre_px } = self;
        if !(circle_diameter_px > 0.0 && circle_diameter_px.is_finite()) {
            return Err(Error::usage("must be positive; measure the bright circle in a picture, in pixels")
                .at(Place::value("circle_diameter_px", circle_diameter_px)));
        }
        if field_of_view_rad.is_nan() || field_of_view_rad <= 0.0 {
            return Err(Error::usage("must be over 0, at most 360")
                .at(Place::value("field_of_view_deg", field_of_view_rad.to_degrees())));
        }
        let f = circle_diameter_px / field_of_view_rad;
        Ok(Lens::new(LensParameters {
            width,
            height,
            fx: f,
            fy: f,
            cx: circle_centre_px.x,
            cy: circle_centre_px.y,
            k: [0.0; 4],
            field_of_view_rad,
        })?)
    }
}

/// How views are judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensFitOptions {
    /// A view is dropped if its RMS residual exceeds the median of all views by more than this factor, or if
    /// the residual of one of its corners exceeds the median of all corners by more than five times this
    /// factor. The worst view is dropped first, and the lens is fitted again after each. Infinity keeps all.
    /// In good sets, views stay below a factor of 1.8 and corners below 8.
    pub drop_factor: f64,
}

impl Default for LensFitOptions {
    fn default() -> Self {
        Self { drop_factor: 2.5 }
    }
}

/// Fewest views: two flat views suffice in theory, but then noise dominates.
pub(crate) const VIEWS_MIN: usize = 3;

/// Fewest corners of a view: four determine its pose but contribute nothing to the lens.
const CORNERS_MIN: usize = 6;

/// Fits lens and poses to the corners and drops views that do not fit, each with its reason.
///
/// # Errors
/// `Usage` for a start that is no lens, and for numbers that are not finite, naming view and corner.
/// `Failed`, saying what to do: fewer than three usable views, or fewer than half of them that agree; views
/// that do not determine the lens; coefficients with which r(theta) stops increasing between the corners.
pub fn fit_lens(views: &[BoardView], start: &LensStart, options: &LensFitOptions) -> Result<LensFit> {
    let start_lens = start.lens()?;
    check_numbers(views)?;
    if options.drop_factor.is_nan() || options.drop_factor <= 1.0 {
        return Err(Error::usage("must be over 1, for some views are always worse than the median")
            .at(Place::value("drop_factor", options.drop_factor)));
    }
    let found = search::search(views, &start_lens, options)?;
    outcome::outcome(views, start, found)
}

fn check_numbers(views: &[BoardView]) -> Result<()> {
    for view in views {
        for (index, corner) in view.corners.iter().enumerate() {
            if !(corner.board_m.is_finite() && corner.pixel.is_finite()) {
                return Err(Error::usage(format!(
                    "board {} m, pixel {}: not finite; leave out corners that were not found",
                    corner.board_m, corner.pixel
                ))
                .at(format_args!("corner {}", index + 1))
                .at(format_args!("view {}", view.name)));
            }
        }
    }
    Ok(())
}

/// Why a view cannot be used at all.
fn unusable(view: &BoardView) -> Option<String> {
    let count = view.corners.len();
    if count < CORNERS_MIN {
        return Some(format!("{count} corners, at least {CORNERS_MIN} are needed"));
    }
    if is_line(view.corners.iter().map(|corner| corner.board_m)) {
        return Some("its corners lie on one line of the board; show more of the board".to_owned());
    }
    if is_line(view.corners.iter().map(|corner| corner.pixel)) {
        return Some("its corners lie on one line of the picture; tilt the board less".to_owned());
    }
    None
}

/// Whether the spread of the points across their main direction is less than a thousandth of that along it.
fn is_line(points: impl Iterator<Item = DVec2> + Clone) -> bool {
    let count = points.clone().count().max(1) as f64;
    let middle = points.clone().sum::<DVec2>() / count;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for point in points {
        let d = point - middle;
        (xx, xy, yy) = (xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y);
    }
    // Eigenvalues of the covariance; the smaller one from the determinant, without cancellation.
    let larger = 0.5 * (xx + yy) + (0.25 * (xx - yy).powi(2) + xy * xy).sqrt();
    let smaller = (xx * yy - xy * xy) / larger;
    // 0 / 0 where all are the same point.
    smaller.is_nan() || smaller <= 1e-6 * larger
}
