//! Response, lens, and the matrix from frame to polar map.
//!
//! Camera frame: +Z the optical axis, +X right, +Y down. `world_from_camera` is a rotation matrix; world is
//! right-handed with +Y up (METHODS section 1). Pixel coordinates have half-pixel centres.

mod lens;
mod pixel_counts;
mod radial_polynomial;
mod response;

pub use lens::{Lens, LensParameters};
pub use pixel_counts::PixelCounts;
pub use response::{Response, ResponseModel};
