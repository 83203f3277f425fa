//! Upright lat-long picture to polar map without a matrix.
//!
//! Both are divided along polar angle and azimuth alone, so the overlap of two pixels is the product of one
//! of their rows, in cosines, and one of their columns, in turns. What takes a matrix as many weights as the
//! picture has pixels then takes as many as it has rows and the map has columns.

use super::PixelCounts;
use super::band_kernels::{PLANE, decode_codes, decode_radiance};
use super::projection::border_fraction;
use super::response::CodeLookup;
use crate::image::{Frame, LatLongCentres, Pixels, PolarShape};
use crate::math::zone_solid_angle;
use multiversion::multiversion;
use std::f64::consts::PI;

/// Azimuth of a picture's left border, in turns.
const LEFT_BORDER: f64 = -0.25;

/// The weights of rows and columns.
#[derive(Clone, Debug)]
pub(super) struct LatLongWeights {
    /// Where the parts of each row of the picture end; they start where those of the row above end.
    row_ends: Vec<usize>,
    row_parts: Vec<RowPart>,
    /// In the order of the map's columns; one that the border of the picture cuts comes twice.
    spans: Vec<Span>,
    /// Of one row of the picture, by the map's columns.
    column_sums: Vec<f64>,
}

/// The part of a row of the picture in one of the map.
#[derive(Clone, Copy, Debug)]
struct RowPart {
    map_row: usize,
    /// Of the map's row.
    share: f64,
}

/// Neighbouring columns of the picture in one of the map, with their shares of that.
#[derive(Clone, Copy, Debug)]
struct Span {
    map_column: usize,
    first: usize,
    last: usize,
    first_share: f64,
    /// Of each between the two.
    inner_share: f64,
    /// 0 where it is the first.
    last_share: f64,
}

impl LatLongWeights {
    /// For pictures of `width` x `height`. The share of every map pixel that they cover is whole.
    pub(super) fn new(width: usize, height: usize, centres: LatLongCentres, shape: PolarShape) -> Self {
        let mut row_parts = Vec::new();
        let theta_rad = |line: usize| PI * border_fraction(line as f64, height, centres);
        let mut map_row = 0;
        let row_ends = (0..height)
            .map(|row| {
                let (top, bottom) = (theta_rad(row), theta_rad(row + 1));
                while map_row < shape.rows() && shape.theta_edge_rad(map_row) < bottom {
                    let (start, end) = (shape.theta_edge_rad(map_row), shape.theta_edge_rad(map_row + 1));
                    let overlap_sr = zone_solid_angle(top.max(start), bottom.min(end), 1.0);
                    if overlap_sr > 0.0 {
                        let share = overlap_sr / zone_solid_angle(start, end, 1.0);
                        row_parts.push(RowPart { map_row, share });
                    }
                    if end > bottom {
                        break;
                    }
                    map_row += 1;
                }
                row_parts.len()
            })
            .collect();
        Self {
            row_ends,
            row_parts,
            spans: spans(width, centres, shape.columns()),
            column_sums: vec![0.0; shape.columns()],
        }
    }

    /// Adds a frame to the sums of the map, one plane per channel. Rows that the map does not see are not
    /// looked at.
    pub(super) fn add(
        &mut self,
        frame: &Frame,
        lookup: CodeLookup,
        radiance: &mut [f32],
        sums: &mut [f64],
    ) -> PixelCounts {
        let Frame { width, channels, .. } = *frame;
        let columns = self.column_sums.len();
        let cells = sums.len() / channels;
        let mut counts = PixelCounts::default();
        let mut start = 0;
        for (row, &end) in self.row_ends.iter().enumerate() {
            let parts = &self.row_parts[std::mem::replace(&mut start, end)..end];
            if parts.is_empty() {
                continue;
            }
            let samples = row * width * channels..(row + 1) * width * channels;
            counts.add(&match &frame.pixels {
                Pixels::Codes(codes) => decode_codes(&codes[samples], channels, lookup, radiance),
                Pixels::Radiance(values) => {
                    decode_radiance(&values[samples], channels, frame.saturation, radiance)
                }
            });
            for (plane, sums) in radiance.chunks(PLANE).zip(sums.chunks_exact_mut(cells)) {
                self.column_sums.fill(0.0);
                add_spans(&self.spans, &plane[..width], &mut self.column_sums);
                for part in parts {
                    let sums = &mut sums[part.map_row * columns..][..columns];
                    for (sum, column_sum) in sums.iter_mut().zip(&self.column_sums) {
                        *sum += part.share * column_sum;
                    }
                }
            }
        }
        counts
    }

    /// Bytes of the weights.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.row_ends.as_slice())
            + size_of_val(self.row_parts.as_slice())
            + size_of_val(self.spans.as_slice())
    }
}

