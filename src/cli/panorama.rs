use crate::camera::{FrameToPolar, PixelCounts, Projection, Response};
use crate::error::{Kind, Result};
use crate::image::{self, Frame, PolarMap, PolarShape};
use glam::DMat3;
use std::path::Path;

/// Reads a lat-long panorama of the whole sphere and averages it by area to a polar map. Pixels without a usable
/// value count as black; a message says how many.
pub(super) fn read_panorama(path: &Path, shape: PolarShape) -> Result<PolarMap> {
    let mut frame = Frame::default();
    let attributes = image::read(path, &mut frame).map_err(|error| error.with_kind(Kind::Failed))?;
    let projection =
        Projection::LatLong { width: frame.width, height: frame.height, centres: attributes.latlong_centres };
    let mut frame_to_polar = FrameToPolar::new(&projection, DMat3::IDENTITY, shape)?;
    // After the shape was checked.
    let mut map = PolarMap::black(shape);
    let PixelCounts { nan, infinite, negative, .. } = frame_to_polar
        .apply(&frame, &Response::default(), &mut map)
        .map_err(|error| error.with_kind(Kind::Failed).at(path.display()))?;
    if nan + infinite + negative > 0 {
        let path = path.display();
        tracing::warn!("{path}: taken as black: {nan} pixels NaN, {infinite} infinite, {negative} negative");
    }
    Ok(map)
}
