//! Speed against error: of the lights, and with feature `render` of pictures and of the renderer.

#[cfg(feature = "render")]
pub mod frame_time;
#[cfg(feature = "render")]
pub mod picture_error;
#[cfg(feature = "render")]
pub mod pictures;
mod plain_paper;
pub mod sequence;
mod sequence_maps;
pub mod sequence_table;
#[cfg(feature = "render")]
pub mod speed;
#[cfg(feature = "render")]
pub mod speed_cases;
pub mod stability;
pub mod stills;
