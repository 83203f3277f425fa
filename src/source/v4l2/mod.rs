//! Cameras of the Linux kernel (Video4Linux, version 2), captured through buffers shared with the driver.
//!
//! Frames come as the sensor delivers them: grey or a mosaic of colours with 8 to 16 bits, as codes; pictures
//! of ordinary cameras (YUYV, JPEG) as three channels of 8 bits. Multi-planar devices are not supported.

mod camera;
mod control;
mod identity;
mod listing;
mod node;
mod pixel_format;
mod unpack;

pub use camera::{V4l2Camera, V4l2Options};
pub use control::{Control, ControlKind, ControlValue};
pub use listing::{Device, Format, Size, devices};
