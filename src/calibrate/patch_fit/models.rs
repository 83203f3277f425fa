use super::{Family, PatchFitOptions, PatchUse};
use crate::calibrate::Patch;
use crate::calibrate::normal_equations::NormalEquations;
use crate::error::{Error, Result};
use lightcast_core::camera::ResponseModel;

/// A patch as the fit sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) code: f64,
    pub(super) luminance: f64,
    /// Variance of its pixels, in codes squared.
    variance: f64,
}

impl Point {
    pub(super) fn of(patch: &Patch) -> Self {
        let variance = patch.codes.spread().powi(2);
        Self { code: patch.codes.mean(), luminance: patch.luminance_cd_m2, variance }
    }
}

/// Where the sensor clips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    black: u16,
    saturation: u16,
    is_black_given: bool,
}

/// Fraction of clipped samples from which a patch counts as clipped.
const CLIPPED_SHARE: f64 = 0.01;
/// Luminance ratio from which equal codes indicate clipping.
const TELLING_RATIO: f64 = 1.25;
/// Relative uncertainty of luminances.
const LUMINANCE_ERROR: f64 = 0.02;
/// Iterations of slope and weights; they converge in three.
const TURNS: usize = 6;

impl Limits {
    pub(super) fn find(patches: &[Patch], options: &PatchFitOptions) -> Result<Self> {
        let largest = patches.iter().map(|patch| patch.codes.max()).max().unwrap_or(0);
        // 8, 10, 12, 14 or 16 bits.
        let all_ones = (8..16).step_by(2).map(|bits| (1u16 << bits) - 1).find(|&top| top >= largest);
        let mut sorted: Vec<&Patch> = patches.iter().collect();
        sorted.sort_by(|one, two| one.luminance_cd_m2.total_cmp(&two.luminance_cd_m2));
        let saturation = options.saturation_code.or_else(|| {
            let (code, spread) = plateau(sorted.iter().rev().copied())?;
            Some((code - 3.0 * spread - 0.5).floor().max(1.0) as u16)
        });
        let black = options.black_code.or_else(|| {
            let (code, spread) = plateau(sorted.iter().copied())?;
            Some((code + 3.0 * spread + 0.5).ceil().min(65_534.0) as u16)
        });
        let saturation = saturation.unwrap_or(all_ones.unwrap_or(u16::MAX));
        let limits =
            Self { black: black.unwrap_or(0), saturation, is_black_given: options.black_code.is_some() };
        if limits.black >= limits.saturation {
            return Err(Error::usage(format!(
                "no patch lies between black at code {} and saturation at code {}: all have one code, or the codes \
                 given as black and saturation are the wrong way round; change exposure or light",
                limits.black, limits.saturation
            )));
        }
        Ok(limits)
    }

    pub(super) fn usage(&self, patch: &Patch) -> PatchUse {
        if patch.codes.share_from(self.saturation) >= CLIPPED_SHARE {
            PatchUse::Saturated
        } else if patch.codes.share_to(self.black) >= CLIPPED_SHARE && !self.is_linear_foot(patch) {
            PatchUse::BlackClipped
        } else if patch.is_held_out {
            PatchUse::HeldOut
        } else {
            PatchUse::Fitted
        }
    }

    /// Noise drives some pixels of a dark patch to the black code; the patch is still usable when its mean is
    /// clearly above that code.
    fn is_linear_foot(&self, patch: &Patch) -> bool {
        patch.codes.mean() > f64::from(self.black) + 2.0 * patch.codes.spread() + 1.0
    }
}

/// Mean and spread of the codes of patches from one end, if the first two or more of them have the same code
/// although their luminances differ.
fn plateau<'a>(from_the_end: impl Iterator<Item = &'a Patch>) -> Option<(f64, f64)> {
    let mut patches = from_the_end;
    let first = patches.next()?;
    let (code, spread) = (first.codes.mean(), first.codes.spread());
    let tolerance = 1.0 + 3.0 * spread / (first.codes.samples().max(1) as f64).sqrt();
    let last = patches.take_while(|patch| (patch.codes.mean() - code).abs() <= tolerance).last()?;
    let ratio = last.luminance_cd_m2 / first.luminance_cd_m2;
    (ratio.max(1.0 / ratio) >= TELLING_RATIO).then_some((code, spread))
}

/// Fits one model.
pub(super) fn fit(
    family: Family,
    points: &[Point],
    limits: &Limits,
    knee_codes: &[u16],
) -> Result<ResponseModel> {
    match family {
        Family::Logarithmic => {
            let (a, b) = line(points, None, f64::ln, |slope, _| slope)?;
            let Limits { black, saturation, .. } = *limits;
            Ok(ResponseModel::Logarithmic { a, b, black_clip_code: black, saturation_code: saturation })
        }
        Family::Linear => {
            let slope_of = |slope: f64, luminance: f64| slope * luminance;
            let black_level = if limits.is_black_given {
                limits.black
            } else {
                let (black, _) = line(points, None, |luminance| luminance, slope_of)?;
                black.round().clamp(0.0, f64::from(limits.saturation) - 1.0) as u16
            };
            // The slope is fitted again, because the black level is rounded to an integer.
            let (_, slope) = line(points, Some(f64::from(black_level)), |luminance| luminance, slope_of)?;
            Ok(ResponseModel::Linear { black_level, white_level: limits.saturation, gain: 1.0 / slope })
        }
        Family::PiecewiseLinear if knee_codes.is_empty() => through_patches(points, limits),
        Family::PiecewiseLinear => between_knees(points, limits, knee_codes),
    }
}

