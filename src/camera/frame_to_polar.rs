//! Frame to polar map by exact area weights, METHODS section 4.
//!
//! Map pixel i has the radiance `sum_j (overlap_ij / Omega_i) L_j` over the frame's pixels j, with the overlap
//! and the map pixel's `Omega_i` in solid angle: constant frames give constant maps, and the map's power is the
//! frame's. The overlaps are those of polygons that tile the field of view (`footprints`), in the equal-area
//! cylinder where map pixels are rectangles (`overlap`).
//!
//! A frame is streamed once, in bands of rows that are turned into radiance in a buffer that stays in the
//! second-level cache. A band's part of the matrix is ordered by map pixel: chunks of four neighbouring pixels, with
//! a weight per pixel and two bytes per chunk, are added up in four lanes, and the lanes once per band and map pixel.
//! The map, small against frame and matrix, is what is accessed out of order.

use super::band_kernels::{
    BandMatrix, CHUNKS_MAX, Group, LANES, PLANE, add_band, decode_codes, decode_radiance,
};
use super::footprints::Footprints;
use super::overlap::OverlapGrid;
use super::{PixelCounts, Projection, Response};
use crate::error::{Error, Result};
use crate::image::{Frame, Pixels, PolarMap, PolarShape};
use glam::{DMat3, DQuat, Vec4};
use std::f64::consts::PI;
use std::ops::Range;

/// Pixels of a band, unless one row has more: their numbers have 16 bits, a plane of their radiance takes 128 KiB of
/// the second-level cache, and most map pixels have all of their rows in one or two bands.
const BAND_PIXELS: usize = 1 << 15;

/// The sparse matrix from a frame's pixels to a polar map's, for one lens, rotation and map.
#[derive(Clone, Debug)]
pub struct FrameToPolar {
    width: usize,
    height: usize,
    shape: PolarShape,
    /// Rows of the frame in a band; the last band may have fewer.
    band_rows: usize,
    bands: Vec<BandEnds>,
    /// Stretches of pixels that the map sees, numbered through the frame.
    spans: Vec<Range<u32>>,
    groups: Vec<Group>,
    cells: Vec<u32>,
    starts: Vec<u16>,
    weights: Vec<Vec4>,
    coverage: Vec<f32>,
    /// Radiance of the current band, one plane per channel.
    radiance: Vec<f32>,
    /// Map under construction, one plane per channel. In f64: a map pixel may be the sum of thousands of parts.
    sums: Vec<f64>,
}

/// Where a band's parts of the lists end; they start where the band before ended.
#[derive(Clone, Copy, Debug, Default)]
struct BandEnds {
    spans: usize,
    groups: usize,
    cells: usize,
    chunks: usize,
}

/// Overlap of one pixel of the current band with one map pixel.
#[derive(Clone, Copy, Debug)]
struct Overlap {
    cell: u32,
    /// Number in the band.
    pixel: u16,
    solid_angle_sr: f64,
}

/// Part of a map pixel: the chunks of one sum.
struct Part {
    cell: u32,
    chunks: Range<usize>,
}

impl FrameToPolar {
    /// Computes the matrix; seconds for millions of pixels. `world_from_camera` is a rotation; the default is
    /// [`super::LOOKING_UP`] for a fisheye and the identity for a lat-long picture.
    ///
    /// # Errors
    /// `Usage` for a matrix that is no rotation, for sizes beyond 65,535 a side or 2^27 pixels in all (frame and
    /// map), and for a map without pixels or beyond the sphere.
    pub fn new(projection: &Projection, world_from_camera: DMat3, shape: PolarShape) -> Result<Self> {
        projection.check_size()?;
        let world_from_camera = rotation(world_from_camera)?;
        check_shape(shape)?;
        let (width, height) = (projection.width(), projection.height());
        // A row alone has 65,535 pixels at most.
        let band_rows = (BAND_PIXELS / width).clamp(1, height);
        let mut matrix = Self {
            width,
            height,
            shape,
            band_rows,
            bands: Vec::with_capacity(height.div_ceil(band_rows)),
            spans: Vec::new(),
            groups: Vec::new(),
            cells: Vec::new(),
            starts: Vec::new(),
            weights: Vec::new(),
            coverage: Vec::new(),
            radiance: vec![0.0; 3 * PLANE],
            sums: vec![0.0; 3 * shape.len()],
        };
        let mut coverage_sr = vec![0.0f64; shape.len()];
        let mut grid = OverlapGrid::new(shape);
        let mut overlaps: Vec<Overlap> = Vec::new();
        Footprints::new(projection, world_from_camera).for_each(|row, column, polygon| {
            while matrix.bands.len() < row / band_rows {
                matrix.end_band(&mut overlaps);
            }
            let pixel = (row % band_rows * width + column) as u16;
            grid.overlaps(polygon, |cell, solid_angle_sr| {
                coverage_sr[cell] += solid_angle_sr;
                overlaps.push(Overlap { cell: cell as u32, pixel, solid_angle_sr });
            });
        });
        while matrix.bands.len() < height.div_ceil(band_rows) {
            matrix.end_band(&mut overlaps);
        }
        matrix.cells.shrink_to_fit();
        matrix.starts.shrink_to_fit();
        matrix.weights.shrink_to_fit();
        matrix.coverage = coverage_sr
            .iter()
            .enumerate()
            .map(|(cell, sr)| (sr / shape.pixel_solid_angle(cell / shape.columns)) as f32)
            .collect();
        Ok(matrix)
    }

