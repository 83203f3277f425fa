//! Response, lens, how a camera stands, and the matrix from frame to polar map; the fits of them, and the merge of
//! exposures.
//!
//! Camera frame: +Z the optical axis, +X right, +Y down. `world_from_camera` is a rotation matrix; world is
//! right-handed with +Y up (METHODS section 1). Pixel coordinates have half-pixel centres.

#[cfg(feature = "april-grid")]
mod april_grid;
mod area_matrix;
mod band_kernels;
mod bracket;
mod calibrate_lens;
mod calibration;
mod chart;
mod colour_matrix;
mod corner_file;
mod document;
mod exposure_merge;
mod footprints;
mod frame_to_polar;
mod kalibr_file;
mod lens;
mod mosaic;
mod normal_equations;
mod opencv_file;
mod orientation;
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
#[cfg(test)]
mod mosaic_tests;

#[cfg(feature = "april-grid")]
pub use april_grid::AprilGrid;
pub use bracket::{BracketFit, BracketSamples, CodeLimits, fit_bracket, recover_exposures};
pub use calibrate_lens::{
    BoardView, Corner, CornerResidual, LensDeviations, LensFit, LensFitOptions, LensStart, ViewFit,
    calibrate_lens,
};
pub use calibration::Calibration;
pub use colour_matrix::ColourMatrix;
pub use corner_file::CornerSet;
pub use exposure_merge::{ExposureMerge, MergeCounts, SensorNoise};
pub use frame_to_polar::FrameToPolar;
pub use lens::{Lens, LensParameters};
pub use orientation::{Mark, Orientation, fit_orientation};
pub use patch::{Patch, PatchCodes, Rectangle};
pub use patch_fit::{Family, PatchFit, PatchFitOptions, PatchResult, PatchUse, fit_patches};
pub use pixel_counts::PixelCounts;
pub use projection::{LOOKING_UP, Projection};
pub use response::{Response, ResponseModel};
