use super::{Arguments, Found, Taken, curve, digits};
use crate::calibrate::{
    Family, Patch, PatchCodes, PatchFit, PatchFitOptions, PatchUse, Rectangle, fit_patches,
};
use crate::error::{Error, Place, Result, TomlText};
use crate::picture::{Panel, Plot, Series};
use lightcast_core::camera::ResponseModel;
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    patch: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    picture: Option<String>,
    rectangle: [usize; 4],
    luminance_cd_m2: f64,
    #[serde(default)]
    held_out: bool,
}

/// Difference of channels, as a part of the code, from which on a patch is not grey.
const GREY: f64 = 0.03;
const CURVE_POINTS: usize = 33;

pub(super) fn find(arguments: &Arguments, inputs: &[Taken], file: &Path) -> Result<Found> {
    let text = TomlText::load(file)?;
    let File { patch: entries } = text.parse()?;
    let mut codes = vec![PatchCodes::default(); entries.len()];
    let owners = entries
        .iter()
        .enumerate()
        .map(|(index, entry)| {
            owner(inputs, entry)
                .map_err(|error| text.locate("", error.at(Place::key(format!("patch[{index}].picture")))))
        })
        .collect::<Result<Vec<usize>>>()?;
    for (number, input) in inputs.iter().enumerate().filter(|(number, _)| owners.contains(number)) {
        input.for_each(|frame, name| {
            for (index, entry) in entries.iter().enumerate().filter(|(index, _)| owners[*index] == number) {
                let [x, y, width, height] = entry.rectangle;
                codes[index].add(frame, Rectangle { x, y, width, height }).map_err(|error| {
                    let key = Place::key(format!("patch[{index}].rectangle"));
                    text.locate("", error.at(name).at(key))
                })?;
            }
            Ok(())
        })?;
    }
    let patches: Vec<Patch> = entries
        .iter()
        .zip(codes)
        .map(|(entry, codes)| Patch {
            luminance_cd_m2: entry.luminance_cd_m2,
            codes,
            is_held_out: entry.held_out,
        })
        .collect();
    for (index, patch) in patches.iter().enumerate() {
        let difference = patch.codes.channel_difference() / patch.codes.mean().max(1.0);
        if difference > GREY {
            tracing::warn!(
                "patch {index}: its channels differ by {:.0} %; one response serves all channels, so set the white \
                 balance to this light",
                100.0 * difference
            );
        }
    }
    let options = PatchFitOptions {
        family: arguments.model.map(Family::from),
        knee_codes: arguments.knees.clone(),
        black_code: arguments.black,
        saturation_code: arguments.saturation,
    };
    let fit = fit_patches(&patches, &options).map_err(|error| error.at(file))?;
    Ok(Found { lines: lines(&fit), plot: plot(&fit), response: fit.response })
}

/// Which of the inputs a patch lies in.
fn owner(inputs: &[Taken], entry: &Entry) -> Result<usize> {
    let Some(name) = &entry.picture else {
        return if inputs.len() == 1 {
            Ok(0)
        } else {
            Err(Error::usage("is missing; say in which of the pictures the patch lies"))
        };
    };
    let is_it = |input: &Taken| {
        input.path.as_os_str() == name.as_str()
            || input.path.file_name().is_some_and(|file| file == name.as_str())
    };
    match inputs.iter().filter(|input| is_it(input)).count() {
        1 => Ok(inputs.iter().position(is_it).unwrap_or(0)),
        count => Err(Error::usage(format!(
            "{count} of the pictures on the command line have the name {name}, it must be one"
        ))),
    }
}

