use super::Light;
use super::refine::Share;
use multiversion::multiversion;

/// Lights that look for their head together: enough for every vector unit.
const LANES: usize = 16;

/// The first `count` of `lights`, with every later light joined to the nearest of them (METHODS section 6).
///
/// Powers add. The direction becomes the mean of the joined directions, weighted by luminous flux times `cos
/// spread_rad`: the first moment of what the lights stand for. Spreads merge likewise (the cosine of the joined
/// spread is the length of the summed moments over the summed flux), so that the joined light has the flux, direction
/// and spread that the union of the shares would have had. Heads keep their `id`; those without power keep their
/// direction until something with power joins them.
///
/// A `count` of 0 gives no lights; one of at least the number of lights gives them as they are. `joined` is the
/// caller's storage; it is used up to the length of `lights`.
pub fn prefix(lights: &[Light], count: usize, joined: &mut Vec<Light>) {
    join(lights, count, joined, |_, _| {});
}

/// [`prefix`], with the index in `joined` of the light that each of `lights` has joined; the first `count` have joined
/// themselves. A `count` of 0 leaves `heads` empty, as there is nothing to join.
pub fn prefix_with_heads(lights: &[Light], count: usize, joined: &mut Vec<Light>, heads: &mut Vec<u32>) {
    heads.clear();
    if count > 0 {
        heads.extend(0..lights.len() as u32);
    }
    join(lights, count, joined, |light, head| heads[light] = head);
}

/// [`prefix`]; calls `found` with the index of every light from `count` on and that of its head.
fn join(lights: &[Light], count: usize, joined: &mut Vec<Light>, mut found: impl FnMut(usize, u32)) {
    joined.clear();
    if count == 0 {
        return;
    }
    joined.extend_from_slice(lights);
    if count >= lights.len() {
        return;
    }
    let (heads, tail) = joined.split_at_mut(count);
    // A joining light no longer needs its id: it holds the index of the head until all is summed.
    for (index, group) in tail.chunks_mut(LANES).enumerate() {
        let nearest = nearest_heads(heads, group);
        for (lane, (light, head)) in group.iter_mut().zip(nearest).enumerate() {
            light.id = head;
            found(count + index * LANES + lane, head);
        }
    }
    tail.sort_unstable_by_key(|light| light.id);
    for joining in tail.chunk_by(|a, b| a.id == b.id) {
        if joining.iter().all(|light| light.irradiance == [0.0; 3]) {
            continue; // not even rounded anew
        }
        let head = &mut heads[joining[0].id as usize];
        let mut share = Share::of(head);
        for light in joining {
            share.add(&Share::of(light));
        }
        *head = share.light(head.id, head.direction);
    }
    joined.truncate(count);
}

