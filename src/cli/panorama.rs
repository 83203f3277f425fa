use super::input::{display_name, is_standard_input};
use super::resolution::Resolution;
use crate::error::{Error, Kind, Result};
use crate::files::{self, Attributes, MAX_PIXELS, lat_long_note};
use clap::ValueEnum;
use glam::DMat3;
use lightcast_core::camera::{FrameToPolar, PixelCounts, Probe, Projection, Response};
use lightcast_core::image::{Frame, LatLongCentres, Pixels, PolarMap, PolarShape};
use std::f64::consts::{FRAC_PI_2, PI};
use std::io::{self, Read as _};
use std::path::Path;

/// The largest panorama that is read, 16384 x 8192, has this size as RGB floats and a header.
const MOST_BYTES: u64 = 12 * MAX_PIXELS as u64 + (1 << 20);

/// How panoramas are read.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub(super) struct PanoramaArguments {
    /// How the sphere lies in the panoramas. Default: lat-long, but a picture that is square or four by three
    /// says too little about itself and is refused.
    #[arg(long, value_name = "LAYOUT", value_enum)]
    layout: Option<Layout>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Layout {
    /// Longitude by latitude, twice as wide as high.
    LatLong,
    /// Light probe: a disc, the distance from its middle in proportion to the angle.
    Angular,
    /// A mirror ball, cut to the ball.
    MirrorBall,
    /// Six faces of a cube, as an upright or a lying cross.
    CubeCross,
}

impl PanoramaArguments {
    /// What a picture is; `None`: lat-long.
    ///
    /// # Errors
    /// For pictures that may be anything, unless the user says what they are.
    fn probe(self, width: usize, height: usize) -> Result<Option<Probe>> {
        match self.layout {
            Some(Layout::LatLong) => Ok(None),
            Some(Layout::Angular) => Ok(Some(Probe::Angular)),
            Some(Layout::MirrorBall) => Ok(Some(Probe::MirrorBall)),
            Some(Layout::CubeCross) => Ok(Some(Probe::CubeCross)),
            None => {
                let may_be = if width == height {
                    "an angular map or a mirror ball: say which with --layout angular or --layout mirror-ball"
                } else if 3 * width == 4 * height || 4 * width == 3 * height {
                    "the faces of a cube: say so with --layout cube-cross"
                } else {
                    return Ok(None);
                };
                Err(Error::failed(format!(
                    "is {width} x {height}; a lat-long panorama is twice as wide as high, and this may be {may_be} (or \
                     --layout lat-long to stretch it)"
                )))
            }
        }
    }
}

/// The polar map that a panorama is averaged to, by default in steps of one degree.
///
/// # Errors
/// Those of [`PolarShape::new`].
pub(super) fn map_shape(resolution: Option<Resolution>, is_hemisphere: bool) -> Result<PolarShape> {
    let (rows, theta_max_rad) = if is_hemisphere { (90, FRAC_PI_2) } else { (180, PI) };
    let Resolution { columns, rows } = resolution.unwrap_or(Resolution { columns: 360, rows });
    PolarShape::new(columns, rows, theta_max_rad).map_err(|error| Error::from(error).at("--resolution"))
}

/// Reads a panorama of the whole sphere, a file or `-`, and averages it by area to a polar map. Pixels
/// without a usable value count as black; a message says how many.
pub(super) fn read_panorama(path: &Path, how: PanoramaArguments, shape: PolarShape) -> Result<PolarMap> {
    Panorama::read(path, how)?.map(shape)
}

/// A panorama as it was read.
pub(super) struct Panorama {
    frame: Frame,
    kind: PanoramaKind,
    name: String,
}

enum PanoramaKind {
    LatLong(Projection),
    Probe(Probe),
}

impl Panorama {
    /// Reads a panorama in any format that holds radiance; `-`: from standard input.
    pub fn read(path: &Path, how: PanoramaArguments) -> Result<Self> {
        let mut frame = Frame::default();
        let attributes = read(path, &mut frame).map_err(|error| error.with_kind(Kind::Failed))?;
        let name = display_name(path);
        if matches!(frame.pixels, Pixels::Codes(_)) {
            return Err(Error::failed(
                "holds raw sensor codes; a panorama of radiance is needed, OpenEXR or Radiance HDR",
            )
            .at(&name));
        }
        if attributes.overflowed > 0 {
            tracing::warn!(
                "{name}: {} samples are infinite, too bright for the file's numbers; taken as the largest of these",
                attributes.overflowed
            );
        }
        let (width, height, centres) = (frame.width, frame.height, attributes.latlong_centres);
        // A file that says it is lat-long, by the attribute `envmap`, is.
        let how = match centres {
            LatLongCentres::Ends => PanoramaArguments { layout: how.layout.or(Some(Layout::LatLong)) },
            LatLongCentres::Half => how,
        };
        let kind = match how.probe(width, height).map_err(|error| error.at(&name))? {
            Some(probe) => PanoramaKind::Probe(probe),
            None => {
                if let Some(note) = lat_long_note(width, height) {
                    tracing::warn!("{name}: {note}");
                }
                PanoramaKind::LatLong(Projection::LatLong { width, height, centres })
            }
        };
        Ok(Self { frame, kind, name })
    }

    /// A shape with as many pixels as the file has, but at most `most_columns` columns.
    #[cfg(feature = "render")]
    pub fn own_shape(&self, most_columns: usize) -> Result<PolarShape> {
        let Frame { width, height, .. } = self.frame;
        let columns = match self.kind {
            PanoramaKind::LatLong(_) => width,
            // Of the same solid angle a pixel, on average.
            PanoramaKind::Probe(_) => 2 * width.min(height),
        };
        let columns = columns.min(most_columns);
        let rows = match self.kind {
            PanoramaKind::LatLong(_) => (columns * height / width.max(1)).max(1),
            PanoramaKind::Probe(_) => columns.div_ceil(2),
        };
        Ok(PolarShape::new(columns, rows, PI)?)
    }

    /// Averages over the pixels of a map of this shape.
    pub fn map(&self, shape: PolarShape) -> Result<PolarMap> {
        Ok(self.maps(&[shape])?.swap_remove(0))
    }

    /// [`Self::map`] for several shapes.
    pub fn maps(&self, shapes: &[PolarShape]) -> Result<Vec<PolarMap>> {
        let Self { frame, kind, name } = self;
        let (response, mut counts) = (Response::default(), PixelCounts::default());
        let mut average = |&shape: &PolarShape| {
            let fault = |error| Error::from(error).with_kind(Kind::Failed).at(name);
            let mut map = PolarMap::black(shape);
            match kind {
                PanoramaKind::LatLong(projection) => {
                    let mut frame_to_polar = FrameToPolar::new(projection, DMat3::IDENTITY, shape)?;
                    counts = frame_to_polar.apply(frame, &response, &mut map).map_err(fault)?;
                }
                PanoramaKind::Probe(probe) => (map, counts) = probe.average(frame, shape).map_err(fault)?,
            }
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
