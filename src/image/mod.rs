//! Pictures as numbers: what a source delivers ([`Frame`]), what the lights are taken from ([`PolarMap`]), and
//! the files that hold them ([`read`], [`decode_jpeg`], [`write_exr`], [`write_png16`], [`write_png8`]).

mod exposure;
mod file;
mod frame;
mod jpeg;
mod open_exr;
#[cfg(feature = "april-grid")]
mod photograph;
mod png;
mod polar_map;
mod radiance;
#[cfg(test)]
pub(crate) mod test_data;

pub use exposure::{ExposureSettings, exposure_settings};
pub use file::{
    Attributes, LatLongCentres, MAX_PIXELS, MAX_SIDE_PX, decode, lat_long_note, read, replace as replace_file,
};
pub use frame::{Bayer, Frame, Pixels, Stamp};
pub use jpeg::decode_jpeg;
pub use open_exr::{decode_exr, encode_exr, encode_map_exr, write_exr, write_recorded_exr};
#[cfg(feature = "april-grid")]
pub use photograph::{GreyPicture, read_grey};
pub use png::{encode_png8, write_png8, write_png16};
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
