//! Filtering of lights over time: METHODS section 7, after section 3.3 of Havran, Smyk, Krawczyk, Myszkowski
//! and Seidel, "Interactive System for Dynamic Scene Lighting using Captured Video Environment Maps" (2005).
//!
//! A light is followed by its slot. Its power and its direction pass one linear-phase FIR each, the direction
//! as a vector that is normalised afterwards; by default its frames are weighted by power, where the paper
//! weights them equally. The paper's weights `w_1 .. w_9` are [`Taps`] before they are divided by their sum;
//! its "order 8" is [`Taps::order`], its delay of 4 frames [`Taps::delay_frames`].

mod directions;
mod energy;
mod filter;
mod history;
mod taps;

pub use directions::Directions;
pub use filter::LightFilter;
pub use taps::Taps;

#[cfg(test)]
mod settle_tests;
#[cfg(test)]
mod test_taps;
