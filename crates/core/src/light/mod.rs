//! From a polar map to a short list of directional lights (METHODS section 6).
//!
//! [`Extractor`] is the stage's algorithm: it places sites by importance sampling or takes those of the last
//! frame, gives every pixel to its nearest site and sums the cells up to lights. For adaptive lights,
//! dominant peaks are separated first. [`prefix`] and [`cluster`] shorten a list, [`Regions`] find the lights
//! of it that a normal or a cone needs.

mod adaptive;
mod cluster;
mod components;
mod count;
mod equal_power;
pub mod error;
mod extractor;
mod list;
pub mod measure;
mod nearest;
mod occlusion;
mod options;
mod peaks;
mod prefix;
mod reference;
mod refine;
mod regions;
mod seeds;

#[cfg(test)]
mod extractor_tests;
#[cfg(test)]
mod sequence_tests;

#[cfg(test)]
pub(crate) use adaptive::REST_S;
pub use cluster::cluster;
pub use components::collect_component;
pub use equal_power::equal_power;
pub use extractor::Extractor;
pub use list::{Light, LightList, MAX_LIGHTS, ReferencedList};
pub use nearest::NearestSites;
pub use options::{Options, Sampler};
pub use prefix::{Prefixes, prefix};
pub use reference::MapIrradiance;
pub use refine::{Share, Voronoi};
pub use regions::{RegionLists, Regions};
pub use seeds::dampened_luminance;
