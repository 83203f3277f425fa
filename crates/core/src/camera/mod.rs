//! The processing of a camera's frame: response, lens, the merge of exposures, and the matrix from frame to
//! polar map.
//!
//! Camera frame: +Z the optical axis, +X right, +Y down. `world_from_camera` is a rotation matrix; world is
//! right-handed with +Y up (METHODS section 1). Pixel coordinates have half-pixel centres.

mod area_matrix;
mod band_kernels;
mod chart;
mod colour_matrix;
mod exposure_merge;
mod footprints;
mod frame_to_polar;
mod lat_long;
mod lens;
mod mosaic;
mod overlap;
mod pixel_counts;
mod probe;
mod projection;
mod radial_polynomial;
mod response;

#[cfg(test)]
mod energy_tests;
#[cfg(test)]
mod hard_case_tests;
#[cfg(test)]
mod mosaic_tests;

pub use colour_matrix::ColourMatrix;
pub use exposure_merge::{ExposureMerge, MergeCounts, SensorNoise};
pub use frame_to_polar::FrameToPolar;
pub use lens::{Lens, LensParameters};
pub use pixel_counts::PixelCounts;
pub use probe::Probe;
pub use projection::{LOOKING_UP, Projection};
pub use radial_polynomial::RadialPolynomial;
pub use response::{Response, ResponseModel};
