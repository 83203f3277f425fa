//! From a polar map to a short list of directional lights.

mod list;
pub mod measure;

pub use list::{Light, LightList};