    /// Turns the overlaps of a band into its matrix, and empties them.
    fn end_band(&mut self, overlaps: &mut Vec<Overlap>) {
        overlaps.sort_unstable_by_key(|overlap| (overlap.cell, overlap.pixel));
        // Pieces of one pixel that fall on the same map pixel.
        overlaps.dedup_by(|next, kept| {
            let same = (next.cell, next.pixel) == (kept.cell, kept.pixel);
            if same {
                kept.solid_angle_sr += next.solid_angle_sr;
            }
            same
        });
        let (mut starts, mut weights): (Vec<u16>, Vec<Vec4>) = (Vec::new(), Vec::new());
        let mut parts: Vec<Part> = Vec::new();
        for overlap in overlaps.iter() {
            let chunk = starts.len();
            let solid_angle_sr = self.shape.pixel_solid_angle(overlap.cell as usize / self.shape.columns);
            let weight = (overlap.solid_angle_sr / solid_angle_sr) as f32;
            match parts.last_mut().filter(|part| part.cell == overlap.cell) {
                Some(_) if usize::from(overlap.pixel - starts[chunk - 1]) < LANES => {
                    weights[chunk - 1][usize::from(overlap.pixel - starts[chunk - 1])] = weight;
                    continue;
                }
                Some(part) if part.chunks.len() < CHUNKS_MAX => part.chunks.end += 1,
                _ => parts.push(Part { cell: overlap.cell, chunks: chunk..chunk + 1 }),
            }
            starts.push(overlap.pixel);
            // Zeros, where they stay, meet pixels of the band or what an earlier one left, all finite.
            weights.push(Vec4::new(weight, 0.0, 0.0, 0.0));
        }
        // Stable: parts of one length stay in the map's order.
        parts.sort_by_key(|part| part.chunks.len());
        for group in parts.chunk_by(|a, b| a.chunks.len() == b.chunks.len()) {
            self.groups.push(Group { chunks: group[0].chunks.len() as u32, parts: group.len() as u32 });
        }
        for part in parts {
            self.cells.push(part.cell);
            self.starts.extend_from_slice(&starts[part.chunks.clone()]);
            self.weights.extend_from_slice(&weights[part.chunks]);
        }
        let first_span = self.spans.len();
        let first_pixel = (self.bands.len() * self.band_rows * self.width) as u32;
        overlaps.sort_unstable_by_key(|overlap| overlap.pixel);
        for overlap in overlaps.drain(..) {
            let pixel = first_pixel + u32::from(overlap.pixel);
            match self.spans[first_span..].last_mut() {
                Some(span) if pixel <= span.end => span.end = pixel + 1,
                _ => self.spans.push(pixel..pixel + 1),
            }
        }
        self.bands.push(BandEnds {
            spans: self.spans.len(),
            groups: self.groups.len(),
            cells: self.cells.len(),
            chunks: self.starts.len(),
        });
    }

    /// The map that frames become.
    pub fn shape(&self) -> PolarShape {
        self.shape
    }

    /// Fraction of every map pixel's solid angle that the frame sees, row-major. Where it is below 1, at the rim
    /// of the lens, the map is dimmer by as much: the energy is kept, not made up.
    pub fn coverage(&self) -> &[f32] {
        &self.coverage
    }

    /// Bytes of the matrix that every frame streams.
    pub fn streamed_bytes(&self) -> usize {
        size_of_val(self.cells.as_slice())
            + size_of_val(self.starts.as_slice())
            + size_of_val(self.weights.as_slice())
            + size_of_val(self.groups.as_slice())
            + size_of_val(self.spans.as_slice())
            + size_of_val(self.bands.as_slice())
    }