/// `code = intercept + slope x(L)` by weighted least squares; `code_slope(slope, L)` is the change of code
/// per ln L.
fn line(
    points: &[Point],
    intercept: Option<f64>,
    x: impl Fn(f64) -> f64,
    code_slope: impl Fn(f64, f64) -> f64,
) -> Result<(f64, f64)> {
    let flat = || {
        Error::usage(
            "the codes of the patches do not rise with their luminances; check that rectangles and luminances belong \
             together",
        )
    };
    let mut found = (intercept.unwrap_or(0.0), 0.0);
    for _ in 0..TURNS {
        let mut equations = NormalEquations::new(if intercept.is_some() { 1 } else { 2 });
        for point in points {
            let of_luminance = LUMINANCE_ERROR * code_slope(found.1, point.luminance);
            let weight = 1.0 / (1.0 + point.variance + of_luminance * of_luminance);
            match intercept {
                Some(code) => equations.add(&[x(point.luminance)], point.code - code, weight),
                None => equations.add(&[x(point.luminance), 1.0], point.code, weight),
            }
        }
        let solution = equations.solve().ok_or_else(flat)?;
        found = (intercept.unwrap_or_else(|| solution[1]), solution[0]);
    }
    if found.1 > 0.0 { Ok(found) } else { Err(flat()) }
}

/// Knees at the patches; the first and the last line are extended to zero light and to saturation.
fn through_patches(points: &[Point], limits: &Limits) -> Result<ResponseModel> {
    let mut sorted: Vec<(f64, f64)> = points.iter().map(|point| (point.code, point.luminance)).collect();
    sorted.sort_by(|one, two| one.1.total_cmp(&two.1));
    if sorted.len() < 2 || sorted.windows(2).any(|pair| pair[1].0 - pair[0].0 < 1.0 || pair[0].1 >= pair[1].1)
    {
        return Err(Error::usage(
            "a knee at every patch needs codes that rise by one or more from each patch to the next brighter one; \
             leave out patches that are nearly alike",
        ));
    }
    let at = |code: f64| {
        let next = sorted.partition_point(|knee| knee.0 <= code).clamp(1, sorted.len() - 1);
        let (from, to) = (sorted[next - 1], sorted[next]);
        from.1 + (code - from.0) / (to.0 - from.0) * (to.1 - from.1)
    };
    let (first, second) = (sorted[0], sorted[1]);
    let dark = first.0 - first.1 * (second.0 - first.0) / (second.1 - first.1);
    let dark = dark.ceil().max(f64::from(limits.black));
    let inner = sorted.iter().map(|knee| knee.0.round());
    let mut codes: Vec<f64> = std::iter::once(dark).chain(inner).collect();
    codes.push(f64::from(limits.saturation));
    codes.retain(|code| (dark..=f64::from(limits.saturation)).contains(code));
    codes.dedup();
    Ok(ResponseModel::PiecewiseLinear {
        knees: codes.iter().map(|&code| (code as u16, at(code).max(0.0))).collect(),
    })
}

/// Radiances at given knees by least squares of relative errors; zero at black.
fn between_knees(points: &[Point], limits: &Limits, knee_codes: &[u16]) -> Result<ResponseModel> {
    let mut codes = vec![limits.black];
    codes.extend(knee_codes);
    codes.push(limits.saturation);
    if codes.windows(2).any(|pair| pair[0] >= pair[1]) {
        return Err(Error::usage(format!(
            "the knees {knee_codes:?} must increase between black at code {} and saturation at code {}",
            limits.black, limits.saturation
        )));
    }
    let mut equations = NormalEquations::new(codes.len() - 1);
    for point in points {
        let next = codes.partition_point(|&code| f64::from(code) <= point.code).clamp(1, codes.len() - 1);
        let (from, to) = (f64::from(codes[next - 1]), f64::from(codes[next]));
        let share = (point.code - from) / (to - from);
        let mut row = vec![0.0; codes.len() - 1];
        row[next - 1] = share;
        if next >= 2 {
            row[next - 2] = 1.0 - share;
        }
        equations.add(&row, point.luminance, point.luminance.powi(-2));
    }
    let mut knees = vec![(limits.black, 0.0)];
    match equations.solve() {
        Some(found) => knees.extend(codes[1..].iter().copied().zip(found)),
        None => {
            return Err(Error::usage(format!(
                "the patches do not tell the luminances of the knees {knee_codes:?}; there must be a patch between any \
                 two knees, and one below the first and above the last"
            )));
        }
    }
    if knees.windows(2).any(|pair| pair[0].1 >= pair[1].1) {
        return Err(Error::usage(format!(
            "the knees {knee_codes:?} do not suit the patches: luminance would fall from one to the next; check the \
             knees"
        )));
    }
    Ok(ResponseModel::PiecewiseLinear { knees })
}
