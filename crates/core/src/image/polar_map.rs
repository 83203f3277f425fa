use super::{Stamp, luminance};
use crate::error::{Error, Result};
use crate::math::{direction, zone_solid_angle};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Size and extent of a polar map: always within [`PolarShape::new`]'s limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolarShape {
    columns: usize,
    rows: usize,
    theta_max_rad: f64,
}

impl PolarShape {
    /// Most pixels along a side. METHODS section 10 asks for 8192 x 2048; this leaves room and refuses typing
    /// errors before they use up all memory.
    pub const MAX_SIDE_PX: usize = 16_384;
    /// Most pixels in all: 1.5 GiB of radiance. Pixel counts stay far within u32.
    pub const MAX_PIXELS: usize = 1 << 27;
    /// The lowest rim in degrees. Rows differ in the cosine of their angles in f64: at this limit the solid
    /// angles of 90 rows are still accurate to 1e-6. Directions are unit vectors in f32, accurate to 1e-7: in
    /// a narrower map they would lie on a grid of fewer than ten thousand steps.
    const LEAST_THETA_MAX_DEG: f64 = 0.1;

    /// A map of `columns` azimuth steps over the full turn and `rows` polar-angle steps from the pole to
    /// `theta_max_rad`.
    ///
    /// # Errors
    /// `Usage`, naming `columns`, `rows` or `theta_max_deg`: sides of 0 or more than [`Self::MAX_SIDE_PX`]
    /// pixels, more than [`Self::MAX_PIXELS`] in all, a rim below 0.1 degrees or beyond 180
    /// degrees.
    pub fn new(columns: usize, rows: usize, theta_max_rad: f64) -> Result<Self> {
        for (name, side_px) in [("columns", columns), ("rows", rows)] {
            if !(1..=Self::MAX_SIDE_PX).contains(&side_px) {
                let fault = format!("a side of a polar map has 1 to {} pixels", Self::MAX_SIDE_PX);
                return Err(Error::usage(fault).in_option(name, Some(&side_px)));
            }
        }
        if columns * rows > Self::MAX_PIXELS {
            let fault = format!("with {rows} rows a polar map has more than {} pixels", Self::MAX_PIXELS);
            return Err(Error::usage(fault).in_option("columns", Some(&columns)));
        }
        // NaN lies in no range.
        if !(Self::LEAST_THETA_MAX_DEG.to_radians()..=PI).contains(&theta_max_rad) {
            let fault =
                format!("the lower rim of a polar map lies at {} to 180 degrees", Self::LEAST_THETA_MAX_DEG);
            return Err(Error::usage(fault).in_option("theta_max_deg", Some(&theta_max_rad.to_degrees())));
        }
        Ok(Self { columns, rows, theta_max_rad })
    }

    /// The upper hemisphere, for sizes that are known to be valid.
    ///
    /// # Panics
    /// Where [`Self::new`] would fail.
    pub const fn hemisphere(columns: usize, rows: usize) -> Self {
        Self::known(columns, rows, PI / 2.0)
    }

    /// The full sphere, for sizes that are known to be valid.
    ///
    /// # Panics
    /// Where [`Self::new`] would fail.
    pub const fn sphere(columns: usize, rows: usize) -> Self {
        Self::known(columns, rows, PI)
    }

    const fn known(columns: usize, rows: usize, theta_max_rad: f64) -> Self {
        assert!(
            columns >= 1 && columns <= Self::MAX_SIDE_PX && rows >= 1 && rows <= Self::MAX_SIDE_PX,
            "sides of 1 to 16384 pixels"
        );
        assert!(columns * rows <= Self::MAX_PIXELS, "at most 2^27 pixels");
        Self { columns, rows, theta_max_rad }
    }

    /// Azimuth steps over the full turn; column 0 starts at phi = 0.
    pub const fn columns(&self) -> usize {
        self.columns
    }

    /// Polar-angle steps over [0, theta_max].
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Polar angle of the lower rim: pi/2 for a hemisphere, pi for the full sphere.
    pub const fn theta_max_rad(&self) -> f64 {
        self.theta_max_rad
    }

    /// Polar angle of the upper edge of `row`; `row == rows` gives the lower rim.
    #[inline]
    pub fn theta_edge_rad(&self, row: usize) -> f64 {
        self.theta_max_rad * row as f64 / self.rows as f64
    }

    /// Height `z = 1 - cos theta` at a row: a whole number is the row's upper edge, and half more its centre.
    #[inline]
    pub fn height(&self, row: f64) -> f64 {
        // This form keeps its accuracy near the pole.
        2.0 * (0.5 * self.theta_max_rad * row / self.rows as f64).sin().powi(2)
    }

    /// Solid angle in steradians of one pixel of `row`.
    #[inline]
    pub fn pixel_solid_angle(&self, row: usize) -> f64 {
        zone_solid_angle(self.theta_edge_rad(row), self.theta_edge_rad(row + 1), 1.0 / self.columns as f64)
    }

    /// Direction of the centre (middle of both angles) of a pixel.
    #[inline]
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

    /// Number of pixels: at least one.
    #[expect(clippy::len_without_is_empty, reason = "no shape is empty")]
    pub const fn len(&self) -> usize {
        self.columns * self.rows
    }
}

/// Incident radiance by polar angle (rows) and azimuth (columns), row-major, linear RGB (Rec. 709).
///
/// Every value is finite and >= 0: code that fills a map counts and leaves out all other values.
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
    #[inline]
    pub fn luminance(&self, row: usize, column: usize) -> f32 {
        luminance(self.pixels[row * self.shape.columns + column])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;

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
    fn shapes_beyond_reason_are_refused_by_name() {
        let refused = |columns, rows, theta_max_rad| {
            let error = PolarShape::new(columns, rows, theta_max_rad).unwrap_err();
            assert_eq!(error.kind(), Kind::Usage);
            error.to_string()
        };
        let most = PolarShape::MAX_SIDE_PX;
        for (columns, rows, name) in [
            (0, 9, "columns = 0: a side"),
            (9, 0, "rows = 0: a side"),
            (usize::MAX, 2, "columns = 18446744073709551615: a side"),
            (2, most + 1, "rows = 16385: a side"),
            (most, most, "columns = 16384: with 16384 rows"),
        ] {
            assert!(refused(columns, rows, 1.0).starts_with(name), "{}", refused(columns, rows, 1.0));
        }
        for theta_max_rad in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e-300, 1e-3, 3.2, 4.0] {
            let message = refused(4, 2, theta_max_rad);
            assert!(message.starts_with("theta_max_deg = "), "{message}");
        }
        assert_eq!(PolarShape::new(7, 3, 180f64.to_radians()).unwrap(), PolarShape::sphere(7, 3));
        assert!(PolarShape::new(most, PolarShape::MAX_PIXELS / most, PI).is_ok());
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