    /// Fills `map` from a frame of raw codes (through the response) or of linear radiance (as it is: the
    /// response is for codes) and gives it the frame's stamp. One channel fills all three. Returns the counts
    /// of the pixels that hold no radiance, among those that the map sees.
    ///
    /// Rounding stays below 1e-5 of every map pixel: weights and radiances are rounded once to f32, the sum
    /// of a map pixel's part in a band 70 times at most, and those are added in f64. Allocates only when `map` has another shape.
    ///
    /// # Errors
    /// `BadFrame`, naming what the frame has and what the calibration wants: size, channels, samples, and codes
    /// without a response.
    pub fn apply(&mut self, frame: &Frame, response: &Response, map: &mut PolarMap) -> Result<PixelCounts> {
        self.check_frame(frame, response)?;
        let cells = self.shape.len();
        let channels = frame.channels;
        self.sums[..channels * cells].fill(0.0);
        let mut counts = PixelCounts::default();
        let mut start = BandEnds::default();
        for (band, end) in self.bands.iter().enumerate() {
            let first_pixel = band * self.band_rows * self.width;
            for span in &self.spans[start.spans..end.spans] {
                let pixels = span.start as usize..span.end as usize;
                let samples = pixels.start * channels..pixels.end * channels;
                let planes = &mut self.radiance[pixels.start - first_pixel..];
                counts.add(&match &frame.pixels {
                    Pixels::Codes(codes) => {
                        let lookup = (response.table(), response.black_clip_code());
                        decode_codes(&codes[samples], channels, lookup, planes)
                    }
                    Pixels::Radiance(radiance) => decode_radiance(&radiance[samples], channels, planes),
                });
            }
            let matrix = BandMatrix {
                groups: &self.groups[start.groups..end.groups],
                cells: &self.cells[start.cells..end.cells],
                starts: &self.starts[start.chunks..end.chunks],
                weights: &self.weights[start.chunks..end.chunks],
            };
            let (planes, _) = self.radiance.as_chunks::<PLANE>();
            for (plane, sums) in planes.iter().zip(self.sums.chunks_exact_mut(cells)).take(channels) {
                add_band(matrix, plane, sums);
            }
            start = *end;
        }
        self.write(channels, map);
        map.stamp = frame.stamp;
        Ok(counts)
    }

    fn write(&self, channels: usize, map: &mut PolarMap) {
        if map.shape != self.shape || map.pixels.len() != self.shape.len() {
            *map = PolarMap::black(self.shape);
        }
        // Weights that add up to 1 + 1e-7 may lift the largest f32 over the edge.
        let round = |sum: f64| sum.min(f64::from(f32::MAX)) as f32;
        let cells = self.shape.len();
        if channels == 1 {
            for (pixel, &sum) in map.pixels.iter_mut().zip(&self.sums) {
                *pixel = [round(sum); 3];
            }
        } else {
            for (cell, pixel) in map.pixels.iter_mut().enumerate() {
                *pixel = std::array::from_fn(|channel| round(self.sums[channel * cells + cell]));
            }
        }
    }

    fn check_frame(&self, frame: &Frame, response: &Response) -> Result<()> {
        let Frame { width, height, channels, .. } = *frame;
        if (width, height) != (self.width, self.height) {
            return Err(Error::bad_frame(format!(
                "the frame has {width} x {height} pixels, its calibration is for {} x {}",
                self.width, self.height
            )));
        }
        if channels != 1 && channels != 3 {
            return Err(Error::bad_frame(format!(
                "the frame has {channels} channels, 1 (luminance) or 3 (RGB) can be used"
            )));
        }
        let (samples, coded) = match &frame.pixels {
            Pixels::Codes(codes) => (codes.len(), true),
            Pixels::Radiance(radiance) => (radiance.len(), false),
        };
        if samples != width * height * channels {
            return Err(Error::bad_frame(format!(
                "the frame has {samples} samples, {width} x {height} pixels of {channels} channels are {}",
                width * height * channels
            )));
        }
        if coded && response.is_identity() {
            return Err(Error::bad_frame(
                "the frame holds raw sensor codes, its calibration has no response; add one (logarithmic, \
                 linear or piecewise-linear)",
            ));
        }
        Ok(())
    }
}

/// Refuses what is no rotation, and takes the last digits' errors out of what nearly is one.
fn rotation(world_from_camera: DMat3) -> Result<DMat3> {
    let off = world_from_camera * world_from_camera.transpose() - DMat3::IDENTITY;
    let worst = off
        .to_cols_array()
        .into_iter()
        .fold(0.0f64, |worst, value| if value.is_nan() { f64::INFINITY } else { worst.max(value.abs()) });
    // Files give rotations with six digits or more; what is further off is a scale, a shear or a mistake.
    if worst > 1e-5 || world_from_camera.determinant() <= 0.0 {
        return Err(Error::usage(format!(
            "world_from_camera {:?} is not a rotation: its rows must be perpendicular unit vectors, \
             right-handed (off by {worst:.1e}, determinant {:.6})",
            world_from_camera.transpose().to_cols_array_2d(),
            world_from_camera.determinant(),
        )));
    }
    // An exact matrix stays as it is.
    Ok(if worst > 1e-14 {
        DMat3::from_quat(DQuat::from_mat3(&world_from_camera).normalize())
    } else {
        world_from_camera
    })
}

fn check_shape(shape: PolarShape) -> Result<()> {
    let PolarShape { columns, rows, theta_max_rad } = shape;
    if columns == 0 || rows == 0 || columns > 65_535 || rows > 65_535 || columns * rows > 1 << 27 {
        return Err(Error::usage(format!(
            "polar map of {columns} x {rows} pixels: must be at least 1 x 1, at most 65535 a side and 2^27 in all"
        )));
    }
    if !(theta_max_rad > 0.0 && theta_max_rad <= PI + 1e-12) {
        return Err(Error::usage(format!(
            "polar map down to {} degrees: must be over 0, at most 180",
            theta_max_rad.to_degrees()
        )));
    }
    Ok(())
}
