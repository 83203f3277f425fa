use super::photographs;
use super::residual_plot::residual_plot;
use super::write;
use crate::calibrate::{Calibration, CornerSet, LensFit, LensFitOptions, LensStart, fit_lens};
use crate::cli::standard_output::print;
use crate::error::{Error, Result};
use glam::DVec2;
use lightcast_core::camera::{LensParameters, Response};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Fit a fisheye lens to pictures of a flat board.
///
/// Takes a file of corners that were found elsewhere, or, with --april-grid, photographs of an AprilGrid. 10
/// to 30 pictures, with the board tilted in different ways and in some of them close to the rim, determine a
/// lens well.
///
/// The report (JSON) goes to standard output: RMS residual, the lens with the standard deviations of its
/// parameters, and every picture with its RMS residual, or why it was dropped. Bad pictures are also named on
/// standard error. The calibration goes to --output, for `run`; --opencv and --kalibr write it in those
/// programs' form, in which pixel centres are whole numbers (0.5 px less) and the field of view is not
/// stored.
///
/// Example: lightcast calibrate lens corners.json --field-of-view-deg 185 --circle-diameter-px 1010
///            --output lens.json --plot residuals.svg | jq .rms_px
///
/// Photographs (PNG of 8 or 16 bits, JPEG) of an AprilGrid, the board of Kalibr:
///
///   lightcast calibrate lens --april-grid april_6x6.yaml board*.png --field-of-view-deg 185 --output lens.json
///
/// The file of corners, here from chessboards with OpenCV's detector in Python:
///
///   import cv2, json, sys
///   columns, rows, pitch_m = 9, 6, 0.025  # inner corners, and metres from one to the next
///   views = []
///   for name in sys.argv[1:]:
///       grey = cv2.imread(name, cv2.IMREAD_GRAYSCALE)
///       found, corners = cv2.findChessboardCornersSB(grey, (columns, rows))
///       if found:
///           views.append({"name": name, "corners_px": corners.reshape(-1, 2).tolist()})
///   print(json.dumps({"version": 1, "image_size": grey.shape[::-1], "pixel_centres": "integer", "views": views,
///                     "board": {"columns": columns, "rows": rows, "pitch_m": pitch_m}}))
///
/// "pixel_centres" is "integer" where the first pixel's centre is (0, 0), as in OpenCV and Kalibr, and "half"
/// where it is (0.5, 0.5). A view that shows a part of the board lists the "ids" of its corners, which are
/// numbered row by row from 0. Other flat boards list their corners: "board": {"points_m": [[0, 0], [0.088,
/// 0]]}.
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// A file of corners, or photographs of the board that --april-grid describes.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,

    /// The board in the photographs: a target file of Kalibr (target_type: 'aprilgrid', tagCols, tagRows,
    /// tagSize in metres, tagSpacing as a share of tagSize). Needs a program that was installed with its
    /// detector: make install FEATURES=april-grid.
    #[arg(long, value_name = "FILE")]
    april_grid: Option<PathBuf>,

    /// Write the corners that were found in the photographs to this file, from which the fit can be repeated.
    #[arg(long, value_name = "FILE", requires = "april_grid")]
    save_corners: Option<PathBuf>,

    /// Full opening angle of the lens, as its manufacturer gives it: the angle that the circle spans. The
    /// fitted lens declares it, or a smaller one where r(theta) turns before it.
    #[arg(long, value_name = "DEGREES")]
    field_of_view_deg: f64,

    /// Diameter of the lens's circle in the pictures, to within a third; for a lens whose circle is larger
    /// than the picture, the picture's diagonal with the field of view along it [default: the picture's
    /// shorter side].
    #[arg(long, value_name = "PX")]
    circle_diameter_px: Option<f64>,

    /// Centre of the circle, roughly [default: the picture's].
    #[arg(long, value_name = "X,Y", value_parser = position)]
    circle_centre_px: Option<DVec2>,

    /// Drop pictures whose RMS residual is over this many times the median of all; `inf` keeps them.
    #[arg(long, value_name = "FACTOR", default_value_t = LensFitOptions::default().drop_factor)]
    drop_factor: f64,

    /// Write the calibration to this file. A calibration that is there already keeps its response.
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,

    /// Write the lens for OpenCV's `fisheye` too, as YAML (.yml, .yaml) or JSON (.json) of cv::FileStorage.
    #[arg(long, value_name = "FILE")]
    opencv: Option<PathBuf>,

    /// Write the lens as a Kalibr camchain (YAML) too.
    #[arg(long, value_name = "FILE")]
    kalibr: Option<PathBuf>,

    /// Draw the residuals against the angle from the axis into this file (SVG).
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    // This comes first, so that a fit is not lost because its result cannot be written.
    let response = kept_response(&arguments.output)?;
    let opencv = match arguments.opencv.as_deref() {
        Some(path) => Some((path, OpencvForm::of(path)?)),
        None => None,
    };
    let corners = corners(arguments)?;
    let start = start(arguments, &corners);
    let options = LensFitOptions { drop_factor: arguments.drop_factor };
    let fit = fit_lens(&corners.views, &start, &options)?;
    for view in &fit.views {
        if let Some(reason) = &view.dropped {
            tracing::warn!("{} is dropped: {reason}", view.name);
        }
    }
    for note in &fit.notes {
        tracing::warn!("{note}");
    }

    let calibration = Calibration { lens: fit.lens, response, notes: Vec::new() };
    write(&arguments.output, &calibration.to_json())?;
    if let Some((path, form)) = opencv {
        let text = match form {
            OpencvForm::Yaml => calibration.to_opencv_yaml(),
            OpencvForm::Json => calibration.to_opencv_json(),
        };
        write(path, &text)?;
    }
    if let Some(path) = &arguments.kalibr {
        write(path, &calibration.to_kalibr_yaml())?;
    }
    if let Some(path) = &arguments.plot {
        write(path, &residual_plot(&fit).to_svg())?;
    }
    print(&[format!("{:#}", report(&fit))]).map(|_| ())
}

