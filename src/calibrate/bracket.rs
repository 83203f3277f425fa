//! The response of an ordinary camera from pictures of one still scene at several exposures.
//!
//! After Debevec and Malik 1997, *Recovering High Dynamic Range Radiance Maps from Photographs*: the
//! logarithm of the exposure that a code stands for, `g(code) = ln E + ln t`, follows by least squares from
//! the codes of the same positions in several pictures, where the scene's radiances E are eliminated. The
//! method here differs in three points, which real pictures made necessary:
//!
//! - Where all steps of the bracket have the same ratio, g is determined only up to a function that is
//!   periodic in that ratio, and one unknown per code with a little smoothing produces staircases. Here g is
//!   `c ln(code - black + 1/2)` plus a polynomial of the code (which Mitsunaga and Nayar 1999 use for the
//!   radiance): it can represent straight lines, gamma curves, logarithms and the S-curves of photographs,
//!   but no staircases. Its degree is the smallest of 1 to 6 whose misfit is within 10 % of the best, among
//!   those that rise everywhere. Beyond the observed codes, g is extrapolated as a power of the code.
//! - The samples are means over blocks without edges, which have less noise than pixels and also fractional
//!   codes. Every code has the same weight, however often it occurs in the picture; residuals are weighted by
//!   the error of a code at the slope of g, and large ones (things that moved) count linearly (Huber).
//! - All channels share one curve. Cameras apply the same curve to each channel after white balance.
//!
//! Pictures alone determine exposure ratios only up to a power (Grossberg and Nayar 2003), so times or a
//! response must be known. But one picture's time follows from those of the others:
//! [`BracketFit::recovered_s`].

mod curve;
mod samples;
mod solver;
#[cfg(test)]
mod tests;

use crate::error::{Error, Result};
use curve::Curve;
use lightcast_core::camera::{Response, ResponseModel};
pub use samples::BracketSamples;
use solver::{Solution, solve};

/// Limits beyond which codes carry no information, where they are known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CodeLimits {
    /// Code without light; 0 if `None`.
    pub black_code: Option<u16>,
    /// Code from which pixels are saturated; if `None` the largest code of 8, 10, 12, 14 or 16 bits that
    /// holds all codes seen.
    pub saturation_code: Option<u16>,
}

/// The response of a bracket.
#[derive(Clone, Debug, PartialEq)]
pub struct BracketFit {
    /// Maps codes to radiance times seconds, that is, radiance at an exposure of 1 s; relative, 1 at the
    /// middle code. Piecewise linear with up to 256 knees.
    pub response: Response,
    /// Degree of the polynomial.
    pub degree: usize,
    /// Number of samples that the curve was fitted to; each channel of a block is one.
    pub samples: usize,
    /// Smallest and largest code among them.
    pub codes_seen: (f64, f64),
    /// For every picture the RMS deviation of its samples from the radiances found from all pictures, in
    /// stops.
    pub misfit_stops: Vec<f64>,
    /// For every picture its exposure time as determined from the pictures and the times of all others, 0
    /// where they do not determine it; empty for two pictures, where nothing would be left to compare with.
    pub recovered_s: Vec<f64>,
}

/// Most knees of the response.
const MOST_KNEES: usize = 256;
const LARGEST_DEGREE: usize = 6;
/// A degree is too low if its misfit exceeds the smallest by this factor.
const WORTH_A_DEGREE: f64 = 1.1;
/// Fewest samples that two neighbouring exposures must have in common.
const FEWEST_SHARED: usize = 50;

/// Finds the response from pictures and their exposure times, in s.
///
/// # Errors
/// `Usage`, saying what to do: fewer than two pictures, times that are not positive, not distinct or not as
/// many as pictures, neighbouring exposures without enough unclipped samples in common, limits in the wrong
/// order, and pictures that contradict their times.
pub fn fit_bracket(samples: &BracketSamples, times_s: &[f64], limits: &CodeLimits) -> Result<BracketFit> {
    check_times(samples.pictures(), times_s)?;
    let (black, saturation) = samples.limits(limits)?;
    let log_times: Vec<f64> = times_s.iter().map(|time| time.ln()).collect();
    let mut by_time: Vec<usize> = (0..times_s.len()).collect();
    by_time.sort_by(|&one, &two| times_s[two].total_cmp(&times_s[one]));
    check_overlap(samples, &by_time, black, saturation)?;
    let places = samples.places(black, saturation);

    let mut found: Vec<(usize, Solution)> = Vec::new();
    for degree in 1..=LARGEST_DEGREE {
        let Some(solution) = solve(&places, Curve::new(black, saturation, degree), &log_times, None) else {
            continue;
        };
        if solution.curve.is_rising(places.codes_seen()) {
            found.push((degree, solution));
        }
    }
    let least = found.iter().map(|(_, solution)| solution.misfit).fold(f64::INFINITY, f64::min);
    let chosen = found.into_iter().find(|(_, solution)| solution.misfit <= least * WORTH_A_DEGREE);
    let Some((degree, Solution { curve, misfit_by_picture, .. })) = chosen else {
        return Err(Error::usage(
            "no curve that rises from black to saturation explains the pictures; check that the exposure times belong \
             to the pictures and that neither camera nor scene moved",
        ));
    };
    let recovered_s = if times_s.len() < 3 {
        Vec::new()
    } else {
        (0..times_s.len())
            .map(|free| {
                let start = Curve::new(black, saturation, degree);
                let found = solve(&places, start, &log_times, Some(free));
                found.map(|with| with.free_log_time.exp()).filter(|time| time.is_finite()).unwrap_or(0.0)
            })
            .collect()
    };
    Ok(BracketFit {
        response: response(&curve, places.codes_seen(), black, saturation)?,
        degree,
        samples: places.len(),
        codes_seen: places.codes_seen(),
        misfit_stops: misfit_by_picture.iter().map(|nats| nats / std::f64::consts::LN_2).collect(),
        recovered_s,
    })
}