/// The columns of a picture of `width` in each of the map's.
fn spans(width: usize, centres: LatLongCentres, map_columns: usize) -> Vec<Span> {
    let border = |column: usize| border_fraction(column as f64, width, centres);
    let mut spans = Vec::with_capacity(map_columns + 1);
    for map_column in 0..map_columns {
        let edge = |index: usize| index as f64 / map_columns as f64 - LEFT_BORDER;
        let (start, end) = (edge(map_column), edge(map_column + 1));
        // The picture is there once for every turn.
        for turn in [0.0, 1.0] {
            let (start, end) = ((start - turn).max(0.0), (end - turn).min(1.0));
            let share = |column: usize| {
                (border(column + 1).min(end) - border(column).max(start)).max(0.0) * map_columns as f64
            };
            if end <= start {
                continue;
            }
            // Borders are in order; the pixels found are those that share more than nothing.
            let first = partition(width, |column| border(column + 1) <= start);
            let last = partition(width, |column| border(column + 1) < end).min(width - 1);
            let is_one = first >= last;
            spans.push(Span {
                map_column,
                first: first.min(last),
                last,
                first_share: share(first.min(last)),
                inner_share: if last > first + 1 { share(first + 1) } else { 0.0 },
                last_share: if is_one { 0.0 } else { share(last) },
            });
        }
    }
    spans
}

/// The first of `0..count` for which `is_before` is false; `count` if there is none.
fn partition(count: usize, is_before: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (0, count);
    while low < high {
        let middle = usize::midpoint(low, high);
        if is_before(middle) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    low
}

/// `column_sums[span] += shares . values` for every span.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn add_spans(spans: &[Span], values: &[f32], column_sums: &mut [f64]) {
    for span in spans {
        let first = span.first_share * f64::from(values[span.first]);
        let last = span.last_share * f64::from(values[span.last]);
        let inner = if span.inner_share > 0.0 {
            let (lanes, rest) = values[span.first + 1..span.last].as_chunks::<4>();
            let mut sums = [0.0; 4];
            for values in lanes {
                for (sum, &value) in sums.iter_mut().zip(values) {
                    *sum += f64::from(value);
                }
            }
            let rest: f64 = rest.iter().map(|&value| f64::from(value)).sum();
            span.inner_share * ((sums[0] + sums[2]) + (sums[1] + sums[3]) + rest)
        } else {
            0.0
        };
        column_sums[span.map_column] += first + inner + last;
    }
}

#[cfg(test)]
mod tests {
    use super::super::{FrameToPolar, Projection, Response};
    use super::*;
    use crate::image::PolarMap;
    use crate::test_data::noise;

    #[test]
    fn shares_of_every_map_pixel_add_up_to_the_whole_of_it() {
        for (width, height, shape) in [
            (1, 1, PolarShape::sphere(5, 3)),
            (64, 32, PolarShape::sphere(360, 180)),
            (2048, 1024, PolarShape::hemisphere(360, 90)),
            (37, 11, PolarShape::sphere(16, 7)),
            (1021, 509, PolarShape::new(77, 31, 2.0).unwrap()),
        ] {
            for centres in [LatLongCentres::Half, LatLongCentres::Ends] {
                let weights = LatLongWeights::new(width, height, centres, shape);
                let mut rows = vec![0.0; shape.rows()];
                weights.row_parts.iter().for_each(|part| rows[part.map_row] += part.share);
                let mut columns = vec![0.0; shape.columns()];
                for span in &weights.spans {
                    let inner = span.last.saturating_sub(span.first + 1) as f64;
                    columns[span.map_column] += span.first_share + inner * span.inner_share + span.last_share;
                }
                let worst =
                    rows.iter().chain(&columns).map(|sum: &f64| (sum - 1.0).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-11, "{width} x {height} {centres:?} {shape:?}: {worst:e}");
            }
        }
    }

    #[test]
    fn maps_are_those_of_the_matrix() {
        for (width, height, shape) in [
            (64, 32, PolarShape::sphere(36, 18)),
            (64, 32, PolarShape::sphere(90, 50)),
            (91, 47, PolarShape::hemisphere(40, 9)),
            (33, 21, PolarShape::new(16, 7, 2.0).unwrap()),
        ] {
            for centres in [LatLongCentres::Half, LatLongCentres::Ends] {
                let values: Vec<f32> = (0..width * height * 3)
                    .map(|index| match index % 97 {
                        0 => f32::NAN,
                        1 => -1.0,
                        2 => f32::INFINITY,
                        _ => 1e4 * noise(index).powi(8),
                    })
                    .collect();
                let pixels = Pixels::Radiance(values);
                let frame = Frame { width, height, channels: 3, pixels, ..Frame::default() };
                let projection = Projection::LatLong { width, height, centres };
                let response = Response::default();
                let map_of = |mut frame_to_polar: FrameToPolar| {
                    let mut map = PolarMap::black(shape);
                    let counts = frame_to_polar.apply(&frame, &response, &mut map).unwrap();
                    (map, counts, frame_to_polar.coverage().to_vec())
                };
                let (map, counts, coverage) =
                    map_of(FrameToPolar::new(&projection, glam::DMat3::IDENTITY, shape).unwrap());
                let (expected, expected_counts, expected_coverage) =
                    map_of(FrameToPolar::by_matrix(&projection, glam::DMat3::IDENTITY, shape));
                assert_eq!(counts, expected_counts, "{width} x {height} {centres:?}");
                for (found, expected) in coverage.iter().zip(expected_coverage) {
                    assert!((found - expected).abs() < 1e-5, "{found} {expected}");
                }
                for (found, expected) in map.pixels.iter().flatten().zip(expected.pixels.iter().flatten()) {
                    assert!(
                        (found - expected).abs() <= 1e-5 * expected,
                        "{width} x {height} {centres:?}: {found} {expected}"
                    );
                }
            }
        }
    }
}
