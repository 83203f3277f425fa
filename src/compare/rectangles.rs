//! Recursive bisection of a map into rectangles of rows and columns, shared by median cut and variance
//! minimisation.

use super::spare_lights::fill_up;
use glam::DVec3;
use lightcast_core::image::{PolarMap, luminance_f64};
use lightcast_core::light::{Light, Share};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

/// A rectangle of pixels of a map; at least one pixel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Rectangle {
    pub(super) rows: Range<usize>,
    pub(super) columns: Range<usize>,
}

/// The axis along which a rectangle is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Axis {
    Rows,
    Columns,
}

impl Rectangle {
    /// Number of slices along an axis.
    pub(super) fn length(&self, axis: Axis) -> usize {
        match axis {
            Axis::Rows => self.rows.len(),
            Axis::Columns => self.columns.len(),
        }
    }

    /// The rectangle of the first `length` slices along an axis, and that of the others.
    pub(super) fn cut(&self, axis: Axis, length: usize) -> [Self; 2] {
        let (mut first, mut second) = (self.clone(), self.clone());
        let (first_range, second_range) = match axis {
            Axis::Rows => (&mut first.rows, &mut second.rows),
            Axis::Columns => (&mut first.columns, &mut second.columns),
        };
        first_range.end = first_range.start + length;
        second_range.start = first_range.end;
        [first, second]
    }
}

/// A map with precomputed factors for the shares of its pixels.
#[derive(Debug)]
pub(super) struct Pixels<'a> {
    map: &'a PolarMap,
    /// Cosine and sine of the azimuth, per column.
    azimuths: Vec<[f64; 2]>,
    /// Sine and cosine of the polar angle, and solid angle of a pixel, per row.
    rows: Vec<[f64; 3]>,
}

/// Whether pixels are taken as they are, or as if each had a radiance of 1 in every channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Content {
    Light,
    Even,
}

impl<'a> Pixels<'a> {
    pub(super) fn new(map: &'a PolarMap) -> Self {
        let shape = map.shape;
        let row = |row: usize| {
            let (sin, cos) = (shape.theta_max_rad() * (row as f64 + 0.5) / shape.rows() as f64).sin_cos();
            [sin, cos, shape.pixel_solid_angle(row)]
        };
        Self { map, azimuths: shape.column_azimuths(), rows: (0..shape.rows()).map(row).collect() }
    }

    /// The rectangle of all pixels.
    pub(super) fn whole(&self) -> Rectangle {
        Rectangle { rows: 0..self.map.shape.rows(), columns: 0..self.map.shape.columns() }
    }

    /// The axis along which a rectangle is longer on the sphere, with its width taken where it is widest, if
    /// it has more than one slice along that axis; otherwise the other axis. `None` for a single pixel.
    pub(super) fn longer_axis(&self, rectangle: &Rectangle) -> Option<Axis> {
        let shape = self.map.shape;
        let (top_rad, rim_rad) =
            (shape.theta_edge_rad(rectangle.rows.start), shape.theta_edge_rad(rectangle.rows.end));
        let widest_rad = FRAC_PI_2.clamp(top_rad, rim_rad);
        let width_rad = TAU * rectangle.columns.len() as f64 / shape.columns() as f64 * widest_rad.sin();
        let axes = if rim_rad - top_rad > width_rad {
            [Axis::Rows, Axis::Columns]
        } else {
            [Axis::Columns, Axis::Rows]
        };
        axes.into_iter().find(|&axis| rectangle.length(axis) > 1)
    }

