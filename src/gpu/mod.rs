//! The GPU: choosing a device, reading results back, timing passes.
//!
//! Nothing here depends on what is drawn. A pass (room `render`) creates its own pipelines and structs; a
//! pipeline derives its bind group layouts from the shader, so that each binding is declared only once,
//! unless it shares bind groups.

mod buffer;
mod device;
#[cfg(test)]
pub(crate) mod layout;
mod timer;

pub use buffer::{Array, read_buffer, read_texture};
pub use device::{Backend, Gpu, READ_ONLY, READ_WRITE, UNIFORM};
pub use timer::{PassTimes, Timer};
