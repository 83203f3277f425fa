//! Files that `cv::FileStorage` writes for `cv::fisheye`: K (3 x 3), D (4 values) and the image size. OpenCV
//! does not fix the names; those of its samples and of common tools are recognised, in upper or lower case
//! and with or without underscores.

use super::document::{decimal, numbers, numbers_of, size};
use crate::error::{Error, Place, Result};
use lightcast_core::camera::LensParameters;
use serde_json::Value;

const MATRIX: &[&str] = &["k", "cameramatrix", "intrinsicmatrix"];
const COEFFICIENTS: &[&str] = &["d", "distortioncoefficients", "distcoeffs", "distortioncoeffs"];
const SIZE: &[&str] = &["imagesize", "size", "resolution", "dim"];
const WIDTH: &[&str] = &["imagewidth", "width"];
const HEIGHT: &[&str] = &["imageheight", "height"];

/// Whether the document has the keys of OpenCV's files.
pub(super) fn recognises(document: &Value) -> bool {
    find(document, MATRIX).is_some() && find(document, COEFFICIENTS).is_some()
}

/// The lens, with our half-pixel centres; the field of view is not in the file and left 0.
///
/// # Errors
/// `Usage`, naming the key.
pub(super) fn lens(document: &Value) -> Result<LensParameters> {
    let (matrix_key, matrix) = require(document, MATRIX)?;
    let (coefficients_key, coefficients) = require(document, COEFFICIENTS)?;
    if let Some((key, flag)) = find(document, &["fisheyemodel"])
        && flag.as_f64() == Some(0.0)
    {
        return Err(Error::usage("says that this is not a fisheye calibration; calibrate with cv::fisheye")
            .at(Place::value(key, 0)));
    }
    check_model(document)?;
    let [fx, skew, cx, zero_a, fy, cy, zero_b, zero_c, one] = numbers::<9>(matrix, matrix_key)?;
    // OpenCV writes 16 digits; a skew of a millionth of the focal length moves no pixel by 0.01.
    if [skew, zero_a, zero_b, zero_c].into_iter().any(|value| value.abs() > 1e-6 * fx.abs()) || one != 1.0 {
        return Err(Error::usage(
            "[fx, 0, cx, 0, fy, cy, 0, 0, 1] expected (skew is not supported: calibrate with \
             cv::fisheye::CALIB_FIX_SKEW)",
        )
        .at(Place::key(matrix_key)));
    }
    let k = numbers_of::<4>(coefficients).map_err(|error| {
        Error::usage("cv::fisheye has four coefficients; the ordinary model of OpenCV cannot be used")
            .because(error)
            .at(Place::key(coefficients_key))
    })?;
    let (width, height) = match find(document, SIZE) {
        Some((key, value)) => {
            let [width, height] = numbers::<2>(value, key)?;
            (size(width, key)?, size(height, key)?)
        }
        None => {
            let (width_key, width) = require(document, WIDTH)?;
            let (height_key, height) = require(document, HEIGHT)?;
            let ([width], [height]) = (numbers(width, width_key)?, numbers(height, height_key)?);
            (size(width, width_key)?, size(height, height_key)?)
        }
    };
    Ok(LensParameters { width, height, fx, fy, cx: cx + 0.5, cy: cy + 0.5, k, field_of_view_rad: 0.0 })
}

/// Names that programs give to the model of `cv::fisheye`.
const FISHEYE_MODELS: &[&str] =
    &["equidistant", "fisheye", "kannalabrandt", "kannalabrandt4", "kb4", "opencvfisheye"];

/// A file that names its model must name that of `cv::fisheye`: ROS writes the coefficients of `plumb_bob`
/// under the same keys, and four of them look like a fisheye's.
fn check_model(document: &Value) -> Result<()> {
    let named = ["distortionmodel", "model", "cameramodel", "projectionmodel", "lensmodel"];
    for name in named {
        let Some((key, value)) = find(document, &[name]) else { continue };
        let model = value.as_str().unwrap_or("not a word");
        let plain = model.replace(['_', '-', ' '], "").to_lowercase();
        let is_pinhole = plain == "pinhole" && name != "distortionmodel";
        if !is_pinhole && !FISHEYE_MODELS.contains(&plain.as_str()) {
            return Err(Error::usage(
                "is not a model of a fisheye lens that is read here; calibrate with cv::fisheye or ROS's equidistant",
            )
            .at(Place::value(key, model)));
        }
    }
    Ok(())
}

/// The lens as `cv::FileStorage` writes it in YAML, under the names of OpenCV's calibration sample, with
/// pixel centres at integers again. There is no name for the field of view, so it is left out.
pub(super) fn yaml(lens: &LensParameters) -> String {
    let [matrix, coefficients] = matrices(lens);
    format!(
        "%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\nfisheye_model: 1\n\
         camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ {matrix} ]\n\
         distortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ {coefficients} ]\n",
        lens.width, lens.height
    )
}

/// The same in JSON.
pub(super) fn json(lens: &LensParameters) -> String {
    let [matrix, coefficients] = matrices(lens);
    let entry = |rows: usize, columns: usize, data: &str| {
        format!(
            "{{\n        \"type_id\": \"opencv-matrix\",\n        \"rows\": {rows},\n        \"cols\": {columns},\n        \
             \"dt\": \"d\",\n        \"data\": [ {data} ]\n    }}"
        )
    };
    format!(
        "{{\n    \"image_width\": {},\n    \"image_height\": {},\n    \"fisheye_model\": 1,\n    \
         \"camera_matrix\": {},\n    \"distortion_coefficients\": {}\n}}\n",
        lens.width,
        lens.height,
        entry(3, 3, &matrix),
        entry(4, 1, &coefficients)
    )
}

/// The elements of K and of D.
fn matrices(lens: &LensParameters) -> [String; 2] {
    let list = |values: &[f64]| values.iter().map(|&value| decimal(value)).collect::<Vec<_>>().join(", ");
    let LensParameters { fx, fy, cx, cy, .. } = *lens;
    [list(&[fx, 0.0, cx - 0.5, 0.0, fy, cy - 0.5, 0.0, 0.0, 1.0]), list(&lens.k)]
}

fn find<'a>(document: &'a Value, names: &[&str]) -> Option<(&'a str, &'a Value)> {
    let plain = |key: &str| key.replace('_', "").to_lowercase();
    // The order of the names decides, since a file may hold several of them.
    names.iter().find_map(|name| {
        document.as_object()?.iter().find(|(key, _)| plain(key) == **name).map(|(key, value)| (&**key, value))
    })
}

fn require<'a>(document: &'a Value, names: &[&str]) -> Result<(&'a str, &'a Value)> {
    find(document, names)
        .ok_or_else(|| Error::usage(format!("no key for one of {names:?} (case and underscores aside)")))
}
