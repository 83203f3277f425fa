use super::Light;
use super::refine::Share;
use multiversion::multiversion;

/// Lights whose heads are searched for together: enough for every vector unit.
const LANES: usize = 16;

/// Heads that are compared between checks whether farther ones matter.
const STEP: usize = 8;

/// By how much a dot product in f32 may be off, and by how much more a head must lose to be skipped.
const SLACK: f32 = 4e-6;

/// The first `count` of `lights`, with every later light joined to the nearest of them (METHODS section 6).
///
/// Powers add. The direction becomes the mean of the joined directions, weighted by luminous flux times `cos
/// spread_rad`: the first moment of what the lights stand for. Spreads merge likewise (the cosine of the
/// joined spread is the length of the summed moments over the summed flux), so that the joined light has the
/// flux, direction and spread that the union of the shares would have had. Heads keep their `id`; those
/// without power keep their direction until something with power joins them.
///
/// A `count` of 0 gives no lights; one of at least the number of lights gives them as they are. `joined` is
/// the caller's storage. [`Prefixes`] keeps its memory from frame to frame.
pub fn prefix(lights: &[Light], count: usize, joined: &mut Vec<Light>) {
    Prefixes::default().prefix(lights, count, joined);
}

/// Makes one prefix after another; holds only scratch memory.
#[derive(Clone, Debug, Default)]
pub struct Prefixes {
    by_height: Vec<Place>,
    shares: Vec<Share>,
    /// For one prefix: heads and all other lights by height, and what joins each head.
    heads: Vec<Place>,
    others: Vec<Place>,
    joining: Vec<Share>,
}

/// The direction of a light, and its index.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    direction: [f32; 3],
    index: u32,
}

impl Prefixes {
    /// The [`prefix`] of `count` lights.
    pub fn prefix(&mut self, lights: &[Light], count: usize, joined: &mut Vec<Light>) {
        if is_short(lights, count) {
            self.load(lights);
        }
        self.join(lights, count, joined, |_, _| {});
    }

    /// [`Self::prefix`], with the index in `joined` of the light that each of `lights` has joined; the first
    /// `count` have joined themselves. A `count` of 0 leaves `heads` empty, as there is nothing to join.
    pub fn prefix_with_heads(
        &mut self,
        lights: &[Light],
        count: usize,
        joined: &mut Vec<Light>,
        heads: &mut Vec<u32>,
    ) {
        heads.clear();
        if count > 0 {
            heads.extend(0..lights.len() as u32);
        }
        if is_short(lights, count) {
            self.load(lights);
        }
        self.join(lights, count, joined, |light, head| heads[light] = head);
    }

    /// Loads the lights whose prefixes are made next.
    pub(super) fn load(&mut self, lights: &[Light]) {
        let place =
            |(index, light): (usize, &Light)| Place { direction: light.direction, index: index as u32 };
        self.by_height.clear();
        self.by_height.extend(lights.iter().enumerate().map(place));
        self.by_height.sort_unstable_by(|a, b| a.direction[1].total_cmp(&b.direction[1]));
        self.shares.clear();
        self.shares.extend(lights.iter().map(Share::of));
    }

    /// [`prefix`] of the lights that were loaded; calls `found` with the index of every light from `count` on
    /// and that of its head.
    pub(super) fn join(
        &mut self,
        lights: &[Light],
        count: usize,
        joined: &mut Vec<Light>,
        mut found: impl FnMut(usize, u32),
    ) {
        joined.clear();
        joined.extend_from_slice(&lights[..count.min(lights.len())]);
        if !is_short(lights, count) {
            return;
        }
        self.part(count);
        self.joining.clear();
        self.joining.resize(count, Share::default());
        for group in self.others.chunks(LANES) {
            for (light, head) in group.iter().zip(nearest_heads(&self.heads, group)) {
                self.joining[head as usize].add(&self.shares[light.index as usize]);
                found(light.index as usize, head);
            }
        }
        for ((head, joining), own) in joined.iter_mut().zip(&self.joining).zip(&self.shares) {
            // Otherwise the head stays as it is and is not even rounded again.
            if joining.flux != [0.0; 3] {
                let mut share = *own;
                share.add(joining);
                *head = share.light(head.id, head.direction);
            }
        }
    }

    /// Splits the lights into the first `count` and the others, in the order of height.
    fn part(&mut self, count: usize) {
        // Every light is written to both lists and kept in one of them: a branch would often be mispredicted.
        self.heads.resize(self.by_height.len(), Place::default());
        self.others.resize(self.by_height.len(), Place::default());
        let (mut head_count, mut other_count) = (0, 0);
        for &place in &self.by_height {
            self.heads[head_count] = place;
            self.others[other_count] = place;
            let is_head = (place.index as usize) < count;
            head_count += usize::from(is_head);
            other_count += usize::from(!is_head);
        }
        self.heads.truncate(head_count);
        self.others.truncate(other_count);
    }
}

