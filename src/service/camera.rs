use crate::calibrate::Calibration;
use crate::config::{Config, ProjectionKind};
use crate::error::{Error, Result};
use crate::files::lat_long_note;
use crate::source::FrameFormat;
use glam::DMat3;
use lightcast_core::camera::{FrameToPolar, LOOKING_UP, Projection, Response};

/// The calibration that a configuration names, with the configuration's response in place of its own where
/// there is one.
///
/// # Errors
/// Kind `Usage` for a calibration that cannot be used.
pub(super) fn calibration(config: &Config) -> Result<Option<Calibration>> {
    let options = &config.camera;
    let Some(path) = &options.calibration else { return Ok(None) };
    let mut calibration = Calibration::load(path, options.kalibr_camera.as_deref())?;
    if let Some(response) = &options.response {
        calibration.response.clone_from(response);
    }
    Ok(Some(calibration))
}

/// The meaning of sensor codes according to a configuration.
///
/// # Errors
/// As [`calibration`].
pub(super) fn response(config: &Config) -> Result<Response> {
    let own = calibration(config)?.map(|calibration| calibration.response);
    Ok(own.or_else(|| config.camera.response.clone()).unwrap_or_default())
}

/// The conversion from frames of this format to polar maps, and the meaning of their samples.
///
/// # Errors
/// Kind `Usage` for a calibration that cannot be used or does not belong to these frames: this is better
/// reported once at the start than for every frame.
pub(super) fn frame_to_polar(
    config: &Config,
    format: &FrameFormat,
    source: &str,
) -> Result<(FrameToPolar, Response)> {
    let options = &config.camera;
    let FrameFormat { width, height, channels, bayer, is_codes, latlong_centres: centres, .. } = *format;
    let response = response(config)?;
    let (projection, world_from_camera) = match (options.projection, calibration(config)?) {
        (ProjectionKind::Fisheye, Some(calibration)) => {
            for note in &calibration.notes {
                tracing::info!("the calibration: {note}");
            }
            (Projection::Fisheye(calibration.lens), LOOKING_UP)
        }
        // A fisheye without a calibration was refused with the configuration.
        _ => {
            if let Some(note) = lat_long_note(width, height) {
                tracing::warn!("{source}: {note}");
            }
            (Projection::LatLong { width, height, centres }, DMat3::IDENTITY)
        }
    };
    let misfit = if (width, height) != (projection.width(), projection.height()) {
        format!("is for frames of {} x {}", projection.width(), projection.height())
    } else if bayer.is_some() && matches!(projection, Projection::LatLong { .. }) {
        "has all colours in every pixel".to_owned()
    } else if is_codes && response.is_identity() {
        "has no response, which tells what sensor codes mean (give one with the key `response` of [camera])"
            .to_owned()
    } else if bayer.is_some() && (width % 2 != 0 || height % 2 != 0) {
        "needs whole periods of a mosaic, an even number of columns and of rows (crop the frames at the right or the \
         lower side, and the lens's width and height with them)"
            .to_owned()
    } else if options.rec709_from_sensor.is_some() && channels == 1 && bayer.is_none() {
        "has a matrix for the sensor's colours (remove the key `rec709_from_sensor` of [camera])".to_owned()
    } else {
        let world_from_camera = options.world_from_camera.unwrap_or(world_from_camera);
        let frame_to_polar = match bayer {
            None => FrameToPolar::new(&projection, world_from_camera, config.map),
            Some(bayer) => FrameToPolar::mosaic(&projection, bayer, world_from_camera, config.map),
        };
        let frame_to_polar = frame_to_polar.map_err(|error| match error.option() {
            Some("world_from_camera") => config.locate("camera", error),
            // Frames of a size that no map is made of.
            _ => Error::from(error).at(source),
        })?;
        let frame_to_polar = match options.rec709_from_sensor {
            None => frame_to_polar,
            Some(matrix) => frame_to_polar.with_colours(matrix),
        };
        return Ok((frame_to_polar, response));
    };
    let calibration = options
        .calibration
        .as_ref()
        .map_or("a lat-long panorama".to_owned(), |path| format!("the calibration {}", path.display()));
    let samples = if is_codes { "sensor codes" } else { "radiance" };
    let colours = match (bayer, channels) {
        (Some(bayer), _) => format!(" in a mosaic of colours {bayer}"),
        (None, 1) => " without colours".to_owned(),
        _ => String::new(),
    };
    Err(Error::usage(format!(
        "{calibration} {misfit}, but the frames are {width} x {height} of {samples}{colours}"
    ))
    .at(source))
}
