//! Renders a scene under captured light with wgpu.
//!
//! A [`Renderer`] is a view and the lightings that add radiance to it:
//!
//! - `view`: what a camera sees, whatever lights it: depth, normals and reflectances of every pixel,
//!   radiance, and the way from radiance to a screen;
//! - `directional`: many directional lights with shadows (Havran et al. 2005, sections 4 and 5; METHODS
//!   section 8);
//! - `ambient`: the light of a ground that a capture does not see.
//!
//! A lighting has `prepare`, which takes what it is lit by, and `shade`, which adds to a view. The view knows
//! no lighting by name, and no lighting knows how radiance comes to a screen. Every pass is one file, beside
//! its shader of the same folder and name in `shaders/`.

mod ambient;
pub mod budget;
mod directional;
mod emitters;
mod geometry;
#[cfg(test)]
mod golden_tests;
#[cfg(test)]
mod hard_case_tests;
mod material;
mod options;
#[cfg(test)]
mod reference_tests;
pub mod refinement;
#[cfg(test)]
mod refinement_tests;
mod renderer;
#[cfg(test)]
mod renderer_tests;
#[cfg(test)]
mod role_tests;
#[cfg(test)]
mod shader_tests;
#[cfg(test)]
mod test_scenes;
mod view;
mod world;

pub use directional::{DirectionalOptions, LightCounts};
pub use emitters::emitters;
pub use options::{Lightings, Options};
pub use renderer::Renderer;
pub use view::{Background, Exposure, Look, Tone};
