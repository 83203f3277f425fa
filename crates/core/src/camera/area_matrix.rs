//! The sparse matrix from the pixels of one picture to those of a polar map.
//!
//! It is applied in bands of the picture's rows, so that a band's radiance stays in the second-level cache. A
//! band's part of the matrix is ordered by map pixel: chunks of four neighbouring pixels, with a weight per
//! pixel and two bytes per chunk, are added up in four lanes, and the lanes are added once per band and map
//! pixel. Only the map, which is small compared with picture and matrix, is accessed out of order.

use super::band_kernels::{BandMatrix, CHUNKS_MAX, Group, LANES, PLANE, add_band};
use super::footprints::Footprints;
use super::overlap::OverlapGrid;
use crate::image::PolarShape;
use glam::Vec4;
use std::ops::Range;

/// Pixels of a band, unless one row has more: their indices fit in 16 bits, a plane of their radiance takes
/// 128 KiB of the second-level cache, and most map pixels have all of their rows in one or two bands.
const BAND_PIXELS: usize = 1 << 15;

/// Weights of one picture, band by band.
#[derive(Clone, Debug)]
pub(super) struct AreaMatrix {
    width: usize,
    shape: PolarShape,
    /// Rows of the picture in a band; the last band may have fewer.
    band_rows: usize,
    bands: Vec<BandEnds>,
    /// Ranges of pixels that the map sees, as indices into the picture.
    spans: Vec<Range<u32>>,
    groups: Vec<Group>,
    cells: Vec<u32>,
    starts: Vec<u16>,
    weights: Vec<Vec4>,
}

/// Where a band's parts of the lists end; they start where those of the previous band end.
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
    /// Index in the band.
    pixel: u16,
    solid_angle_sr: f64,
}

/// Part of a map pixel: the chunks of one sum.
struct Part {
    cell: u32,
    chunks: Range<usize>,
}

impl AreaMatrix {
    /// Computes the weights of a picture's pixels, for sizes that have been checked. They are multiplied by
    /// `share`, the part of its channel's radiance that comes from this picture. The solid angle of every map
    /// pixel that the picture sees is added to `coverage_sr`, whatever the share.
    pub(super) fn new(
        mut footprints: Footprints,
        shape: PolarShape,
        share: f64,
        coverage_sr: &mut [f64],
    ) -> Self {
        let [width, height] = footprints.size();
        // A row alone has 65,535 pixels at most.
        let band_rows = (BAND_PIXELS / width).clamp(1, height);
        let mut matrix = Self {
            width,
            shape,
            band_rows,
            bands: Vec::with_capacity(height.div_ceil(band_rows)),
            spans: Vec::new(),
            groups: Vec::new(),
            cells: Vec::new(),
            starts: Vec::new(),
            weights: Vec::new(),
        };
        let mut grid = OverlapGrid::new(shape);
        let mut overlaps: Vec<Overlap> = Vec::new();
        footprints.for_each(|row, column, polygon| {
            while matrix.bands.len() < row / band_rows {
                matrix.end_band(share, &mut overlaps);
            }
            let pixel = (row % band_rows * width + column) as u16;
            grid.overlaps(polygon, |cell, solid_angle_sr| {
                coverage_sr[cell] += solid_angle_sr;
                overlaps.push(Overlap { cell: cell as u32, pixel, solid_angle_sr });
            });
        });
        while matrix.bands.len() < height.div_ceil(band_rows) {
            matrix.end_band(share, &mut overlaps);
        }
        matrix.cells.shrink_to_fit();
        matrix.starts.shrink_to_fit();
        matrix.weights.shrink_to_fit();
        matrix
    }

    /// Turns the overlaps of a band into its matrix, and empties them.
    fn end_band(&mut self, share: f64, overlaps: &mut Vec<Overlap>) {
        overlaps.sort_unstable_by_key(|overlap| (overlap.cell, overlap.pixel));
        // Joins the pieces of one pixel that fall on the same map pixel.
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
            let solid_angle_sr = self.shape.pixel_solid_angle(overlap.cell as usize / self.shape.columns());
            let weight = (share * overlap.solid_angle_sr / solid_angle_sr) as f32;
            match parts.last_mut().filter(|part| part.cell == overlap.cell) {
                Some(_) if usize::from(overlap.pixel - starts[chunk - 1]) < LANES => {
                    weights[chunk - 1][usize::from(overlap.pixel - starts[chunk - 1])] = weight;
                    continue;
                }
                Some(part) if part.chunks.len() < CHUNKS_MAX => part.chunks.end += 1,
                _ => parts.push(Part { cell: overlap.cell, chunks: chunk..chunk + 1 }),
            }
            starts.push(overlap.pixel);
            // Weights that stay zero multiply pixels of this band or values left by an earlier one, all of
            // them finite.
            weights.push(Vec4::new(weight, 0.0, 0.0, 0.0));
        }
        // The sort is stable: parts of equal length stay in the map's order.
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

    /// Number of bands.
    pub(super) fn band_count(&self) -> usize {
        self.bands.len()
    }

    /// Index in the picture of the first pixel of a band.
    pub(super) fn first_pixel(&self, band: usize) -> usize {
        band * self.band_rows * self.width
    }

    /// The ranges of a band's pixels that the map sees, as indices into the picture.
    pub(super) fn spans(&self, band: usize) -> impl Iterator<Item = Range<usize>> {
        self.spans[self.start(band).spans..self.bands[band].spans]
            .iter()
            .map(|span| span.start as usize..span.end as usize)
    }

    /// Adds a band's contribution to the map's sums. `radiance` starts with the band's first pixel; pixels
    /// outside the spans only have to be finite.
    pub(super) fn add(&self, band: usize, radiance: &[f32; PLANE], sums: &mut [f64]) {
        let (start, end) = (self.start(band), self.bands[band]);
        let matrix = BandMatrix {
            groups: &self.groups[start.groups..end.groups],
            cells: &self.cells[start.cells..end.cells],
            starts: &self.starts[start.chunks..end.chunks],
            weights: &self.weights[start.chunks..end.chunks],
        };
        add_band(matrix, radiance, sums);
    }

    fn start(&self, band: usize) -> BandEnds {
        band.checked_sub(1).map_or(BandEnds::default(), |before| self.bands[before])
    }

    /// Bytes that every frame streams.
    pub(super) fn streamed_bytes(&self) -> usize {
        size_of_val(self.cells.as_slice())
            + size_of_val(self.starts.as_slice())
            + size_of_val(self.weights.as_slice())
            + size_of_val(self.groups.as_slice())
            + size_of_val(self.spans.as_slice())
            + size_of_val(self.bands.as_slice())
    }
}
