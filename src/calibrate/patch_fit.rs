//! The response from grey patches of known luminance: METHODS section 2, and Havran et al. 2005, who used six
//! patches and held out two of them.
//!
//! ****Clipped patches** are found first and excluded. Where the clip codes are not given, a patch is
//! saturated if 1 % of its samples have the largest code of the smallest bit depth that holds all observed
//! codes (255, 1023, 4095, ...). The brightest patches are saturated as well if two or more of them, a
//! quarter or more apart in luminance, have the same code up to noise; the saturation code is then three
//! standard deviations below it. The dark end is treated in the same way.
//!
//! **Fit.** Least squares in codes. The variance of a patch is that of one code, plus that of its pixels
//! (noise, uneven paint), plus that of a luminance known to 2 %, at the slope of the model; the slope and the
//! weights are therefore found iteratively.
//!
//! ****Choice of model**, where the user names none: the one that predicts each patch best from the others
//! (leave-one-out, RMS in stops). A piecewise linear model must be twice as good as the better of the other
//! two, since it can fit anything, and needs five patches.

mod models;
#[cfg(test)]
mod tests;

use super::Patch;
use crate::error::{Error, Result};
use lightcast_core::camera::{Response, ResponseModel};
use models::{Limits, Point};

/// The models that can be fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// `code = a + b ln L`.
    Logarithmic,
    /// `code = black + L / gain`.
    Linear,
    /// Straight lines between knees: the given ones, or one at every patch.
    PiecewiseLinear,
}

/// Options of the fit, and what is known beforehand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PatchFitOptions {
    /// The model; `None` takes the one that predicts best.
    pub family: Option<Family>,
    /// Codes of the knees of a piecewise linear response between black and saturation, strictly increasing.
    /// There must be a patch between any two.
    pub knee_codes: Vec<u16>,
    /// Code without light; pixels up to this code are clipped at black.
    pub black_code: Option<u16>,
    /// Code from which pixels are saturated.
    pub saturation_code: Option<u16>,
}

/// How a patch was used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PatchUse {
    /// The response was fitted to it.
    Fitted,
    /// Held out on request.
    HeldOut,
    /// Too bright for the sensor.
    Saturated,
    /// Too dark for the sensor.
    BlackClipped,
}

/// A patch compared with the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchResult {
    /// How it was used.
    pub usage: PatchUse,
    /// Its luminance as given.
    pub luminance_cd_m2: f64,
    /// Its mean code.
    pub code: f64,
    /// Standard deviation of its codes.
    pub spread: f64,
    /// Luminance of the mean code by the response; `None` for clipped patches.
    pub fitted_cd_m2: Option<f64>,
    /// The same from a response fitted without this patch; `None` for clipped patches, and where too few
    /// patches are left.
    pub left_out_cd_m2: Option<f64>,
}

/// A response and how well it fits.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchFit {
    /// Codes to luminance in cd/m2.
    pub response: Response,
    /// Its model.
    pub family: Family,
    /// RMS in stops of each patch's luminance as predicted from the others, for every model that was tried;
    /// infinite where the model cannot be fitted.
    pub tried: Vec<(Family, f64)>,
    /// The patches, in the given order.
    pub patches: Vec<PatchResult>,
}

/// Fewest patches that are neither clipped nor held out.
const FEWEST_PATCHES: usize = 3;
/// Fewest of them for a piecewise linear model that the user did not request.
const FEWEST_FOR_PIECES: usize = 5;
/// Factor by which a piecewise linear model must predict better.
const PIECES_MUST_WIN_BY: f64 = 2.0;
/// Smallest ratio of the brightest to the darkest patch that determines a slope.
const SMALLEST_RATIO: f64 = 1.1;

/// Stops by which `found` lies above `luminance`.
pub(super) fn stops(found: f64, luminance: f64) -> f64 {
    // A prediction of zero or negative luminance counts as an error larger than any sensor's range.
    if found > 0.0 { (found / luminance).log2() } else { -32.0 }
}

