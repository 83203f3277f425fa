//! Calibration files: our own JSON, and those of OpenCV `fisheye` and Kalibr.
//!
//! Ours, with every key (k and the numbers of the response as METHODS sections 2 and 3 name them):
//!
//! ```json
//! {
//!   "version": 1,
//!   "lens": {
//!     "model": "kannala-brandt", "width": 640, "height": 480, "fx": 150.0, "fy": 150.0, "cx": 320.0, "cy": 240.0,
//!     "k": [0.0, 0.0, 0.0, 0.0], "field_of_view_deg": 180.0
//!   },
//!   "response": { "model": "logarithmic", "a": 500.0, "b": 60.0, "black_clip_code": 20, "saturation_code": 1000 }
//! }
//! ```
//!
//! Pixel coordinates have half-pixel centres; OpenCV and Kalibr have integer coordinates at the centres, so
//! 0.5 px is added to their cx and cy on loading.

use super::{document, kalibr_file, opencv_file};
use crate::error::{Error, Place, Result, plain_words, read_at_most};
use lightcast_core::camera::{Lens, LensParameters, Response, ResponseModel};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What a calibration file says about a camera, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Geometry.
    pub lens: Lens,
    /// Maps codes to radiance; the identity where the file has none.
    pub response: Response,
    /// What the loader assumed because the file does not specify it, for the program to print.
    pub notes: Vec<String>,
}

/// A calibration is about a page of numbers; Kalibr's with covariances about ten.
const SIZE_MAX_BYTES: u64 = 1 << 20;

const VERSION: u32 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    version: u32,
    lens: LensEntry,
    #[serde(default)]
    response: ResponseModel,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LensEntry {
    model: LensModel,
    width: usize,
    height: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    k: [f64; 4],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    field_of_view_deg: Option<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum LensModel {
    KannalaBrandt,
}

impl Calibration {
    /// Loads a calibration file of any known kind; `camera` names one of a Kalibr chain (`cam1`), `None`
    /// takes its first.
    ///
    /// # Errors
    /// `Usage`, naming the file and the key or line: files that cannot be read, are over 1 MiB or of unknown
    /// kind, unknown keys in our own format, missing keys, and numbers that no camera has.
    pub fn load(path: &Path, camera: Option<&str>) -> Result<Self> {
        read(path).and_then(|text| Self::parse(&text, camera)).map_err(|error| error.at(path))
    }

    /// Reads the text of a calibration file of any known kind.
    ///
    /// # Errors
    /// As [`Self::load`], without the file's name.
    pub fn parse(text: &str, camera: Option<&str>) -> Result<Self> {
        let document = document::parse(text)?;
        if document.get("lens").is_some() || document.get("version").is_some_and(|_| !foreign(&document)) {
            return Self::parse_own(text, camera);
        }
        let parameters = if opencv_file::recognises(&document) {
            no_cameras(camera)?;
            opencv_file::lens(&document)?
        } else if kalibr_file::recognises(&document) {
            kalibr_file::lens(&document, camera)?
        } else {
            return Err(Error::usage(
                "is no calibration that is known: ours (JSON with version and lens), OpenCV fisheye (K, D, image \
                 size) or Kalibr (cam0 with camera_model)",
            ));
        };
        let (lens, notes) = checked(parameters, None)?;
        Ok(Self { lens, response: Response::default(), notes })
    }

    fn parse_own(text: &str, camera: Option<&str>) -> Result<Self> {
        no_cameras(camera)?;
        let file: File = serde_json::from_str(text)
            .map_err(|error| Error::usage("cannot be used").because(plain_words(&error.to_string())))?;
        if file.version != VERSION {
            return Err(Error::usage(format!("is not known, this program reads version {VERSION}"))
                .at(Place::value("version", file.version)));
        }
        let LensEntry {
            model: LensModel::KannalaBrandt,
            width,
            height,
            fx,
            fy,
            cx,
            cy,
            k,
            field_of_view_deg,
        } = file.lens;
        let parameters = LensParameters { width, height, fx, fy, cx, cy, k, field_of_view_rad: 0.0 };
        let (lens, notes) =
            checked(parameters, field_of_view_deg).map_err(|error| error.at(Place::key("lens")))?;
        let response =
            Response::new(file.response).map_err(|error| Error::from(error).at(Place::key("response")))?;
        Ok(Self { lens, response, notes })
    }

    /// The calibration as our JSON file.
    pub fn to_json(&self) -> String {
        let LensParameters { width, height, fx, fy, cx, cy, k, field_of_view_rad } = *self.lens.parameters();
        let file = File {
            version: VERSION,
            lens: LensEntry {
                model: LensModel::KannalaBrandt,
                width,
                height,
                fx,
                fy,
                cx,
                cy,
                k,
                field_of_view_deg: Some(field_of_view_rad.to_degrees()),
            },
            response: self.response.model().clone(),
        };
        // Numbers, strings and lists of them can always be written as JSON.
        let mut text = serde_json::to_string_pretty(&file).expect("plain data serialises");
        text.push('\n');
        text
    }

    /// The lens as YAML that `cv::FileStorage` reads, for `cv::fisheye`; 0.5 px are subtracted from cx and
    /// cy. The response and the field of view, for which OpenCV has no names, are left out.
    pub fn to_opencv_yaml(&self) -> String {
        opencv_file::yaml(self.lens.parameters())
    }

    /// The same as JSON.
    pub fn to_opencv_json(&self) -> String {
        opencv_file::json(self.lens.parameters())
    }

    /// The lens as a Kalibr `camchain.yaml` of one camera, `cam0`; 0.5 px are subtracted from cx and cy. The
    /// response and the field of view, for which Kalibr has no keys, are left out.
    pub fn to_kalibr_yaml(&self) -> String {
        kalibr_file::chain(self.lens.parameters())
    }
}

/// The lens of these parameters, and what was assumed about it.
fn checked(mut parameters: LensParameters, field_of_view_deg: Option<f64>) -> Result<(Lens, Vec<String>)> {
    let mut notes = Vec::new();
    match field_of_view_deg {
        Some(degrees) => parameters.field_of_view_rad = degrees.to_radians(),
        None => {
            // The other numbers are checked first, because the default is computed from them.
            Lens::new(LensParameters { field_of_view_rad: 1e-9, ..parameters })?;
            let (field_of_view_rad, reach) = parameters.default_field_of_view();
            parameters.field_of_view_rad = field_of_view_rad;
            notes.push(format!(
                "the calibration declares no field of view: taken as {:.2} degrees, {reach}; where the lens's \
                 circle is smaller, declare it as field_of_view_deg in a calibration of version {VERSION}",
                field_of_view_rad.to_degrees()
            ));
        }
    }
    Ok((Lens::new(parameters)?, notes))
}

fn foreign(document: &serde_json::Value) -> bool {
    opencv_file::recognises(document) || kalibr_file::recognises(document)
}

fn no_cameras(camera: Option<&str>) -> Result<()> {
    match camera {
        Some(name) => {
            Err(Error::usage(format!("holds one camera; {name} can be chosen in Kalibr's files only")))
        }
        None => Ok(()),
    }
}

fn read(path: &Path) -> Result<String> {
    let unreadable = |error: std::io::Error| Error::usage("cannot be read").because(error);
    let bytes = read_at_most(path, SIZE_MAX_BYTES).map_err(unreadable)?;
    if bytes.len() as u64 > SIZE_MAX_BYTES {
        return Err(Error::usage("is larger than 1 MiB: this is no calibration"));
    }
    String::from_utf8(bytes).map_err(|error| Error::usage("is not text").because(error))
}

#[cfg(test)]
mod tests;