/// `X,Y`, in pixels.
fn position(text: &str) -> std::result::Result<DVec2, String> {
    let numbers = text.split_once(',').map(|(x, y)| (x.trim().parse(), y.trim().parse()));
    match numbers {
        Some((Ok(x), Ok(y))) => Ok(DVec2::new(x, y)),
        _ => Err("two numbers with a comma between them expected, such as 512,498.5".to_owned()),
    }
}

/// The response of an existing calibration, so that calibrating the lens does not lose it.
fn kept_response(output: &Path) -> Result<Response> {
    if !output.exists() {
        return Ok(Response::default());
    }
    let old = Calibration::load(output, None).map_err(|error| {
        Error::usage("--output is there already and will not be replaced; name another file").because(error)
    })?;
    if !old.response.is_identity() {
        tracing::info!("{}: its response is kept", output.display());
    }
    Ok(old.response)
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum OpencvForm {
    Yaml,
    Json,
}

impl OpencvForm {
    fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        match extension.to_str() {
            Some("yml" | "yaml") => Ok(Self::Yaml),
            Some("json") => Ok(Self::Json),
            _ => Err(Error::usage("cv::FileStorage goes by the name; end it in .yml, .yaml or .json")
                .at(path)
                .at("--opencv")),
        }
    }
}

fn corners(arguments: &Arguments) -> Result<CornerSet> {
    if let Some(board) = &arguments.april_grid {
        let corners = photographs::corners(board, &arguments.files)?;
        if let Some(path) = &arguments.save_corners {
            write(path, &corners.to_json())?;
        }
        return Ok(corners);
    }
    match arguments.files.as_slice() {
        [file] => CornerSet::load(file),
        files => Err(Error::usage(format!(
            "{} files, one file of corners expected; photographs need a board, --april-grid FILE",
            files.len()
        ))),
    }
}

fn start(arguments: &Arguments, corners: &CornerSet) -> LensStart {
    let CornerSet { width, height, .. } = *corners;
    LensStart {
        width,
        height,
        field_of_view_rad: arguments.field_of_view_deg.to_radians(),
        circle_diameter_px: arguments.circle_diameter_px.unwrap_or(width.min(height) as f64),
        circle_centre_px: arguments
            .circle_centre_px
            .unwrap_or_else(|| DVec2::new(width as f64, height as f64) * 0.5),
    }
}

/// Everything about a fit that a person or a script may need; pixel coordinates have half-pixel centres.
fn report(fit: &LensFit) -> serde_json::Value {
    let LensParameters { width, height, fx, fy, cx, cy, k, field_of_view_rad } = *fit.lens.parameters();
    let deviations = fit.deviations;
    let used = fit.views.iter().filter(|view| view.dropped.is_none());
    let degrees = |radians: f64| radians.to_degrees();
    let pictures: Vec<_> = fit
        .views
        .iter()
        .map(|view| {
            json!({
                "name": view.name,
                "corners": view.corners,
                "rms_px": view.rms_px,
                "worst_px": view.worst.map(|(length_px, _)| length_px),
                "worst_corner": view.worst.map(|(_, corner)| corner),
                "widest_angle_deg": view.theta_max_rad.map(degrees),
                "dropped": view.dropped,
            })
        })
        .collect();
    json!({
        "rms_px": fit.rms_px,
        "pictures_used": used.clone().count(),
        "pictures_dropped": fit.views.len() - used.clone().count(),
        "corners_used": fit.residuals.len(),
        "widest_angle_deg": degrees(fit.theta_max_rad),
        "lens": {
            "width": width, "height": height, "fx": fx, "fy": fy, "cx": cx, "cy": cy, "k": k,
            "field_of_view_deg": degrees(field_of_view_rad),
        },
        "standard_deviations": {
            "fx": deviations.fx, "fy": deviations.fy, "cx": deviations.cx, "cy": deviations.cy, "k": deviations.k,
        },
        "notes": fit.notes,
        "pictures": pictures,
    })
}

#[cfg(test)]
mod tests;
