//! Speed against error: of the lights, and with feature `render` of pictures and of the renderer.

pub mod built_in;
pub mod document;
mod filtered_truth;
pub mod folder;
#[cfg(feature = "render")]
pub mod frame_time;
pub mod machine;
mod median;
pub mod page;
mod page_plots;
pub mod pareto;
#[cfg(feature = "render")]
pub mod picture_error;
#[cfg(feature = "render")]
pub mod picture_tables;
#[cfg(feature = "render")]
pub mod pictures;
pub mod sequence;
mod sequence_maps;
pub mod sequence_table;
#[cfg(feature = "render")]
pub mod speed;
#[cfg(feature = "render")]
pub mod speed_cases;
pub mod stills;
pub mod table;
pub mod tables;
