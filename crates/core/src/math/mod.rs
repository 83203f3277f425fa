//! Directions, tables over them, and solid angles; percentiles; the transfer function of sRGB.
//!
//! World frame: right-handed, +Y up. A direction is a unit vector from the scene towards the light; `theta`
//! is the polar angle from +Y, `phi` the azimuth in [0, 2 pi) from +X towards +Z.

mod concentric;
mod cube_map;
mod direction;
mod fibonacci;
mod percentile;
mod solid_angle;
mod srgb;

pub use concentric::disc_from_square;
pub(crate) use concentric::square_from_disc;
pub use cube_map::cube_cell;
pub(crate) use cube_map::{cube_cell_solid_angle, cube_direction};
pub use direction::{angle_between, direction, direction_at_height, polar};
pub use fibonacci::fibonacci_sphere;
pub use percentile::percentile;
pub use solid_angle::zone_solid_angle;
pub use srgb::{linear_from_srgb, srgb_from_linear};
