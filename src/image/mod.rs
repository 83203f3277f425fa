//! Pictures as numbers: what a source delivers ([`Frame`]), what the lights are taken from ([`PolarMap`]), and
//! the files that hold them.

mod frame;
mod latlong_centres;
mod polar_map;

pub use frame::{Frame, Pixels, Stamp};
pub use latlong_centres::LatLongCentres;
pub use polar_map::{PolarMap, PolarShape};

/// Luminance `0.2126 R + 0.7152 G + 0.0722 B` of linear Rec. 709 radiance.
#[inline]
pub fn luminance(rgb: [f32; 3]) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}
