//! Limits on the numbers in a transmitted list, in addition to
//! [`MAX_LIGHTS`](lightcast_core::light::MAX_LIGHTS).

/// How far a direction may be from length 1: four written digits.
pub(super) const LENGTH_TOLERANCE: f32 = 1e-3;
/// The highest irradiance that is read: the sum of the most lights with this irradiance is still finite.
pub(super) const MOST_IRRADIANCE: f32 = 1e30;
/// The highest power that is read: more than the sum of the most lights of the most irradiance.
pub(super) const MOST_POWER: f64 = 1e36;
