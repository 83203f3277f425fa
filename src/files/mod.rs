//! Picture files: any kind is read ([`read`], in memory [`decode_exr`] and [`decode_jpeg`]), OpenEXR and PNG
//! are written ([`write_exr`], [`write_png16`], [`write_png8`]), and the exposure is read from EXIF data
//! ([`exposure_settings`]).

mod codec;
mod colour_space;
mod dispatch;
mod exposure;
mod huffman_tables;
mod jpeg;
mod open_exr;
#[cfg(feature = "april-grid")]
mod photograph;
mod png;
mod radiance;
mod replace;

pub use codec::{Attributes, MAX_PIXELS, MAX_SIDE_PX};
pub use dispatch::{decode, lat_long_note, read, read_of_size};
pub use exposure::{ExposureSettings, exposure_settings};
pub use jpeg::decode_jpeg;
pub use open_exr::{decode_exr, encode_exr, encode_map_exr, write_exr, write_recorded_exr};
#[cfg(feature = "april-grid")]
pub use photograph::{GreyPicture, read_grey};
pub use png::{encode_png8, write_png8, write_png8_with_alpha, write_png16};
pub use replace::replace_file;