/// For up to [`LANES`] lights the index of the nearest head; the first of equally near ones.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
fn nearest_heads(heads: &[Light], lights: &[Light]) -> [u32; LANES] {
    let mut directions = [[0.0; LANES]; 3];
    for (lane, light) in lights.iter().enumerate() {
        for axis in 0..3 {
            directions[axis][lane] = light.direction[axis];
        }
    }
    let [x, y, z] = directions;
    let mut best = [f32::NEG_INFINITY; LANES];
    let mut index = [0; LANES];
    for (head, light) in heads.iter().enumerate() {
        let d = light.direction;
        // Arrays of their own and a maximum: the best of all lanes then stay in one register.
        let dots: [f32; LANES] = std::array::from_fn(|lane| x[lane] * d[0] + y[lane] * d[1] + z[lane] * d[2]);
        index = std::array::from_fn(|lane| if dots[lane] > best[lane] { head as u32 } else { index[lane] });
        best = std::array::from_fn(|lane| best[lane].max(dots[lane]));
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{angle_between, direction};
    use glam::DVec3;

    fn light(id: u32, theta: f64, phi: f64, power: f32, spread_rad: f32) -> Light {
        Light {
            id,
            direction: direction(theta, phi).as_vec3().to_array(),
            irradiance: [power, 0.5 * power, 0.25 * power],
            spread_rad,
        }
    }

    #[test]
    fn two_equal_lights_join_in_the_middle_with_half_their_angle_as_spread() {
        let lights = [light(7, 0.5, 1.0, 2.0, 0.0), light(3, 0.7, 1.0, 2.0, 0.0)];
        let mut joined = Vec::new();
        prefix(&lights, 1, &mut joined);
        assert_eq!(joined.len(), 1);
        assert_eq!((joined[0].id, joined[0].irradiance), (7, [4.0, 2.0, 1.0]));
        let d = DVec3::from(joined[0].direction.map(f64::from));
        assert!(angle_between(d, direction(0.6, 1.0)) < 1e-7);
        assert!((joined[0].spread_rad - 0.1).abs() < 1e-6, "{}", joined[0].spread_rad);
    }

    #[test]
    fn joining_in_steps_and_at_once_give_the_same_light() {
        let lights: Vec<Light> = (0..9)
            .map(|i| {
                light(i, 0.4 + 0.03 * f64::from(i), 0.1 * f64::from(i * i), 1.0 + i as f32, 0.01 * i as f32)
            })
            .collect();
        let (mut once, mut half, mut steps) = (Vec::new(), Vec::new(), Vec::new());
        prefix(&lights, 1, &mut once);
        prefix(&lights, 4, &mut half);
        prefix(&half, 1, &mut steps);
        let apart = angle_between(
            DVec3::from(once[0].direction.map(f64::from)),
            DVec3::from(steps[0].direction.map(f64::from)),
        );
        assert!(apart < 1e-6, "{apart}");
        assert!((once[0].spread_rad / steps[0].spread_rad - 1.0).abs() < 1e-5);
        assert!((once[0].irradiance[0] / steps[0].irradiance[0] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn every_light_joins_its_nearest_and_power_is_kept() {
        let lights: Vec<Light> = crate::math::fibonacci_sphere(500)
            .enumerate()
            .map(|(i, d)| Light {
                id: i as u32,
                direction: d.as_vec3().to_array(),
                irradiance: [(i % 7) as f32; 3],
                spread_rad: 0.0,
            })
            .collect();
        let (mut joined, mut with_heads, mut heads) = (Vec::new(), Vec::new(), Vec::new());
        for count in [1, 8, 33, 499, 500, 600] {
            prefix(&lights, count, &mut joined);
            prefix_with_heads(&lights, count, &mut with_heads, &mut heads);
            assert_eq!((&with_heads, heads.len()), (&joined, 500));
            assert!(heads.iter().take(count).enumerate().all(|(i, &head)| head as usize == i));
            assert_eq!(joined.len(), count.min(500));
            let sum = |list: &[Light]| list.iter().map(|l| f64::from(l.irradiance[1])).sum::<f64>();
            assert!((sum(&joined) / sum(&lights) - 1.0).abs() < 1e-6, "{count}");
            // The slow way: power of each head by brute force in f64.
            let mut expected: Vec<f64> =
                lights.iter().take(count).map(|l| f64::from(l.irradiance[0])).collect();
            for (index, late) in lights.iter().enumerate().skip(count) {
                let d = |l: &Light| {
                    DVec3::from(l.direction.map(f64::from)).dot(DVec3::from(late.direction.map(f64::from)))
                };
                let head = (0..count).max_by(|&a, &b| d(&lights[a]).total_cmp(&d(&lights[b]))).unwrap();
                expected[head] += f64::from(late.irradiance[0]);
                // Where two heads are equally near in f64, f32 may choose the other.
                assert!(
                    (d(&lights[head]) - d(&lights[heads[index] as usize])).abs() < 3e-7,
                    "{count} {index}"
                );
            }
            for (light, power) in joined.iter().zip(expected) {
                assert!((f64::from(light.irradiance[0]) - power).abs() < 1e-4, "{count} {}", light.id);
            }
        }
    }

    #[test]
    fn heads_without_power_keep_their_place_or_take_over_what_joins() {
        let lights =
            [light(0, 0.1, 0.0, 0.0, 0.0), light(1, 1.5, 0.0, 0.0, 0.0), light(2, 0.2, 3.0, 1.0, 0.02)];
        let mut joined = Vec::new();
        prefix(&lights, 2, &mut joined);
        assert_eq!(joined[1], lights[1]);
        assert_eq!(joined[0].irradiance, lights[2].irradiance);
        assert!((joined[0].spread_rad - 0.02).abs() < 1e-6 && joined[0].id == 0);
        prefix(&lights, 0, &mut joined);
        assert!(joined.is_empty());
        prefix(&[], 4, &mut joined);
        assert!(joined.is_empty());
        let mut heads = vec![7];
        prefix_with_heads(&lights, 0, &mut joined, &mut heads);
        assert!(joined.is_empty() && heads.is_empty());
        prefix_with_heads(&lights, 2, &mut joined, &mut heads);
        assert_eq!(heads, [0, 1, 0]);
    }

    #[test]
    fn lights_that_nothing_with_power_joins_stay_as_they_are() {
        let lights =
            [light(0, 0.5, 0.0, 0.0, 0.1), light(1, 0.5, 3.0, 1.0, 0.1), light(2, 0.6, 3.0, 0.0, 0.1)];
        let mut joined = Vec::new();
        prefix(&lights, 2, &mut joined);
        assert_eq!(joined, lights[..2]);
        prefix(&lights[..1], 1, &mut joined);
        assert_eq!(joined, lights[..1]);
    }

    #[test]
    fn opposite_lights_of_equal_power_keep_the_first_direction_and_spread_to_a_right_angle() {
        let mut lights = [light(0, 0.0, 0.0, 1.0, 0.0), light(1, 1.0, 0.0, 1.0, 0.0)];
        lights[1].direction = [0.0, -1.0, 0.0];
        let mut joined = Vec::new();
        prefix(&lights, 1, &mut joined);
        assert_eq!((joined[0].direction, joined[0].irradiance), (lights[0].direction, [2.0, 1.0, 0.5]));
        assert!((joined[0].spread_rad - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    }
}
