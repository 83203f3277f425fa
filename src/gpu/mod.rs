//! The GPU: choosing a device, reading results back, timing passes.
//!
//! Nothing here knows what is drawn. A pass (room `render`) makes its own pipelines and structs; pipelines take their
//! bind group layouts from the shader, so that each binding is written down once.

mod buffer;
mod device;
#[cfg(test)]
pub(crate) mod layout;
mod timer;

pub use buffer::{Array, read_buffer, read_texture};
pub use device::{Backend, Gpu};
pub use timer::{PassTimes, Timer};