/// Finds the exposure times from the pictures alone where the response is known, relative to the first
/// picture's (1).
///
/// # Errors
/// `Usage`: fewer than two pictures, the identity as response, and pictures without enough unclipped samples
/// in common.
pub fn recover_exposures(samples: &BracketSamples, response: &Response) -> Result<Vec<f64>> {
    check_count(samples.pictures())?;
    if response.is_identity() {
        return Err(Error::usage(
            "exposure times cannot be found without a response; give the times, or a calibration with a response",
        ));
    }
    let (black, saturation) = (response.black_clip_code(), response.saturation_code());
    let mut by_brightness: Vec<usize> = (0..samples.pictures()).collect();
    by_brightness.sort_by(|&one, &two| samples.mean(two).total_cmp(&samples.mean(one)));
    check_overlap(samples, &by_brightness, black, saturation)?;
    let mut times = vec![1.0; samples.pictures()];
    for pair in by_brightness.windows(2) {
        let mut ratios: Vec<f64> = samples
            .shared(pair[0], pair[1], black, saturation)
            .map(|(one, two)| radiance(response, two) / radiance(response, one))
            .filter(|ratio| ratio.is_finite() && *ratio > 0.0)
            .collect();
        ratios.sort_by(f64::total_cmp);
        let Some(&median) = ratios.get(ratios.len() / 2) else { return Err(no_overlap(pair[0], pair[1], 0)) };
        times[pair[1]] = times[pair[0]] * median;
    }
    let first = times[0];
    Ok(times.iter().map(|time| time / first).collect())
}

/// Radiance of a fractional code, interpolated in the table.
fn radiance(response: &Response, code: f64) -> f64 {
    let table = response.table();
    let below = (code as usize).min(table.len() - 2);
    let (from, to) = (f64::from(table[below]), f64::from(table[below + 1]));
    from + (code - below as f64) * (to - from)
}

fn check_count(pictures: usize) -> Result<()> {
    if pictures < 2 {
        return Err(Error::usage(format!(
            "a bracket of {pictures} picture tells no response: take at least two, better five or more, of a still \
             scene at exposure times that differ by a factor of 2 to 8"
        )));
    }
    Ok(())
}

fn check_times(pictures: usize, times_s: &[f64]) -> Result<()> {
    check_count(pictures)?;
    if times_s.len() != pictures {
        return Err(Error::usage(format!(
            "there are {} exposure times for {pictures} pictures; give one for each",
            times_s.len()
        )));
    }
    if let Some(time) = times_s.iter().find(|time| !(time.is_finite() && **time > 0.0)) {
        return Err(Error::usage(format!("exposure time {time} s must be a positive number")));
    }
    let (low, high) =
        times_s.iter().fold((f64::MAX, 0.0f64), |(low, high), &time| (low.min(time), high.max(time)));
    if high < low * 1.1 {
        return Err(Error::usage(
            "all pictures have nearly the same exposure time, which tells no response; vary it by a factor of 2 to 8",
        ));
    }
    Ok(())
}

/// Checks that neighbouring exposures share samples that neither clips.
fn check_overlap(samples: &BracketSamples, order: &[usize], black: u16, saturation: u16) -> Result<()> {
    for pair in order.windows(2) {
        let shared = samples.shared(pair[0], pair[1], black, saturation).take(FEWEST_SHARED).count();
        if shared < FEWEST_SHARED {
            return Err(no_overlap(pair[0], pair[1], shared));
        }
    }
    Ok(())
}

fn no_overlap(one: usize, two: usize, shared: usize) -> Error {
    Error::usage(format!(
        "pictures {} and {}, neighbours in exposure, have {shared} blocks in common that are neither clipped nor uneven \
         in either, at least {FEWEST_SHARED} are needed; take pictures at exposures between them, of a scene with smooth \
         surfaces from dark to bright",
        one + 1,
        two + 1
    ))
}

fn response(curve: &Curve, codes_seen: (f64, f64), black: u16, saturation: u16) -> Result<Response> {
    let range = usize::from(saturation - black);
    let knees = (range + 1).min(MOST_KNEES);
    let middle = curve.continued(f64::from(black) + range as f64 / 2.0, codes_seen);
    let knees = (0..knees)
        .map(|at| {
            let code = black + ((at * range) as f64 / (knees - 1) as f64).round() as u16;
            (code, (curve.continued(f64::from(code), codes_seen) - middle).exp())
        })
        .collect();
    Ok(Response::new(ResponseModel::PiecewiseLinear { knees })?)
}