    /// The share of every slice of a rectangle along an axis.
    pub(super) fn slices(&self, rectangle: &Rectangle, axis: Axis, content: Content) -> Vec<Share> {
        let mut slices = vec![Share::default(); rectangle.length(axis)];
        let columns = self.map.shape.columns();
        for row in rectangle.rows.clone() {
            let [sin_theta, cos_theta, solid_angle] = self.rows[row];
            for column in rectangle.columns.clone() {
                let rgb = match content {
                    Content::Light => self.map.pixels[row * columns + column].map(f64::from),
                    Content::Even => [1.0; 3],
                };
                let [cos_phi, sin_phi] = self.azimuths[column];
                let direction = DVec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi);
                let slice = match axis {
                    Axis::Rows => row - rectangle.rows.start,
                    Axis::Columns => column - rectangle.columns.start,
                };
                slices[slice].add(&Share {
                    flux: rgb.map(|value| value * solid_angle),
                    moment: direction * (luminance_f64(rgb) * solid_angle),
                });
            }
        }
        slices
    }

    /// [`Self::slices`] of a rectangle's content, or of uniform light where it is dark.
    pub(super) fn lit_slices(&self, rectangle: &Rectangle, axis: Axis) -> Vec<Share> {
        let slices = self.slices(rectangle, axis, Content::Light);
        if slices.iter().all(|slice| slice.flux == [0.0; 3]) {
            self.slices(rectangle, axis, Content::Even)
        } else {
            slices
        }
    }

    /// The share of a rectangle.
    pub(super) fn share(&self, rectangle: &Rectangle, content: Content) -> Share {
        let mut sum = Share::default();
        self.slices(rectangle, Axis::Rows, content).iter().for_each(|slice| sum.add(slice));
        sum
    }

    /// Writes `count` lights: one for each rectangle, of which there are at most `count`, with its RGB flux,
    /// the mean direction of its flux and its spread. The light of a dark rectangle has no power and the
    /// rectangle's own mean direction. Where there are fewer rectangles the remaining lights have no power
    /// and repeat the directions.
    pub(super) fn lights(&self, rectangles: &[Rectangle], count: usize, lights: &mut Vec<Light>) {
        lights.clear();
        lights.extend(rectangles.iter().enumerate().map(|(id, rectangle)| {
            let middle = self.share(rectangle, Content::Even).light(0, [0.0, 1.0, 0.0]);
            self.share(rectangle, Content::Light).light(id as u32, middle.direction)
        }));
        fill_up(lights, count);
    }
}

/// Cuts `whole` into `count` rectangles, or as many as `cut` allows, which returns the halves, or `None` for
/// a rectangle that cannot be cut.
///
/// While there are at most half as many rectangles as requested, every rectangle is cut (as in both papers:
/// 2^n regions in n rounds). For the remainder the one with the highest `rank` is cut next; ranks are finite
/// and not negative. For 2^n lights the result is therefore that of the papers, except that where a rectangle
/// is a single pixel before the last round, its share of the lights goes to the others.
///
/// One half takes its parent's index and the other is appended, so that the first 2^k rectangles lie in
/// different rectangles of round k: every prefix of the list covers the map.
pub(super) fn divide(
    whole: Rectangle,
    count: usize,
    cut: impl Fn(&Rectangle) -> Option<[Rectangle; 2]>,
    rank: impl Fn(&Rectangle) -> f64,
) -> Vec<Rectangle> {
    let mut rectangles = vec![whole];
    let split = |rectangles: &mut Vec<Rectangle>, index: usize| match cut(&rectangles[index]) {
        Some([first, second]) => {
            rectangles[index] = first;
            rectangles.push(second);
            true
        }
        None => false,
    };
    while 2 * rectangles.len() <= count {
        let before = rectangles.len();
        for index in 0..before {
            split(&mut rectangles, index);
        }
        if rectangles.len() == before {
            return rectangles;
        }
    }
    // The bit patterns of non-negative floating-point numbers have the same order as the numbers.
    let entry = |rectangles: &[Rectangle], index: usize| (rank(&rectangles[index]).to_bits(), Reverse(index));
    let mut heap: BinaryHeap<_> = (0..rectangles.len()).map(|index| entry(&rectangles, index)).collect();
    while rectangles.len() < count {
        let Some((_, Reverse(index))) = heap.pop() else { break };
        if split(&mut rectangles, index) {
            heap.push(entry(&rectangles, index));
            heap.push(entry(&rectangles, rectangles.len() - 1));
        }
    }
    rectangles
}
