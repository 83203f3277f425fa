//! Calibration of a camera, done once from files: the fits of its lens, its response and its orientation, and
//! the files that hold the results.
//!
//! Pixel coordinates have half-pixel centres; files of programs with integer coordinates at the centres are
//! converted when they are read.

#[cfg(feature = "april-grid")]
mod april_grid;
mod bracket;
mod calibration;
mod corner_file;
mod document;
mod kalibr_file;
mod lens_fit;
mod normal_equations;
mod opencv_file;
mod orientation;
mod patch;
mod patch_fit;

#[cfg(feature = "april-grid")]
pub use april_grid::AprilGrid;
pub use bracket::{BracketFit, BracketSamples, CodeLimits, fit_bracket, recover_exposures};
pub use calibration::Calibration;
pub use corner_file::CornerSet;
pub use lens_fit::{
    BoardView, Corner, CornerResidual, LensDeviations, LensFit, LensFitOptions, LensStart, ViewFit, fit_lens,
};
pub use orientation::{Mark, Orientation, fit_orientation};
pub use patch::{Patch, PatchCodes, Rectangle};
pub use patch_fit::{Family, PatchFit, PatchFitOptions, PatchResult, PatchUse, fit_patches};
