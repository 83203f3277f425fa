//! Renders a scene under captured light with wgpu.
//!
//! A [`Renderer`] consists of a view and the lightings that add radiance to it:
//!
//! - `view`: what a camera sees, independent of the lighting: depth, normals and reflectances of every pixel,
//!   radiance, and the mapping of radiance to a screen;
//! - `directional`: many directional lights with shadows (Havran et al. 2005, sections 4 and 5; METHODS
//!   section 8);
//! - `ambient`: the light of a ground that a capture does not see.
//!
//! A lighting has `prepare`, which takes its lights, and `shade`, which adds radiance to a view. The view
//! does not depend on any lighting, and no lighting depends on how radiance is mapped to a screen. Every pass
//! is one file, and its shader has the same folder and name in `shaders/`.

mod ambient;
pub mod budget;
mod directional;
mod emitters;
#[cfg(test)]
mod figure_tests;
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
#[cfg(test)]
mod texture_tests;
mod view;
mod world;

pub use directional::{DirectionalOptions, LightCounts};
pub use emitters::emitters;
pub use options::{Lightings, Options};
pub use renderer::Renderer;
pub use view::{Background, Exposure, Look, Tone};
