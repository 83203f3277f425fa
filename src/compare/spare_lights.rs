//! Lights for a list that a method has not filled.

use lightcast_core::light::Light;

/// Adds lights without power until there are `count`, in the directions of the existing lights, of which
/// there is at least one.
pub(super) fn fill_up(lights: &mut Vec<Light>, count: usize) {
    let known = lights.len();
    for id in known..count {
        let direction = lights[id % known].direction;
        lights.push(Light { id: id as u32, direction, irradiance: [0.0; 3], spread_rad: 0.0 });
    }
}