fn lines(fit: &PatchFit) -> Vec<String> {
    let mut lines = vec![format!("response: {}", describe(fit.response.model()))];
    lines.push(format!(
        "black up to code {}, saturated from code {}",
        fit.response.black_clip_code(),
        fit.response.saturation_code()
    ));
    for (family, error) in &fit.tried {
        let chosen = if *family == fit.family { ", taken" } else { "" };
        lines.push(format!("{}: each patch from the others {error:.4} stops RMS{chosen}", name(*family)));
    }
    lines.push(format!(
        "{:>5} {:>12} {:>10} {:>8} {:>12} {:>18} {:>24}  {}",
        "patch", "cd/m2", "code", "+-", "fitted", "off by", "from the others", "use"
    ));
    for (index, patch) in fit.patches.iter().enumerate() {
        let off = |found: Option<f64>| match found {
            Some(found) if found > 0.0 => {
                let ratio = found / patch.luminance_cd_m2;
                format!("{:+.4} stops {:+.2} %", ratio.log2(), 100.0 * (ratio - 1.0))
            }
            Some(_) => "no light".to_owned(),
            None => "-".to_owned(),
        };
        lines.push(format!(
            "{index:>5} {:>12} {:>10.2} {:>8.2} {:>12} {:>18} {:>24}  {}",
            digits(patch.luminance_cd_m2),
            patch.code,
            patch.spread,
            patch.fitted_cd_m2.map_or("-".to_owned(), digits),
            off(patch.fitted_cd_m2),
            off(patch.left_out_cd_m2),
            match patch.usage {
                PatchUse::Fitted => "fitted",
                PatchUse::HeldOut => "held out",
                PatchUse::Saturated => "saturated",
                PatchUse::BlackClipped => "clipped at black",
            },
        ));
    }
    lines
}

fn name(family: Family) -> &'static str {
    match family {
        Family::Logarithmic => "logarithmic",
        Family::Linear => "linear",
        Family::PiecewiseLinear => "piecewise linear",
    }
}

fn describe(model: &ResponseModel) -> String {
    match model {
        ResponseModel::Identity => "identity".to_owned(),
        ResponseModel::Logarithmic { a, b, .. } => format!("logarithmic, code = {a:.3} + {b:.4} ln L"),
        ResponseModel::Linear { black_level, gain, .. } => {
            format!("linear, L = {gain:.6e} (code - {black_level})")
        }
        ResponseModel::PiecewiseLinear { knees } => format!("piecewise linear, {} knees", knees.len()),
    }
}

/// The curve with the patches, and by how much they are off.
fn plot(fit: &PatchFit) -> Plot {
    // A gap after every patch, so that no line joins them.
    let apart = |points: Vec<(f64, f64)>| -> Vec<(f64, f64)> {
        points.into_iter().flat_map(|point| [point, (f64::NAN, f64::NAN)]).collect()
    };
    let of = |usages: &[PatchUse]| -> Vec<(f64, f64)> {
        let chosen = fit.patches.iter().filter(|patch| usages.contains(&patch.usage));
        apart(chosen.map(|patch| (patch.luminance_cd_m2, patch.code)).collect())
    };
    let off = |found: fn(&crate::calibrate::PatchResult) -> Option<f64>, usage: PatchUse| {
        let chosen = fit.patches.iter().filter(|patch| patch.usage == usage);
        let points = chosen.filter_map(|patch| {
            let ratio = found(patch)? / patch.luminance_cd_m2;
            Some((patch.luminance_cd_m2, 100.0 * (ratio - 1.0).abs()))
        });
        apart(points.collect())
    };
    let series = |name: &str, points| Series { name: name.to_owned(), points };
    Plot {
        title: format!("Response: {}", describe(fit.response.model())),
        panels: vec![
            Panel {
                title: "curve".to_owned(),
                x_label: "luminance, cd/m2".to_owned(),
                y_label: "code".to_owned(),
                series: vec![
                    series("response", curve(&fit.response, CURVE_POINTS)),
                    series("fitted", of(&[PatchUse::Fitted])),
                    series("held out", of(&[PatchUse::HeldOut])),
                    series("clipped", of(&[PatchUse::Saturated, PatchUse::BlackClipped])),
                ],
                ..Panel::default()
            },
            Panel {
                title: "deviation of the luminance".to_owned(),
                x_label: "luminance, cd/m2".to_owned(),
                y_label: "per cent, without sign".to_owned(),
                series: vec![
                    series("fitted", off(|patch| patch.fitted_cd_m2, PatchUse::Fitted)),
                    series("held out", off(|patch| patch.fitted_cd_m2, PatchUse::HeldOut)),
                    series("from the others", off(|patch| patch.left_out_cd_m2, PatchUse::Fitted)),
                ],
                ..Panel::default()
            },
        ],
    }
}
