//! From the primaries that a file names to those of Rec. 709, in which everything here is computed.

use crate::error::{Error, Result};
use glam::{DMat3, DVec2, DVec3};

/// Chromaticities (CIE 1931 x, y) of what a file's red, green, blue and white are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Primaries {
    pub red: DVec2,
    pub green: DVec2,
    pub blue: DVec2,
    pub white: DVec2,
}

/// Rec. 709 with D65, which is also what OpenEXR takes where a file says nothing.
const REC_709: Primaries = Primaries {
    red: DVec2::new(0.64, 0.33),
    green: DVec2::new(0.30, 0.60),
    blue: DVec2::new(0.15, 0.06),
    white: DVec2::new(0.3127, 0.3290),
};

/// Chromaticities that differ by less are those of the same space: files give them in f32, or with three
/// digits.
const SAME: f64 = 5e-4;

/// The smallest determinant of primaries that span a space: twice the area of their triangle.
const LEAST_AREA: f64 = 1e-6;

impl Primaries {
    /// The matrix that takes linear RGB of these primaries to linear RGB of Rec. 709, `None` where they are
    /// the same. XYZ is kept, white is not adapted: OpenEXR's own conversion.
    ///
    /// # Errors
    /// `BadFrame`, naming `what`, for numbers that are not finite, a white without luminance, and primaries
    /// in one line.
    pub fn to_rec_709(self, what: &str) -> Result<Option<DMat3>> {
        let fault = |fault: &str| Err(Error::bad_frame(format!("its {what} {fault}")));
        if [self.red, self.green, self.blue, self.white].iter().any(|xy| !xy.is_finite()) {
            return fault("are not finite");
        }
        if self.white.y.abs() < LEAST_AREA {
            return fault("have a white of y = 0, which has no luminance");
        }
        if self.columns().determinant().abs() < LEAST_AREA {
            return fault("are in one line, red, green and blue: they span no colours");
        }
        if self.is_near(&REC_709) {
            return Ok(None);
        }
        Ok(Some(REC_709.to_xyz().inverse() * self.to_xyz()))
    }

    fn columns(&self) -> DMat3 {
        DMat3::from_cols(xyz(self.red), xyz(self.green), xyz(self.blue))
    }

    /// RGB (1, 1, 1) becomes white of luminance 1.
    fn to_xyz(self) -> DMat3 {
        let columns = self.columns();
        let shares = columns.inverse() * (xyz(self.white) / self.white.y);
        columns * DMat3::from_diagonal(shares)
    }

    fn is_near(&self, other: &Self) -> bool {
        let pairs = [
            (self.red, other.red),
            (self.green, other.green),
            (self.blue, other.blue),
            (self.white, other.white),
        ];
        pairs.iter().all(|(one, other)| one.abs_diff_eq(*other, SAME))
    }
}

fn xyz(xy: DVec2) -> DVec3 {
    DVec3::new(xy.x, xy.y, 1.0 - xy.x - xy.y)
}

/// Converts pixels of three samples.
pub(super) fn convert(values: &mut [f32], matrix: &DMat3) {
    for pixel in values.as_chunks_mut::<3>().0 {
        let rgb = *matrix * DVec3::from_array(pixel.map(f64::from));
        *pixel = rgb.as_vec3().to_array();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const XYZ: Primaries =
        Primaries { red: DVec2::X, green: DVec2::Y, blue: DVec2::ZERO, white: DVec2::splat(1.0 / 3.0) };

    #[test]
    fn rec_709_has_its_published_matrix() {
        // ITU-R BT.709 with D65, as published with four digits.
        let expected = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        let found = REC_709.to_xyz().transpose().to_cols_array_2d();
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 1e-4, "{found} {expected}");
        }
        assert_eq!(REC_709.to_rec_709("chromaticities").unwrap(), None);
        let rounded = Primaries { white: DVec2::new(0.313, 0.329), ..REC_709 };
        assert_eq!(rounded.to_rec_709("chromaticities").unwrap(), None);
    }

    #[test]
    fn xyz_becomes_rgb_and_keeps_its_colours() {
        let matrix = XYZ.to_rec_709("chromaticities").unwrap().unwrap();
        // The XYZ of RGB (1, 2, 3).
        let xyz = REC_709.to_xyz() * DVec3::new(1.0, 2.0, 3.0);
        let mut pixel = xyz.as_vec3().to_array();
        convert(&mut pixel, &matrix);
        for (found, expected) in pixel.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-6, "{pixel:?}");
        }
    }

    #[test]
    fn white_stays_white_only_where_the_whites_agree() {
        let wide = Primaries {
            red: DVec2::new(0.708, 0.292),
            green: DVec2::new(0.170, 0.797),
            blue: DVec2::new(0.131, 0.046),
            white: REC_709.white,
        };
        let matrix = wide.to_rec_709("chromaticities").unwrap().unwrap();
        assert!((matrix * DVec3::ONE).abs_diff_eq(DVec3::ONE, 1e-12));
        let equal_energy = Primaries { white: DVec2::splat(1.0 / 3.0), ..REC_709 };
        let white = equal_energy.to_rec_709("chromaticities").unwrap().unwrap() * DVec3::ONE;
        // Equal energy is redder than D65, and not adapted to it. Its luminance is kept.
        assert!(white.x > 1.1 && white.z < 0.95, "{white}");
        assert!((white.dot(DVec3::new(0.2126, 0.7152, 0.0722)) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn degenerate_ones_are_refused_by_name() {
        for (primaries, words) in [
            (Primaries { white: DVec2::new(0.3, 0.0), ..REC_709 }, "y = 0"),
            (Primaries { red: DVec2::new(f64::NAN, 0.3), ..REC_709 }, "not finite"),
            (Primaries { red: DVec2::new(0.225, 0.33), ..REC_709 }, "in one line"),
        ] {
            let error = primaries.to_rec_709("PRIMARIES").unwrap_err().to_string();
            assert!(error.contains("PRIMARIES") && error.contains(words), "{error}");
        }
    }
}
