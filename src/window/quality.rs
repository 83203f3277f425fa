//! The number of lights and shadow maps of a picture.

use crate::render::DirectionalOptions;
use crate::render::budget::Quality;

/// Factor by which a key changes the number of lights.
const LIGHTS_STEP: f64 = 1.25;

/// The highest quality that a renderer with these options supports.
pub(super) fn reserved(options: &DirectionalOptions) -> Quality {
    Quality { lights: options.lights, shadow_maps: options.shadow_maps.min(options.lights) }
}

/// A step up or down from `lights`, between one light and `reserved`, with as many shadow maps as those
/// lights can have.
pub(super) fn stepped(lights: usize, is_more: bool, reserved: Quality) -> Quality {
    let lights = if is_more {
        (lights as f64 * LIGHTS_STEP).ceil() as usize
    } else {
        (lights as f64 / LIGHTS_STEP).floor() as usize
    };
    let lights = lights.clamp(1, reserved.lights);
    Quality { lights, shadow_maps: reserved.shadow_maps.min(lights) }
}

/// Length of the prefix of a list of `length` lights when set H has `lights` of at most `most` lights: set L
/// gets shorter in the same proportion.
pub(super) fn prefix_length(length: usize, lights: usize, most: usize) -> usize {
    (length * lights).div_ceil(most.max(1)).max(lights).min(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sets_get_shorter_together() {
        assert_eq!(prefix_length(1152, 72, 72), 1152);
        assert_eq!(prefix_length(1152, 16, 72), 256);
        assert_eq!(prefix_length(64, 16, 72), 16, "a list without a set L");
        assert_eq!((prefix_length(10, 16, 72), prefix_length(0, 16, 72)), (10, 0));
    }

    #[test]
    fn keys_step_through_the_lights_and_stop_at_the_ends() {
        let reserved = Quality { lights: 72, shadow_maps: 20 };
        let mut lights = 72;
        for expected in [57, 45, 36] {
            let quality = stepped(lights, false, reserved);
            assert_eq!(quality, Quality { lights: expected, shadow_maps: 20 });
            lights = quality.lights;
        }
        (0..100).for_each(|_| lights = stepped(lights, false, reserved).lights);
        assert_eq!(stepped(lights, false, reserved), Quality { lights: 1, shadow_maps: 1 });
        (0..100).for_each(|_| lights = stepped(lights, true, reserved).lights);
        assert_eq!(stepped(lights, true, reserved), reserved);
    }
}
