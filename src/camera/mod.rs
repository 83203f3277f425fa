//! Response, lens, and the matrix from frame to polar map; fits of the response, and the merge of exposures.
//!
//! Camera frame: +Z the optical axis, +X right, +Y down. `world_from_camera` is a rotation matrix; world is
//! right-handed with +Y up (METHODS section 1). Pixel coordinates have half-pixel centres.

mod band_kernels;
mod bracket;
mod calibration;
mod chart;
mod document;
mod exposure_merge;
mod footprints;
mod frame_to_polar;
mod kalibr_file;
mod lens;
mod normal_equations;
mod opencv_file;
mod overlap;
mod patch;
mod patch_fit;
mod pixel_counts;
mod projection;
mod radial_polynomial;
mod response;

#[cfg(test)]
mod energy_tests;
#[cfg(test)]
mod hard_case_tests;

pub use bracket::{BracketFit, BracketSamples, CodeLimits, fit_bracket, recover_exposures};
pub use calibration::Calibration;
pub use exposure_merge::{ExposureMerge, MergeCounts, SensorNoise};
pub use frame_to_polar::FrameToPolar;
pub use lens::{Lens, LensParameters};
pub use patch::{Patch, PatchCodes, Rectangle};
pub use patch_fit::{Family, PatchFit, PatchFitOptions, PatchResult, PatchUse, fit_patches};
pub use pixel_counts::PixelCounts;
pub use projection::{LOOKING_UP, Projection};
pub use response::{Response, ResponseModel};
