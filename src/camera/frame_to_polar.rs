//! Frame to polar map by exact area weights, METHODS section 4.
//!
//! Map pixel i has the radiance `sum_j (overlap_ij / Omega_i) L_j` over the frame's pixels j, with the overlap
//! and the map pixel's `Omega_i` in solid angle: constant frames give constant maps, and the map's power is the
//! frame's. The overlaps are those of polygons that tile the field of view (`footprints`), in the equal-area
//! cylinder where map pixels are rectangles (`overlap`).
//!
//! The matrix is stored in the frame's order: a frame is streamed once, each row is turned into radiance in a
//! buffer that stays in the first-level cache, and runs of neighbouring pixels that fall on the same map pixel
//! are added up with one weight per pixel and eight bytes per run. The map, small against frame and matrix, is
//! what is accessed out of order.

use super::footprints::Footprints;
use super::overlap::OverlapGrid;
use super::row_kernels::{CHUNKS_MAX, LANES, Run, ShortRuns, add_runs, decode_codes, decode_radiance};
use super::{PixelCounts, Projection, Response};
use crate::error::{Error, Result};
use crate::image::{Frame, Pixels, PolarMap, PolarShape};
use glam::{DMat3, DQuat};
use std::f64::consts::PI;
use std::ops::Range;

/// The sparse matrix from a frame's pixels to a polar map's, for one lens, rotation and map.
#[derive(Clone, Debug)]
pub struct FrameToPolar {
    width: usize,
    height: usize,
    shape: PolarShape,
    rows: Vec<RowEnds>,
    /// Stretches of columns that the map sees.
    spans: Vec<Range<u16>>,
    runs: Vec<Run>,
    weights: Vec<f32>,
    coverage: Vec<f32>,
    /// Radiance of the current row, one plane per channel.
    radiance: Vec<f32>,
    /// Map under construction, one plane per channel. In f64: a map pixel may be the sum of thousands of runs.
    sums: Vec<f64>,
}

/// Where a row's parts end; they start where the row before ended.
#[derive(Clone, Copy, Debug, Default)]
struct RowEnds {
    spans: usize,
    runs: usize,
    weights: usize,
    short: ShortRuns,
}