/// Finds the response.
///
/// # Errors
/// `Usage`, saying what to do: luminances that are not positive numbers, fewer than three patches that are
/// neither clipped nor held out, all of the same luminance, codes that do not rise with luminance, knees
/// without patches between them, clip codes in the wrong order.
pub fn fit_patches(patches: &[Patch], options: &PatchFitOptions) -> Result<PatchFit> {
    if let Some(patch) = patches.iter().find(|p| !(p.luminance_cd_m2.is_finite() && p.luminance_cd_m2 > 0.0))
    {
        return Err(Error::usage(format!(
            "a patch has the luminance {} cd/m2; measure it, it must be a positive number",
            patch.luminance_cd_m2
        )));
    }
    let limits = Limits::find(patches, options)?;
    let usage: Vec<PatchUse> = patches.iter().map(|patch| limits.usage(patch)).collect();
    let points: Vec<Point> = patches.iter().map(Point::of).collect();
    let fitted: Vec<Point> =
        points.iter().zip(&usage).filter(|(_, usage)| **usage == PatchUse::Fitted).map(|(p, _)| *p).collect();
    check(&fitted, &usage)?;

    let families = match options.family {
        Some(family) => vec![family],
        None if !options.knee_codes.is_empty() => vec![Family::PiecewiseLinear],
        None if fitted.len() < FEWEST_FOR_PIECES => vec![Family::Logarithmic, Family::Linear],
        None => vec![Family::Logarithmic, Family::Linear, Family::PiecewiseLinear],
    };
    let fit = |family: Family, points: &[Point]| -> Result<ResponseModel> {
        let model = models::fit(family, points, &limits, &options.knee_codes)?;
        Response::new(model.clone())?;
        Ok(model)
    };
    let without = |family: Family, left_out: &Point| -> Option<f64> {
        let others: Vec<Point> = fitted.iter().filter(|point| *point != left_out).copied().collect();
        fit(family, &others).ok().map(|model| model.radiance(left_out.code))
    };
    let tried: Vec<(Family, f64)> = families
        .iter()
        .map(|&family| {
            let errors = fitted
                .iter()
                .map(|point| without(family, point).map(|found| stops(found, point.luminance).powi(2)));
            let sum: Option<f64> = errors.sum();
            (family, sum.map_or(f64::INFINITY, |sum| (sum / fitted.len() as f64).sqrt()))
        })
        .collect();
    let family = best(&tried);
    let model = fit(family, &fitted)?;
    let results = patches
        .iter()
        .zip(&points)
        .zip(usage)
        .map(|((patch, point), usage)| {
            let is_seen = matches!(usage, PatchUse::Fitted | PatchUse::HeldOut);
            let fitted_cd_m2 = is_seen.then(|| model.radiance(point.code));
            PatchResult {
                usage,
                luminance_cd_m2: patch.luminance_cd_m2,
                code: point.code,
                spread: patch.codes.spread(),
                fitted_cd_m2,
                left_out_cd_m2: match usage {
                    PatchUse::Fitted => without(family, point),
                    _ => fitted_cd_m2,
                },
            }
        })
        .collect();
    Ok(PatchFit { response: Response::new(model)?, family, tried, patches: results })
}

/// The model with the smallest error, with a handicap for the piecewise linear one.
fn best(tried: &[(Family, f64)]) -> Family {
    let cost = |&(family, error): &(Family, f64)| {
        error * if family == Family::PiecewiseLinear { PIECES_MUST_WIN_BY } else { 1.0 }
    };
    tried.iter().min_by(|one, two| cost(one).total_cmp(&cost(two))).map_or(Family::Linear, |best| best.0)
}

fn check(fitted: &[Point], usage: &[PatchUse]) -> Result<()> {
    let count = |which: PatchUse| usage.iter().filter(|usage| **usage == which).count();
    if fitted.len() < FEWEST_PATCHES {
        return Err(Error::usage(format!(
            "{} of {} patches can be fitted, at least {FEWEST_PATCHES} are needed ({} saturated, {} clipped at black, \
             {} held out); add patches between black and saturation, or change exposure or light",
            fitted.len(),
            usage.len(),
            count(PatchUse::Saturated),
            count(PatchUse::BlackClipped),
            count(PatchUse::HeldOut),
        )));
    }
    let luminances = fitted.iter().map(|point| point.luminance);
    let (low, high) = luminances.fold((f64::MAX, 0.0f64), |(low, high), l| (low.min(l), high.max(l)));
    if high < low * SMALLEST_RATIO {
        return Err(Error::usage(format!(
            "all patches that can be fitted have nearly the same luminance ({low} to {high} cd/m2), which tells no \
             slope; take patches from dark to bright"
        )));
    }
    Ok(())
}
