use crate::error::{Error, Result};
use glam::{DMat3, DVec3};

/// An element beyond this is a mistake; within it products with the largest f32 stay finite.
const ELEMENT_MAX: f64 = 1e6;

/// Linear Rec. 709 from the colours of a sensor; a white balance is its diagonal.
///
/// It is applied to the map, after the area weights: both are linear, so it is as if every pixel had all
/// three colours and went through it by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourMatrix(DMat3);

impl ColourMatrix {
    /// Checks a matrix, given in rows: row 0 gives red from the sensor's red, green and blue. A singular one
    /// is allowed (three equal rows give grey).
    ///
    /// # Errors
    /// `Usage`, naming the element, for elements that are not finite or beyond 1e6.
    pub fn new(rows: [[f64; 3]; 3]) -> Result<Self> {
        for (index, element) in rows.into_iter().flatten().enumerate() {
            if element.is_nan() || element.abs() > ELEMENT_MAX {
                let name = format!("rec709_from_sensor[{}][{}]", index / 3, index % 3);
                return Err(Error::usage(format!("must be finite, at most {ELEMENT_MAX}"))
                    .in_option(&name, Some(&element)));
            }
        }
        Ok(Self(DMat3::from_cols_array_2d(&rows).transpose()))
    }

    /// Rec. 709 of finite sensor colours. A colour outside of Rec. 709's gamut has a component below zero,
    /// which becomes 0: no light can be negative.
    pub(super) fn rec709(&self, sensor: DVec3) -> DVec3 {
        (self.0 * sensor).max(DVec3::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_make_red_green_and_blue_and_nothing_becomes_negative() {
        let matrix = ColourMatrix::new([[2.0, 0.0, 0.0], [-0.5, 1.0, 0.25], [0.0, -3.0, 1.0]]).unwrap();
        assert_eq!(matrix.rec709(DVec3::new(1.0, 2.0, 4.0)), DVec3::new(2.0, 2.5, 0.0));
        let largest = f64::from(f32::MAX);
        let extreme = ColourMatrix::new([[1e6, -1e6, 1e6]; 3]).unwrap();
        for colour in [DVec3::splat(largest), DVec3::ZERO, DVec3::new(0.0, largest, 0.0)] {
            assert!(extreme.rec709(colour).is_finite() && extreme.rec709(colour).min_element() >= 0.0);
        }
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for element in [f64::NAN, f64::INFINITY, -2e6] {
            let mut rows = [[1.0; 3]; 3];
            rows[1][2] = element;
            let message = ColourMatrix::new(rows).unwrap_err().to_string();
            let start = format!("rec709_from_sensor[1][2] = {element}: must be finite");
            assert!(message.starts_with(&start), "{message}");
        }
    }
}
