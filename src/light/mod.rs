//! From a polar map to a short list of directional lights (METHODS section 6).
//!
//! [`Extractor`] is the stage's algorithm: it places sites by importance sampling or takes those of the last frame,
//! gives every pixel to its nearest site and sums the cells up to lights. Of adaptive lights dominant peaks are taken
//! apart before.
//! Other methods of the field have a file each, for comparison and for whoever chooses them.
//! [`prefix`] and [`cluster`] shorten a list, [`Regions`] sort it by what a normal or a cone needs of it.

mod adaptive;
mod cluster;
mod components;
mod count;
mod equal_power;
pub mod error;
mod extractor;
mod kollig_keller;
mod list;
pub mod measure;
mod median_cut;
mod nearest;
mod occlusion;
mod peaks;
mod prefix;
mod rectangles;
mod reference;
mod refine;
mod regions;
mod seeds;
mod structured;
mod variance_minimisation;

#[cfg(test)]
mod extractor_tests;
#[cfg(test)]
mod sequence_tests;
#[cfg(test)]
pub(crate) mod test_maps;

#[cfg(test)]
pub(crate) use adaptive::REST_S;
pub use cluster::cluster;
pub use extractor::{Extractor, Inversion, MAX_LIGHTS, Options, Sampler};
pub use list::{Light, LightList, ListFile, MOST_IRRADIANCE, MOST_POWER};
pub use nearest::NearestSites;
pub use prefix::{Prefixes, prefix};
pub use reference::MapIrradiance;
pub use regions::{RegionLists, Regions};
