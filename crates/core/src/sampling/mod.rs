//! Where to take samples: low-discrepancy points, and distributions that turn them into directions (METHODS
//! section 5).
//!
//! Two-dimensional distributions take rows of columns with equal steps in azimuth, as in a polar map, and
//! know nothing else about it. A position is `[z, phi]` with `z = 1 - cos theta` in [0, z_max] and phi in [0,
//! 2 pi), so that `dz dphi` is solid angle; row 0 lies at the pole. Every distribution has
//!
//! - `update(values)`: takes new densities per unit of its measure and allocates nothing;
//! - `sample(u)`: the position for `u` in the unit interval or square, by the inverse of the CDF;
//! - `pdf(x)`: its density, which integrates to 1; 0 outside of the domain;
//! - `invert(x)`: the `u` that `sample` takes to `x`, wherever the density is positive;
//! - `integral()`: the integral of the values over the domain.
//!
//! Values that are negative or NaN count as 0, infinite ones as `f32::MAX`; arguments outside of a domain are
//! clamped to it. Where all values are zero the distribution is uniform. Nothing returns NaN.

mod bicontinuous;
mod halton;
mod piecewise;
mod relaxation;
mod ring;
mod standard;

#[cfg(test)]
mod round_trip_tests;

pub use bicontinuous::Bicontinuous;
pub use halton::halton;
pub(crate) use piecewise::{PiecewiseConstant, PiecewiseLinear};
pub use relaxation::{relax, sample_points};
pub use standard::Standard;
