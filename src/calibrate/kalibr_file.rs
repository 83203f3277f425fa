//! Kalibr's `camchain.yaml`: one entry per camera (`cam0`, `cam1`, ...), of which only `equidistant` ones are
//! supported.

use super::document::{decimal, numbers, size};
use crate::error::{Error, Place, Result};
use lightcast_core::camera::LensParameters;
use serde_json::Value;

/// Whether the document has a camera as Kalibr writes it.
pub(super) fn recognises(document: &Value) -> bool {
    cameras(document).next().is_some()
}

fn cameras(document: &Value) -> impl Iterator<Item = (&str, &Value)> {
    document
        .as_object()
        .into_iter()
        .flatten()
        .filter(|(_, camera)| camera.get("camera_model").is_some() && camera.get("intrinsics").is_some())
        .map(|(name, camera)| (name.as_str(), camera))
}

/// The lens of one camera, by default the first by name, with our half-pixel centres; the field of view is
/// not in the file and left 0.
///
/// # Errors
/// `Usage`, naming the key.
pub(super) fn lens(document: &Value, camera: Option<&str>) -> Result<LensParameters> {
    let is_chosen = camera.is_some();
    let found = cameras(document).find(|(name, _)| camera.is_none_or(|wanted| wanted == *name));
    let Some((name, camera)) = found else {
        let names: Vec<&str> = cameras(document).map(|(name, _)| name).collect();
        return Err(Error::usage(format!(
            "no camera {}; the file has {}",
            camera.unwrap_or_default(),
            names.join(", ")
        )));
    };
    let key = |key: &str| format!("{name}.{key}");
    let value =
        |name: &str| camera.get(name).ok_or_else(|| Error::usage("is missing").at(Place::key(key(name))));
    for (model, supported) in [("camera_model", "pinhole"), ("distortion_model", "equidistant")] {
        let found = value(model)?.as_str().unwrap_or("not a word");
        if found != supported {
            let others: Vec<&str> =
                cameras(document).map(|(other, _)| other).filter(|other| *other != name).collect();
            let choice = if others.is_empty() || is_chosen {
                String::new()
            } else {
                format!(", or choose another camera of the chain ({}) by `kalibr_camera`", others.join(", "))
            };
            return Err(Error::usage(format!(
                "is not supported, only {supported}: calibrate with Kalibr's model pinhole-equi{choice}"
            ))
            .at(Place::value(key(model), found)));
        }
    }
    let [fx, fy, cx, cy] = numbers(value("intrinsics")?, &key("intrinsics"))?;
    let k = numbers(value("distortion_coeffs")?, &key("distortion_coeffs"))?;
    let [width, height] = numbers(value("resolution")?, &key("resolution"))?;
    let (width, height) = (size(width, &key("resolution"))?, size(height, &key("resolution"))?);
    Ok(LensParameters { width, height, fx, fy, cx: cx + 0.5, cy: cy + 0.5, k, field_of_view_rad: 0.0 })
}

/// The lens as a chain of one camera, with pixel centres at integers again. The field of view has no key and
/// is left out; the topic, which Kalibr requires, is a placeholder.
pub(super) fn chain(lens: &LensParameters) -> String {
    let list = |values: &[f64]| values.iter().map(|&value| decimal(value)).collect::<Vec<_>>().join(", ");
    let LensParameters { width, height, fx, fy, cx, cy, k, .. } = *lens;
    format!(
        "cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs: [{}]\n  \
         distortion_model: equidistant\n  intrinsics: [{}]\n  resolution: [{width}, {height}]\n  \
         rostopic: /cam0/image_raw\n",
        list(&k),
        list(&[fx, fy, cx - 0.5, cy - 0.5])
    )
}
