use super::input::{display_name, is_standard_input};
use super::resolution::Resolution;
use crate::error::{Error, Kind, Result};
use crate::files::{self, Attributes, MAX_PIXELS, lat_long_note};
use glam::DMat3;
use lightcast_core::camera::{FrameToPolar, PixelCounts, Projection, Response};
use lightcast_core::image::{Frame, Pixels, PolarMap, PolarShape};
use std::f64::consts::{FRAC_PI_2, PI};
use std::io::{self, Read as _};
use std::path::Path;

/// The largest panorama that is read, 16384 x 8192, has this size as RGB floats and a header.
const MOST_BYTES: u64 = 12 * MAX_PIXELS as u64 + (1 << 20);

/// The polar map that a panorama is averaged to, by default in steps of one degree.
///
/// # Errors
/// Those of [`PolarShape::new`].
pub(super) fn map_shape(resolution: Option<Resolution>, is_hemisphere: bool) -> Result<PolarShape> {
    let (rows, theta_max_rad) = if is_hemisphere { (90, FRAC_PI_2) } else { (180, PI) };
    let Resolution { columns, rows } = resolution.unwrap_or(Resolution { columns: 360, rows });
    PolarShape::new(columns, rows, theta_max_rad).map_err(|error| Error::from(error).at("--resolution"))
}

/// Reads a lat-long panorama of the whole sphere, a file or `-`, and averages it by area to a polar map.
/// Pixels without a usable value count as black; a message says how many.
pub(super) fn read_panorama(path: &Path, shape: PolarShape) -> Result<PolarMap> {
    Ok(read_panorama_as(path, &[shape])?.swap_remove(0))
}

/// [`read_panorama`] for maps of several shapes of one panorama.
pub(super) fn read_panorama_as(path: &Path, shapes: &[PolarShape]) -> Result<Vec<PolarMap>> {
    Panorama::read(path)?.maps(shapes)
}

/// A panorama as it was read.
pub(super) struct Panorama {
    frame: Frame,
    projection: Projection,
    name: String,
}

impl Panorama {
    /// Reads a panorama in any format that holds radiance; `-`: from standard input.
    pub fn read(path: &Path) -> Result<Self> {
        let mut frame = Frame::default();
        let attributes = read(path, &mut frame).map_err(|error| error.with_kind(Kind::Failed))?;
        let name = display_name(path);
        if matches!(frame.pixels, Pixels::Codes(_)) {
            return Err(Error::failed(
                "holds raw sensor codes; a panorama of radiance is needed, OpenEXR or Radiance HDR",
            )
            .at(&name));
        }
        if let Some(note) = lat_long_note(frame.width, frame.height) {
            tracing::warn!("{name}: {note}");
        }
        let projection = Projection::LatLong {
            width: frame.width,
            height: frame.height,
            centres: attributes.latlong_centres,
        };
        Ok(Self { frame, projection, name })
    }

    /// A shape with as many pixels as the file has, but at most `most_columns` columns.
    pub fn own_shape(&self, most_columns: usize) -> Result<PolarShape> {
        let Frame { width, height, .. } = self.frame;
        let columns = width.min(most_columns);
        let rows = (columns * height / width.max(1)).max(1);
        Ok(PolarShape::new(columns, rows, PI)?)
    }

    /// Averages over the pixels of a map of this shape.
    pub fn map(&self, shape: PolarShape) -> Result<PolarMap> {
        Ok(self.maps(&[shape])?.swap_remove(0))
    }

    fn maps(&self, shapes: &[PolarShape]) -> Result<Vec<PolarMap>> {
        let Self { frame, projection, name } = self;
        let (response, mut counts) = (Response::default(), PixelCounts::default());
        let mut average = |&shape: &PolarShape| {
            let mut frame_to_polar = FrameToPolar::new(projection, DMat3::IDENTITY, shape)?;
            let mut map = PolarMap::black(shape);
            counts = frame_to_polar
                .apply(frame, &response, &mut map)
                .map_err(|error| Error::from(error).with_kind(Kind::Failed).at(name))?;
            Ok(map)
        };
        let maps = shapes.iter().map(&mut average).collect::<Result<Vec<_>>>()?;
        let PixelCounts { nan, infinite, negative, .. } = counts;
        if nan + infinite + negative > 0 {
            tracing::warn!(
                "{name}: taken as black: {nan} pixels NaN, {infinite} infinite, {negative} negative"
            );
        }
        Ok(maps)
    }
}

/// Reads a picture file, or standard input to its end.
fn read(path: &Path, frame: &mut Frame) -> Result<Attributes> {
    if !is_standard_input(path) {
        return files::read(path, frame);
    }
    let mut bytes = Vec::new();
    let failed = |error: Error| error.at("standard input");
    io::stdin()
        .lock()
        .take(MOST_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| failed(Error::failed("cannot be read").because(error)))?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(failed(Error::failed(format!("has more than {MOST_BYTES} bytes; no panorama has"))));
    }
    files::decode(&bytes, frame).map_err(failed)
}
