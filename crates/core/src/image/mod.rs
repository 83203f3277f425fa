//! Pictures as numbers: what a source delivers ([`Frame`]) and what the lights are taken from ([`PolarMap`]).

mod frame;
mod lat_long;
mod polar_map;

pub use frame::{Bayer, Frame, Pixels, Stamp};
pub use lat_long::LatLongCentres;
pub use polar_map::{PolarMap, PolarShape};

/// Luminance `0.2126 R + 0.7152 G + 0.0722 B` of linear Rec. 709 radiance.
#[inline]
pub fn luminance(rgb: [f32; 3]) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

/// [`luminance`] in f64, for sums over pixels.
#[inline]
pub fn luminance_f64(rgb: [f64; 3]) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}
