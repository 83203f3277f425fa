use super::resolution::Resolution;
use crate::error::{Error, Kind, Result};
use crate::files::{self, lat_long_note};
use glam::DMat3;
use lightcast_core::camera::{FrameToPolar, PixelCounts, Projection, Response};
use lightcast_core::image::{Frame, Pixels, PolarMap, PolarShape};
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

/// The polar map that a panorama is averaged to, unless `resolution` says otherwise: by degrees.
///
/// # Errors
/// Those of [`PolarShape::new`].
pub(super) fn map_shape(resolution: Option<Resolution>, is_hemisphere: bool) -> Result<PolarShape> {
    let (rows, theta_max_rad) = if is_hemisphere { (90, FRAC_PI_2) } else { (180, PI) };
    let Resolution { columns, rows } = resolution.unwrap_or(Resolution { columns: 360, rows });
    PolarShape::new(columns, rows, theta_max_rad).map_err(|error| Error::from(error).at("--resolution"))
}

/// Reads a lat-long panorama of the whole sphere and averages it by area to a polar map. Pixels without a usable
/// value count as black; a message says how many.
pub(super) fn read_panorama(path: &Path, shape: PolarShape) -> Result<PolarMap> {
    Ok(read_panorama_as(path, &[shape])?.swap_remove(0))
}

/// [`read_panorama`] for maps of several shapes of one panorama.
pub(super) fn read_panorama_as(path: &Path, shapes: &[PolarShape]) -> Result<Vec<PolarMap>> {
    let mut frame = Frame::default();
    let attributes = files::read(path, &mut frame).map_err(|error| error.with_kind(Kind::Failed))?;
    if matches!(frame.pixels, Pixels::Codes(_)) {
        return Err(Error::failed(
            "holds raw sensor codes; a panorama of radiance is needed, OpenEXR or Radiance HDR",
        )
        .at(path.display()));
    }
    if let Some(note) = lat_long_note(frame.width, frame.height) {
        tracing::warn!("{}: {note}", path.display());
    }
    let projection =
        Projection::LatLong { width: frame.width, height: frame.height, centres: attributes.latlong_centres };
    let (response, mut counts) = (Response::default(), PixelCounts::default());
    let mut average = |&shape: &PolarShape| {
        let mut frame_to_polar = FrameToPolar::new(&projection, DMat3::IDENTITY, shape)?;
        let mut map = PolarMap::black(shape);
        counts = frame_to_polar
            .apply(&frame, &response, &mut map)
            .map_err(|error| Error::from(error).with_kind(Kind::Failed).at(path.display()))?;
        Ok(map)
    };
    let maps = shapes.iter().map(&mut average).collect::<Result<Vec<_>>>()?;
    let PixelCounts { nan, infinite, negative, .. } = counts;
    if nan + infinite + negative > 0 {
        let path = path.display();
        tracing::warn!("{path}: taken as black: {nan} pixels NaN, {infinite} infinite, {negative} negative");
    }
    Ok(maps)
}
