//! Taps for tests of this room.

use super::Taps;
use crate::design::{FilterOptions, low_pass};

/// The published filter at a frame rate.
pub(super) fn taps(frame_rate_hz: f64) -> Taps {
    low_pass(frame_rate_hz, &FilterOptions::default()).unwrap()
}
