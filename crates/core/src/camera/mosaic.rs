//! The four pictures in a frame of a mosaic sensor.
//!
//! The pixels at one position in the mosaic's period of two columns and two rows form a picture of their own,
//! half as wide and half as high. Its pixels have the area of four and the centre of the one that saw the
//! light, so every picture tiles the field of view: constants and power are preserved for every colour, and
//! no colour is shifted against another. Pixels that began where the period begins would shift it by half a
//! pixel of the frame. At the border of the frame the pixels are cut or extended, so that all four pictures
//! see the same field.

use super::area_matrix::AreaMatrix;
use super::band_kernels::{PLANE, decode_codes_of_pairs};
use super::footprints::Footprints;
use super::response::CodeLookup;
use super::{LensParameters, PixelCounts, Projection};
use crate::error::{Error, Result};
use crate::image::{Bayer, PolarShape};
use glam::DMat3;
use std::ops::Range;

/// The weights of a mosaic's four pictures.
#[derive(Clone, Debug)]
pub(super) struct Mosaic {
    bayer: Bayer,
    /// Columns of the frame.
    width: usize,
    planes: Vec<Plane>,
}

/// One of the four pictures.
#[derive(Clone, Debug)]
struct Plane {
    /// Its position in the period.
    column: usize,
    row: usize,
    channel: usize,
    matrix: AreaMatrix,
}

impl Mosaic {
    /// Computes the weights; projection, rotation and map have been checked. The solid angle of every map
    /// pixel that the frame sees with each of its colours is added to `coverage_sr`.
    pub(super) fn new(
        projection: &Projection,
        bayer: Bayer,
        world_from_camera: DMat3,
        shape: PolarShape,
        coverage_sr: &mut [f64],
    ) -> Result<Self> {
        let Projection::Fisheye(lens) = projection else {
            return Err(Error::usage(format!(
                "a lat-long panorama is no mosaic of colours {bayer}: frames of a mosaic come through a fisheye lens"
            ))
            .in_option("projection", None));
        };
        let LensParameters { width, height, .. } = *lens.parameters();
        for (name, side_px) in [("width", width), ("height", height)] {
            if side_px % 2 != 0 {
                return Err(Error::usage(format!(
                    "frames in a mosaic of colours {bayer} have even columns and rows, whole periods of the mosaic; \
                     crop them by a column or row at the right or lower side and change the lens's {name}"
                ))
                .in_option(name, Some(&side_px)));
            }
        }
        let channels = bayer.channels();
        let mut planes = Vec::with_capacity(4);
        // The four see the same, up to rounding.
        let mut seen_sr = vec![0.0; shape.len()];
        for place in 0..4 {
            let (column, row, channel) = (place % 2, place / 2, channels[place]);
            let share = 1.0 / channels.iter().filter(|other| **other == channel).count() as f64;
            let footprints = Footprints::of_place(projection, world_from_camera, [column, row]);
            let matrix = AreaMatrix::new(footprints, shape, share, &mut seen_sr);
            planes.push(Plane { column, row, channel, matrix });
        }
        for (coverage, seen) in coverage_sr.iter_mut().zip(seen_sr) {
            *coverage += 0.25 * seen;
        }
        Ok(Self { bayer, width, planes })
    }

    pub(super) fn bayer(&self) -> Bayer {
        self.bayer
    }

    /// Bytes of the matrices that every frame streams.
    pub(super) fn streamed_bytes(&self) -> usize {
        self.planes.iter().map(|plane| plane.matrix.streamed_bytes()).sum()
    }

    /// Adds a frame's codes to the sums of its colours, one plane per channel.
    pub(super) fn add(
        &self,
        codes: &[u16],
        lookup: CodeLookup,
        radiance: &mut [f32; PLANE],
        sums: &mut [f64],
    ) -> PixelCounts {
        let cells = sums.len() / 3;
        let mut counts = PixelCounts::default();
        // The four have the same bands. They are processed band by band, so that the frame is read from
        // memory once and not once per colour.
        for band in 0..self.planes[0].matrix.band_count() {
            for plane in &self.planes {
                let first_pixel = plane.matrix.first_pixel(band);
                for pixels in plane.matrix.spans(band).flat_map(|span| split_at_rows(span, self.width / 2)) {
                    let (row, column) = (pixels.start / (self.width / 2), pixels.start % (self.width / 2));
                    let first = (2 * row + plane.row) * self.width + 2 * column;
                    let (pairs, _) = codes[first..first + 2 * pixels.len()].as_chunks::<2>();
                    let radiance = &mut radiance[pixels.start - first_pixel..];
                    counts.add(&decode_codes_of_pairs(pairs, plane.column, lookup, radiance));
                }
                plane.matrix.add(band, radiance, &mut sums[plane.channel * cells..][..cells]);
            }
        }
        counts
    }
}

/// A range of pixels of a picture, row by row.
fn split_at_rows(pixels: Range<usize>, width: usize) -> impl Iterator<Item = Range<usize>> {
    let (first, last) = (pixels.start / width, pixels.end.div_ceil(width));
    (first..last).map(move |row| pixels.start.max(row * width)..pixels.end.min((row + 1) * width))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_are_split_where_rows_end() {
        let split = |pixels| split_at_rows(pixels, 10).map(|row| (row.start, row.end)).collect::<Vec<_>>();
        assert_eq!(split(3..7), [(3, 7)]);
        assert_eq!(split(3..10), [(3, 10)]);
        assert_eq!(split(10..11), [(10, 11)]);
        assert_eq!(split(8..32), [(8, 10), (10, 20), (20, 30), (30, 32)]);
    }
}
