//! What the live path is compared with: methods of others, the paper's as one writes it down at first, and
//! published figures.
//!
//! Nothing that runs live imports this room. Methods of others have a file each, which says what of it is the
//! paper's. [`AnyExtractor`] runs all of them, and the live ones, by one name.

mod extractor;
mod kollig_keller;
mod median_cut;
mod plain_paper;
mod rectangles;
mod seeds;
pub mod sequence_methods;
mod spare_lights;
pub mod stability;
pub mod still_methods;
mod structured;
mod variance_minimisation;

#[cfg(test)]
mod extractor_tests;

pub use extractor::{AnyExtractor, Options, Sampler};
pub use seeds::Inversion;
