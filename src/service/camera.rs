use crate::camera::{Calibration, FrameToPolar, LOOKING_UP, Projection, Response};
use crate::config::{Config, ProjectionKind};
use crate::error::Result;
use crate::source::FrameFormat;
use glam::DMat3;

/// The way from frames of this format to polar maps, and what their samples mean.
pub(super) fn frame_to_polar(config: &Config, format: &FrameFormat) -> Result<(FrameToPolar, Response)> {
    let options = &config.camera;
    let (projection, response, world_from_camera) = match (options.projection, &options.calibration) {
        (ProjectionKind::Fisheye, Some(path)) => {
            let calibration = Calibration::load(path)?;
            (Projection::Fisheye(calibration.lens), calibration.response, LOOKING_UP)
        }
        // `config` refuses a fisheye without a calibration.
        _ => {
            let FrameFormat { width, height, latlong_centres: centres, .. } = *format;
            (Projection::LatLong { width, height, centres }, Response::default(), DMat3::IDENTITY)
        }
    };
    Ok((
        FrameToPolar::new(&projection, options.world_from_camera.unwrap_or(world_from_camera), config.map)?,
        response,
    ))
}
