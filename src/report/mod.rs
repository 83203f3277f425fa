//! Speed against error.

pub mod sequence;
mod sequence_maps;
pub mod sequence_table;
pub mod stills;