/// Overlap of one pixel of the current row with one map pixel.
#[derive(Clone, Copy, Debug)]
struct Overlap {
    cell: u32,
    column: u16,
    solid_angle_sr: f64,
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
        let mut matrix = Self {
            width,
            height,
            shape,
            rows: Vec::with_capacity(height),
            spans: Vec::new(),
            runs: Vec::new(),
            weights: Vec::new(),
            coverage: Vec::new(),
            radiance: vec![0.0; 3 * (width + LANES)],
            sums: vec![0.0; 3 * shape.len()],
        };
        let mut coverage_sr = vec![0.0f64; shape.len()];
        let mut grid = OverlapGrid::new(shape);
        let mut overlaps: Vec<Overlap> = Vec::new();
        Footprints::new(projection, world_from_camera).for_each(|row, column, polygon| {
            while matrix.rows.len() < row {
                matrix.end_row(&mut overlaps);
            }
            grid.overlaps(polygon, |cell, solid_angle_sr| {
                coverage_sr[cell] += solid_angle_sr;
                overlaps.push(Overlap { cell: cell as u32, column: column as u16, solid_angle_sr });
            });
        });
        while matrix.rows.len() < height {
            matrix.end_row(&mut overlaps);
        }
        matrix.runs.shrink_to_fit();
        matrix.weights.shrink_to_fit();
        matrix.coverage = coverage_sr
            .iter()
            .enumerate()
            .map(|(cell, sr)| (sr / shape.pixel_solid_angle(cell / shape.columns)) as f32)
            .collect();
        Ok(matrix)
    }

    /// Turns the overlaps of a row into runs, and empties them.
    fn end_row(&mut self, overlaps: &mut Vec<Overlap>) {
        overlaps.sort_unstable_by_key(|overlap| (overlap.cell, overlap.column));
        // Pieces of one pixel that fall on the same map pixel.
        overlaps.dedup_by(|next, kept| {
            let same = (next.cell, next.column) == (kept.cell, kept.column);
            if same {
                kept.solid_angle_sr += next.solid_angle_sr;
            }
            same
        });
        let mut runs: Vec<&[Overlap]> = Vec::new();
        let mut rest = overlaps.as_slice();
        while let Some(first) = rest.first() {
            let length = rest
                .iter()
                .take(CHUNKS_MAX * LANES)
                .zip(0u32..)
                .take_while(|(next, index)| {
                    next.cell == first.cell && u32::from(next.column) == u32::from(first.column) + index
                })
                .count();
            let (run, after) = rest.split_at(length);
            runs.push(run);
            rest = after;
        }
        // Stable: runs of one length stay in the map's order.
        runs.sort_by_key(|run| run.len().div_ceil(LANES));
        let mut short = ShortRuns::default();
        for run in runs {
            let first = run[0];
            let solid_angle_sr = self.shape.pixel_solid_angle(first.cell as usize / self.shape.columns);
            self.weights.extend(run.iter().map(|overlap| (overlap.solid_angle_sr / solid_angle_sr) as f32));
            // Filled up with zeros: they meet pixels of the row or the fill behind it, all finite.
            self.weights.resize(self.weights.len().next_multiple_of(LANES), 0.0);
            let chunks = run.len().div_ceil(LANES) as u16;
            short.of_one += usize::from(chunks == 1);
            short.of_two += usize::from(chunks == 2);
            self.runs.push(Run { cell: first.cell, start: first.column, chunks });
        }
        let first_span = self.spans.len();
        overlaps.sort_unstable_by_key(|overlap| overlap.column);
        for overlap in overlaps.drain(..) {
            match self.spans[first_span..].last_mut() {
                Some(span) if overlap.column <= span.end => span.end = overlap.column + 1,
                _ => self.spans.push(overlap.column..overlap.column + 1),
            }
        }
        self.rows.push(RowEnds {
            spans: self.spans.len(),
            runs: self.runs.len(),
            weights: self.weights.len(),
            short,
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
        size_of_val(self.runs.as_slice())
            + size_of_val(self.weights.as_slice())
            + size_of_val(self.spans.as_slice())
            + size_of_val(self.rows.as_slice())
    }

    /// Fills `map` from a frame of raw codes (through the response) or of linear radiance (as it is: the
    /// response is for codes) and gives it the frame's stamp. One channel fills all three. Returns the counts
    /// of the pixels that hold no radiance, among those that the map sees.
    ///
    /// Rounding stays below 1e-5 of every map pixel: weights and radiances are rounded once to f32, a run's
    /// sum 70 times at most, and runs are added in f64. Allocates only when `map` has another shape.
    ///
    /// # Errors
    /// `BadFrame`, naming what the frame has and what the calibration wants: size, channels, samples, and codes
    /// without a response.
    pub fn apply(&mut self, frame: &Frame, response: &Response, map: &mut PolarMap) -> Result<PixelCounts> {
        self.check_frame(frame, response)?;
        let stride = self.width + LANES;
        let cells = self.shape.len();
        let (channels, row_samples) = (frame.channels, self.width * frame.channels);
        self.sums[..channels * cells].fill(0.0);
        let mut counts = PixelCounts::default();
        let mut start = RowEnds::default();
        for (row, end) in self.rows.iter().enumerate() {
            for span in &self.spans[start.spans..end.spans] {
                let columns = usize::from(span.start)..usize::from(span.end);
                let samples =
                    row * row_samples + columns.start * channels..row * row_samples + columns.end * channels;
                let planes = &mut self.radiance[columns.start..];
                counts.add(&match &frame.pixels {
                    Pixels::Codes(codes) => {
                        let lookup = (response.table(), response.black_clip_code());
                        decode_codes(&codes[samples], channels, lookup, planes, stride)
                    }
                    Pixels::Radiance(radiance) => {
                        decode_radiance(&radiance[samples], channels, planes, stride)
                    }
                });
            }
            for channel in 0..channels {
                add_runs(
                    &self.runs[start.runs..end.runs],
                    end.short,
                    &self.weights[start.weights..end.weights],
                    &self.radiance[channel * stride..(channel + 1) * stride],
                    &mut self.sums[channel * cells..(channel + 1) * cells],
                );
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