/// Whether there are heads and others that join them.
fn is_short(lights: &[Light], count: usize) -> bool {
    (1..lights.len()).contains(&count)
}

/// For up to [`LANES`] lights of about the same height the index of the nearest head; the lowest of equally
/// near ones.
///
/// Heads are in the order of height. Directions whose heights differ by h have a dot product of at most `1 -
/// h^2 / 2`: once that is less than what was found, those beyond are no nearer.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
fn nearest_heads(heads: &[Place], lights: &[Place]) -> [u32; LANES] {
    // Lanes without a light repeat the last.
    let light = |lane: usize| lights[lane.min(lights.len() - 1)].direction;
    let [x, y, z]: [[f32; LANES]; 3] =
        std::array::from_fn(|axis| std::array::from_fn(|lane| light(lane)[axis]));
    let (lowest, highest) = (y[0], y[LANES - 1]);
    let mut best = [f32::NEG_INFINITY; LANES];
    let mut index = [0; LANES];
    let mut below = heads.partition_point(|head| head.direction[1] < 0.5 * (lowest + highest));
    let mut above = below;
    loop {
        let least =
            best.into_iter().fold(f32::INFINITY, |least, best| if best < least { best } else { least });
        let matters = |height: f32| 1.0 - 0.5 * height.max(0.0).powi(2) + SLACK >= least;
        let first = match below.checked_sub(1) {
            Some(next) if matters(lowest - heads[next].direction[1]) => below.saturating_sub(STEP),
            _ => below,
        };
        let end = match heads.get(above) {
            Some(next) if matters(next.direction[1] - highest) => (above + STEP).min(heads.len()),
            _ => above,
        };
        if first == below && end == above {
            return index;
        }
        for heads in [&heads[first..below], &heads[above..end]] {
            // Copied to local variables: a choice between memory locations would not be vectorised.
            for &Place { direction: d, index: head } in heads {
                for lane in 0..LANES {
                    let dot = x[lane] * d[0] + y[lane] * d[1] + z[lane] * d[2];
                    let is_nearer = (dot > best[lane]) | ((dot == best[lane]) & (head < index[lane]));
                    best[lane] = if is_nearer { dot } else { best[lane] };
                    index[lane] = if is_nearer { head } else { index[lane] };
                }
            }
        }
        (below, above) = (first, end);
    }
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
            Prefixes::default().prefix_with_heads(&lights, count, &mut with_heads, &mut heads);
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
    fn of_equally_near_heads_the_first_is_found_wherever_lights_crowd() {
        // Twice each, so that there are ties; in a bunch, evenly, and all at one height.
        let even = crate::math::fibonacci_sphere(300);
        let bunch = crate::math::fibonacci_sphere(300)
            .map(|d| (direction(0.7, 3.0) + 0.01 * d).normalize_or(DVec3::Y));
        let circle = (0..300).map(|i| direction(1.2, 0.02 * f64::from(i)));
        let lights: Vec<Light> = even
            .chain(bunch)
            .chain(circle)
            .flat_map(|d| [d; 2])
            .enumerate()
            .map(|(i, d)| Light { direction: d.as_vec3().to_array(), ..light(i as u32, 0.0, 0.0, 1.0, 0.0) })
            .collect();
        // They are shuffled, because heads come first.
        let lights: Vec<Light> = (0..lights.len()).map(|i| lights[i * 1009 % lights.len()]).collect();
        let (mut joined, mut heads) = (Vec::new(), Vec::new());
        for count in [1, 7, 64, 900, 1799] {
            Prefixes::default().prefix_with_heads(&lights, count, &mut joined, &mut heads);
            for (late, &found) in lights.iter().zip(&heads).skip(count) {
                let dot = |head: &Light| {
                    let ([x, y, z], [a, b, c]) = (late.direction, head.direction);
                    x * a + y * b + z * c
                };
                let (mut best, mut expected) = (f32::NEG_INFINITY, 0);
                for (index, head) in lights[..count].iter().enumerate() {
                    if dot(head) > best {
                        (best, expected) = (dot(head), index as u32);
                    }
                }
                assert_eq!(found, expected, "{count}");
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
        Prefixes::default().prefix_with_heads(&lights, 0, &mut joined, &mut heads);
        assert!(joined.is_empty() && heads.is_empty());
        Prefixes::default().prefix_with_heads(&lights, 2, &mut joined, &mut heads);
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
