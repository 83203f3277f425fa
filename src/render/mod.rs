//! Renders a scene under many directional lights with wgpu (Havran et al. 2005, sections 4 and 5; METHODS section 8).
//!
//! A frame is five passes, one file each, beside its shader of the same name in `shaders/`:
//!
//! 1. `regions`: lights to angular regions, so that a pixel looks only at lights that it can see;
//! 2. `shadow`: one atlas of shadow maps;
//! 3. `surface`: depth, normals and reflectances of every pixel;
//! 4. `shade`: the sum over the lights, added to a picture of radiance;
//! 5. `tone`: from radiance to a screen.
//!
//! [`Renderer`] runs them.

pub mod budget;
#[cfg(test)]
mod culling_tests;
mod emitters;
mod energy;
#[cfg(test)]
mod exact_shadow;
mod geometry;
#[cfg(test)]
mod golden_tests;
#[cfg(test)]
mod hard_case_tests;
mod light_space;
mod lights;
mod material;
mod options;
#[cfg(test)]
mod reference_tests;
pub mod refinement;
#[cfg(test)]
mod refinement_tests;
mod region_pass;
#[cfg(test)]
mod region_tests;
mod renderer;
#[cfg(test)]
mod renderer_tests;
mod shade;
#[cfg(test)]
mod shade_tests;
#[cfg(test)]
mod shade_twin;
#[cfg(test)]
mod shader_tests;
mod shadow;
#[cfg(test)]
mod shadow_tests;
#[cfg(test)]
mod soft_shadow_tests;
mod surface;
#[cfg(test)]
mod test_scenes;
mod tiles;
mod tone;

pub use emitters::emitters;
pub use options::Options;
pub use renderer::{LightCounts, Renderer};
