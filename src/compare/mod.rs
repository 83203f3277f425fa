//! Baselines for comparison with the live path: methods of others, a naive implementation of the paper's
//! method, and published figures.
//!
//! Nothing that runs live imports this room. Each method of others has a file, which states what is taken
//! from the paper. [`AnyExtractor`] runs all of them, and the live ones, through one type.

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
