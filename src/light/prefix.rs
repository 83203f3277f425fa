//! Shorter lists from a long one (METHODS section 6): a renderer that can afford m lights takes the prefix of
//! length m, in which every later light has joined its nearest among the first m.

use super::Light;
use glam::Vec3;

/// Writes the prefix of length `count` into `prefix`. RGB irradiances add, the direction becomes the
/// luminance-weighted mean, and the spread is the RMS angle of the whole about it:
/// `spread^2 = sum f_i (spread_i^2 + angle_i^2) / sum f_i`. A light without power keeps its direction.
/// A `count` of the whole list or more copies it.
pub fn prefix(lights: &[Light], count: usize, prefix: &mut Vec<Light>) {
    let (kept, joining) = lights.split_at(count.min(lights.len()));
    prefix.clear();
    prefix.extend_from_slice(kept);
    if kept.is_empty() || joining.is_empty() {
        return;
    }
    // First pass: sums. `direction` holds the luminance-weighted sum of vectors, `spread_rad` the sum of squares.
    for light in prefix.iter_mut() {
        let weight = light.luminance();
        light.direction = (Vec3::from(light.direction) * weight).to_array();
        light.spread_rad = weight * light.spread_rad * light.spread_rad;
    }
    for light in joining {
        let weight = light.luminance();
        if weight <= 0.0 {
            continue;
        }
        let direction = Vec3::from(light.direction);
        let target = &mut prefix[nearest(kept, direction)];
        for channel in 0..3 {
            target.irradiance[channel] += light.irradiance[channel];
        }
        target.direction = (Vec3::from(target.direction) + direction * weight).to_array();
        target.spread_rad += weight * light.spread_rad * light.spread_rad;
    }
    // Second pass: means. What the directions of the parts spread about their mean follows from the length of the
    // mean vector, 1 - |mean| = angle^2 / 2 to second order, so the parts need not be visited again.
    for (light, original) in prefix.iter_mut().zip(kept) {
        let weight = light.luminance();
        let sum = Vec3::from(light.direction);
        match sum.try_normalize() {
            Some(direction) if weight > 0.0 => {
                light.direction = direction.to_array();
                let between = 2.0 * (1.0 - sum.length() / weight).max(0.0);
                light.spread_rad = (light.spread_rad / weight + between).sqrt();
            }
            _ => {
                light.direction = original.direction;
                light.spread_rad = original.spread_rad;
            }
        }
    }
}

/// Index of the light whose direction is nearest, the lowest index among equals.
fn nearest(lights: &[Light], direction: Vec3) -> usize {
    let mut best = (0, f32::NEG_INFINITY);
    for (index, light) in lights.iter().enumerate() {
        let cosine = direction.dot(light.direction.into());
        if cosine > best.1 {
            best = (index, cosine);
        }
    }
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::direction;

    fn light(id: u32, theta: f64, phi: f64, irradiance: f32) -> Light {
        let direction = direction(theta, phi).as_vec3().to_array();
        Light { id, direction, irradiance: [irradiance; 3], spread_rad: 0.1 }
    }

    #[test]
    fn later_lights_join_their_nearest() {
        let lights = [
            light(0, 0.5, 0.0, 1.0),
            light(1, 0.5, 3.0, 2.0),
            light(2, 0.6, 3.0, 2.0),
            light(3, 0.4, 0.0, 0.0),
        ];
        let mut short = Vec::new();
        prefix(&lights, 2, &mut short);
        assert_eq!(short.len(), 2);
        assert!((short[0].irradiance[0] - 1.0).abs() < 1e-6 && (short[1].irradiance[1] - 4.0).abs() < 1e-6);
        let mean = direction(0.55, 3.0).as_vec3();
        assert!((Vec3::from(short[1].direction) - mean).length() < 1e-6);
        // Two equal parts 0.05 rad to either side of the mean, each 0.1 wide.
        assert!((short[1].spread_rad - 0.0125f32.sqrt()).abs() < 1e-4, "{}", short[1].spread_rad);
        assert!((short[0].spread_rad - 0.1).abs() < 1e-3);
    }

    #[test]
    fn whole_list_and_dark_lists_stay_as_they_are() {
        let lights = [light(0, 0.5, 0.0, 0.0), light(1, 0.5, 3.0, 0.0)];
        let mut short = Vec::new();
        prefix(&lights, 2, &mut short);
        assert_eq!(short, lights);
        prefix(&lights, 1, &mut short);
        assert_eq!(short, lights[..1]);
        prefix(&[], 4, &mut short);
        assert!(short.is_empty());
        prefix(&lights, 0, &mut short);
        assert!(short.is_empty());
    }

    #[test]
    fn opposite_lights_of_equal_power_keep_the_first_direction() {
        let mut lights = [light(0, 0.0, 0.0, 1.0), light(1, 1.0, 0.0, 1.0)];
        lights[1].direction = [0.0, -1.0, 0.0];
        let mut short = Vec::new();
        prefix(&lights, 1, &mut short);
        assert_eq!(short[0].direction, lights[0].direction);
        assert_eq!(short[0].irradiance, [2.0; 3]);
    }
}
