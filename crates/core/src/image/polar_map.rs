use super::{Stamp, luminance};
use crate::math::{direction, zone_solid_angle};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Size and extent of a polar map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolarShape {
    /// Azimuth steps over the full turn; column 0 starts at phi = 0.
    pub columns: usize,
    /// Polar-angle steps over [0, theta_max].
    pub rows: usize,
    /// Polar angle of the lower rim: pi/2 for a hemisphere, pi for the full sphere.
    pub theta_max_rad: f64,
}

impl PolarShape {
    /// The upper hemisphere.
    pub const fn hemisphere(columns: usize, rows: usize) -> Self {
        Self { columns, rows, theta_max_rad: PI / 2.0 }
    }

    /// The full sphere.
    pub const fn sphere(columns: usize, rows: usize) -> Self {
        Self { columns, rows, theta_max_rad: PI }
    }

    /// Polar angle of the upper edge of `row`; `row == rows` gives the lower rim.
    pub fn theta_edge_rad(&self, row: usize) -> f64 {
        self.theta_max_rad * row as f64 / self.rows as f64
    }

    /// Height `z = 1 - cos theta` at a row: a whole number is the row's upper edge, and half more its centre.
    pub fn height(&self, row: f64) -> f64 {
        // This form keeps its digits near the pole.
        2.0 * (0.5 * self.theta_max_rad * row / self.rows as f64).sin().powi(2)
    }

    /// Solid angle in steradians of one pixel of `row`.
    pub fn pixel_solid_angle(&self, row: usize) -> f64 {
        zone_solid_angle(self.theta_edge_rad(row), self.theta_edge_rad(row + 1), 1.0 / self.columns as f64)
    }

    /// Direction of the centre (middle of both angles) of a pixel.
    pub fn pixel_direction(&self, row: usize, column: usize) -> DVec3 {
        direction(
            self.theta_max_rad * (row as f64 + 0.5) / self.rows as f64,
            TAU * (column as f64 + 0.5) / self.columns as f64,
        )
    }

    /// Cosine and sine of the azimuth of every column's centre.
    pub fn column_azimuths(&self) -> Vec<[f64; 2]> {
        let azimuth = |column: usize| {
            let (sin, cos) = (TAU * (column as f64 + 0.5) / self.columns as f64).sin_cos();
            [cos, sin]
        };
        (0..self.columns).map(azimuth).collect()
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Whether there are no pixels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Incident radiance by polar angle (rows) and azimuth (columns), row-major, linear RGB (Rec. 709).
///
/// Every value is finite and >= 0: whoever fills a map counts and leaves out what is not.
#[derive(Clone, Debug, PartialEq)]
pub struct PolarMap {
    /// Time and place in the sequence.
    pub stamp: Stamp,
    /// Size and extent.
    pub shape: PolarShape,
    /// `shape.len()` pixels, mean radiance over each pixel's solid angle.
    pub pixels: Vec<[f32; 3]>,
}

impl PolarMap {
    /// A map without light.
    pub fn black(shape: PolarShape) -> Self {
        Self { stamp: Stamp::default(), shape, pixels: vec![[0.0; 3]; shape.len()] }
    }

    /// A map filled by a function of (row, column).
    pub fn from_fn(shape: PolarShape, mut radiance: impl FnMut(usize, usize) -> [f32; 3]) -> Self {
        let mut map = Self::black(shape);
        for row in 0..shape.rows {
            for column in 0..shape.columns {
                map.pixels[row * shape.columns + column] = radiance(row, column);
            }
        }
        map
    }

    /// Power of the map: the integral of radiance over its solid angle, per channel (the sum of the
    /// irradiances that all its pixels give surfaces facing them). Summed in f64.
    pub fn power(&self) -> [f64; 3] {
        let mut power = [0.0; 3];
        for (row, pixels) in self.pixels.chunks_exact(self.shape.columns).enumerate() {
            let mut sum = [0.0; 3];
            for pixel in pixels {
                for channel in 0..3 {
                    sum[channel] += f64::from(pixel[channel]);
                }
            }
            let solid_angle = self.shape.pixel_solid_angle(row);
            for channel in 0..3 {
                power[channel] += sum[channel] * solid_angle;
            }
        }
        power
    }

    /// Luminance of a pixel.
    pub fn luminance(&self, row: usize, column: usize) -> f32 {
        luminance(self.pixels[row * self.shape.columns + column])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constant_maps_hold_their_solid_angle() {
        let hemisphere = PolarMap::from_fn(PolarShape::hemisphere(360, 90), |_, _| [1.0, 2.0, 0.5]);
        let sphere = PolarMap::from_fn(PolarShape::sphere(7, 1), |_, _| [1.0; 3]);
        for (channel, value) in [1.0, 2.0, 0.5].into_iter().enumerate() {
            assert!((hemisphere.power()[channel] - value * TAU).abs() < 1e-12);
        }
        assert!((sphere.power()[0] - 2.0 * TAU).abs() < 1e-12);
    }

    #[test]
    fn small_pixels_beside_a_huge_one_are_not_lost() {
        // 8192 x 2048 pixels of 1 beside one of 1e8: an f32 sum drops most of the small ones.
        let shape = PolarShape::hemisphere(8192, 2048);
        let map =
            PolarMap::from_fn(shape, |row, column| if (row, column) == (9, 4) { [1e8; 3] } else { [1.0; 3] });
        let expected = TAU + (1e8 - 1.0) * shape.pixel_solid_angle(9);
        assert!((map.power()[0] / expected - 1.0).abs() < 1e-12);
    }
}
