use super::{Arguments, Found, Taken, curve, digits, read};
use crate::calibrate::{BracketFit, BracketSamples, fit_bracket, recover_exposures};
use crate::error::{Error, Place, Result, TomlText};
use crate::files::{exposure_settings, write_exr};
use crate::picture::{Panel, Plot, Series};
use lightcast_core::camera::{ExposureMerge, Response, SensorNoise};
use lightcast_core::image::Frame;
use serde::Deserialize;
use std::path::{Path, PathBuf};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    exposure_s: Vec<f64>,
}

const CURVE_POINTS: usize = 52;

pub(super) fn find(arguments: &Arguments, inputs: &[Taken], known: Option<&Response>) -> Result<Found> {
    let files = inputs.iter().map(Taken::files).collect::<Result<Vec<_>>>()?.concat();
    let times = match &arguments.exposures {
        Some(path) => {
            let text = TomlText::load(path)?;
            let File { exposure_s } = text.parse()?;
            if exposure_s.len() != files.len() {
                let fault = format!("has {} times for {} pictures", exposure_s.len(), files.len());
                return Err(text.locate("", Error::usage(fault).at(Place::key("exposure_s"))));
            }
            Some(exposure_s)
        }
        None => from_exif(&files)?,
    };
    if times.is_none() && known.is_none() {
        return Err(Error::usage(
            "has no exposure time in EXIF data; say the times with --exposures, or give a response with \
             --calibration",
        )
        .at(&files[0]));
    }

    let mut samples = BracketSamples::default();
    let mut frame = Frame::default();
    for path in &files {
        read(path, &mut frame)?;
        samples.add(&frame).map_err(|error| error.at(path))?;
    }
    let (times, found) = match (times, known) {
        (Some(times), _) => {
            let fit = fit_bracket(&samples, &times, &arguments.limits())?;
            let found = Found {
                lines: lines(&files, &times, &fit),
                plot: plot(&times, &fit),
                response: fit.response,
            };
            (times, found)
        }
        (None, response) => {
            let response = response.cloned().unwrap_or_default();
            let times = recover_exposures(&samples, &response)?;
            let found = Found {
                lines: recovered_lines(&files, &times),
                plot: Plot { title: "Response, as given".to_owned(), panels: vec![curve_panel(&response)] },
                response,
            };
            (times, found)
        }
    };
    if let Some(path) = &arguments.merge {
        merge(&files, &times, &found.response, path)?;
    }
    Ok(found)
}

/// Exposure times from EXIF data, made comparable where sensitivity or aperture differ; `None` where a
/// picture has none.
fn from_exif(files: &[PathBuf]) -> Result<Option<Vec<f64>>> {
    let settings = files.iter().map(|path| exposure_settings(path)).collect::<Result<Vec<_>>>()?;
    let Some(settings) = settings.into_iter().collect::<Option<Vec<_>>>() else { return Ok(None) };
    let times: Vec<f64> = settings.iter().map(|one| one.time_at(&settings[0])).collect();
    if settings.iter().zip(&times).any(|(one, time)| one.time_s != *time) {
        tracing::warn!(
            "the pictures differ in sensitivity or f-number: their times are taken as if at those of {}",
            files[0].display()
        );
    }
    Ok(Some(times))
}

/// Reads the pictures again, one at a time.
fn merge(files: &[PathBuf], times: &[f64], response: &Response, output: &Path) -> Result<()> {
    let mut merge = ExposureMerge::new(response, times, &SensorNoise::default())?;
    let mut frame = Frame::default();
    for (index, path) in files.iter().enumerate() {
        read(path, &mut frame)?;
        merge.add(&frame, index).map_err(|error| Error::from(error).at(path))?;
    }
    let counts = merge.finish(&mut frame)?;
    write_exr(output, &frame, None, false)?;
    tracing::info!(
        "{}: radiance, {} x {}; {} pixels saturated in the shortest exposure, {} black in the longest, {} between two \
         exposures",
        output.display(),
        frame.width,
        frame.height,
        counts.saturated,
        counts.black_clipped,
        counts.between
    );
    Ok(())
}

fn lines(files: &[PathBuf], times: &[f64], fit: &BracketFit) -> Vec<String> {
    let mut lines = vec![
        format!(
            "response: piecewise linear, from a curve of degree {}; radiance is 1 at the middle code in 1 s",
            fit.degree
        ),
        format!(
            "black up to code {}, saturated from code {}; codes seen {:.1} to {:.1}, {} samples",
            fit.response.black_clip_code(),
            fit.response.saturation_code(),
            fit.codes_seen.0,
            fit.codes_seen.1,
            fit.samples
        ),
        format!(
            "{:>14} {:>16} {:>10} {:>16}  {}",
            "exposure s", "from pictures s", "off by", "misfit stops", "picture"
        ),
    ];
    for (index, path) in files.iter().enumerate() {
        let (recovered, off) = match fit.recovered_s.get(index) {
            Some(&time) => (digits(time), format!("{:+.2} %", 100.0 * (time / times[index] - 1.0))),
            None => ("-".to_owned(), "-".to_owned()),
        };
        lines.push(format!(
            "{:>14} {recovered:>16} {off:>10} {:>16.4}  {}",
            digits(times[index]),
            fit.misfit_stops[index],
            path.display()
        ));
    }
    lines
}

fn recovered_lines(files: &[PathBuf], times: &[f64]) -> Vec<String> {
    let mut lines = vec![
        "response: as in the calibration; no exposure times are given, these follow from it".to_owned(),
        format!("{:>20}  {}", "relative exposure", "picture"),
    ];
    let rows = times.iter().zip(files);
    lines.extend(rows.map(|(time, path)| format!("{:>20}  {}", digits(*time), path.display())));
    lines
}

fn curve_panel(response: &Response) -> Panel {
    Panel {
        title: "curve".to_owned(),
        x_label: "radiance x time, relative".to_owned(),
        y_label: "code".to_owned(),
        series: vec![Series { name: "response".to_owned(), points: curve(response, CURVE_POINTS) }],
        ..Panel::default()
    }
}

/// The curve, and by how much the pictures disagree with it and with their times.
fn plot(times: &[f64], fit: &BracketFit) -> Plot {
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by(|&one, &two| times[one].total_cmp(&times[two]));
    let points = |value: &dyn Fn(usize) -> Option<f64>| -> Vec<(f64, f64)> {
        order.iter().filter_map(|&picture| Some((times[picture], value(picture)?))).collect()
    };
    let misfit = |picture: usize| Some(100.0 * (fit.misfit_stops[picture].exp2() - 1.0));
    let off = |picture: usize| Some(100.0 * (fit.recovered_s.get(picture)? / times[picture] - 1.0).abs());
    Plot {
        title: format!("Response of an ordinary camera from {} exposures", times.len()),
        panels: vec![
            curve_panel(&fit.response),
            Panel {
                title: "deviations".to_owned(),
                x_label: "exposure time, s".to_owned(),
                y_label: "per cent, without sign".to_owned(),
                series: vec![
                    Series { name: "samples, RMS".to_owned(), points: points(&misfit) },
                    Series { name: "time from the pictures".to_owned(), points: points(&off) },
                ],
                ..Panel::default()
            },
        ],
    }
}
