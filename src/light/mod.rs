//! From a polar map to a short list of directional lights.

pub mod error;
mod list;
pub mod measure;
mod prefix;
mod reference;

pub use list::{Light, LightList};
pub use prefix::prefix;
pub use reference::MapIrradiance;
