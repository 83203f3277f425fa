use super::*;
use crate::math::{angle_between, direction, fibonacci_sphere};
use glam::DVec3;
use std::f64::consts::TAU;

fn light(id: u32, towards: DVec3, power: f32) -> Light {
    Light {
        id,
        direction: towards.as_vec3().to_array(),
        irradiance: [power, 0.5 * power, 0.25 * power],
        spread_rad: 0.0,
    }
}

fn exact(light: &Light) -> DVec3 {
    DVec3::from(light.direction.map(f64::from))
}

/// `count` lights in an order that does not depend on their directions; over the sphere, or over the upper
/// hemisphere.
fn scattered(seed: u32, count: u32, whole: bool) -> Vec<Light> {
    let mut state = seed.wrapping_mul(747_796_405).wrapping_add(1);
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24)
    };
    (0..count)
        .map(|id| {
            let y: f64 = if whole { 2.0 * random() - 1.0 } else { random() };
            light(id + 100, direction(y.acos(), TAU * random()), 0.1 + random() as f32)
        })
        .collect()
}

fn epsilon_rad(most: usize) -> f64 {
    1.85 * (2.0 / most as f64).sqrt().min(1.0).asin()
}

/// The rule of the paper and the rule for the lights left over, literally, in f64 and with a set of free
/// lights.
fn cluster_slowly(lights: &[Light], most: usize) -> Vec<Vec<usize>> {
    let mut free: Vec<usize> = (0..lights.len()).filter(|&i| lights[i].irradiance != [0.0; 3]).collect();
    let apart = |a: usize, b: usize| angle_between(exact(&lights[a]), exact(&lights[b]));
    let mut clusters: Vec<Vec<usize>> = Vec::new();
    while let Some(&first) = free.first().filter(|_| clusters.len() < most) {
        let (near, far) = free.into_iter().partition(|&i| apart(first, i) <= epsilon_rad(most));
        clusters.push(near);
        free = far;
    }
    let founders: Vec<usize> = clusters.iter().map(|members| members[0]).collect();
    for left in free {
        let distances: Vec<f64> = founders.iter().map(|&founder| apart(founder, left)).collect();
        let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
        clusters[distances.iter().position(|&d| d == least).unwrap()].push(left);
    }
    clusters
}

#[test]
fn clusters_are_those_of_the_paper_and_keep_power_order_and_bound() {
    let (mut clusters, mut places) = (Vec::new(), Vec::new());
    for whole in [false, true] {
        let mut lights = scattered(1, 150, whole);
        lights[3].irradiance = [0.0; 3];
        lights[90].irradiance = [0.0; 3];
        let mut merged = 0;
        for most in 1..=160 {
            cluster(&lights, most, &mut clusters, &mut places);
            let expected = cluster_slowly(&lights, most);
            assert!(clusters.len() == expected.len() && clusters.len() <= most, "{most}");
            assert!(places[3] == NO_CLUSTER && places[90] == NO_CLUSTER);
            let mut all = [0.0; 3];
            for (place, members) in expected.iter().enumerate() {
                let found: Vec<usize> = (0..150).filter(|&i| places[i] == place as u32).collect();
                let mut sorted = members.clone();
                sorted.sort_unstable();
                assert_eq!(found, sorted, "{most} {place}");
                assert_eq!(clusters[place].id, lights[members[0]].id);
                for channel in 0..3 {
                    // Sums in f64 do not depend on the order to the last digit of f32.
                    let sum: f64 = found.iter().map(|&i| f64::from(lights[i].irradiance[channel])).sum();
                    assert_eq!(clusters[place].irradiance[channel], sum as f32);
                    all[channel] += sum;
                }
                merged += usize::from(found.len() > 1);
            }
            let sum = lights.iter().map(|l| f64::from(l.irradiance[1])).sum::<f64>();
            assert!((all[1] / sum - 1.0).abs() < 1e-14);
            assert!(expected.windows(2).all(|pair| pair[0][0] < pair[1][0]), "order of founders");
        }
        assert!(merged > 1000, "{merged}");
    }
}

#[test]
fn a_joined_light_is_that_of_a_prefix() {
    // Within 20 degrees of the first: one cluster, and with one head one prefix.
    let lights: Vec<Light> = (0..9u8)
        .map(|i| {
            let towards = direction(0.5 + 0.02 * f64::from(i), 0.05 * f64::from(i));
            Light { spread_rad: 0.01 * f32::from(i), ..light(40 + u32::from(i), towards, 1.0 + f32::from(i)) }
        })
        .collect();
    let (mut clusters, mut places, mut joined) = (Vec::new(), Vec::new(), Vec::new());
    cluster(&lights, 40, &mut clusters, &mut places);
    super::super::prefix(&lights, 1, &mut joined);
    assert_eq!((clusters.len(), clusters[0].id, clusters[0].irradiance), (1, 40, joined[0].irradiance));
    assert!(angle_between(exact(&clusters[0]), exact(&joined[0])) < 1e-7);
    assert!((clusters[0].spread_rad - joined[0].spread_rad).abs() < 1e-6);
}

#[test]
fn evenly_spread_lights_of_the_hemisphere_fill_the_bound_without_remainder() {
    // The purpose of c_f: about `most` clusters, none with lights farther off than epsilon.
    for most in [8, 16, 32, 72] {
        let mut lights: Vec<Light> =
            fibonacci_sphere(2000).take(1000).enumerate().map(|(i, d)| light(i as u32, d, 1.0)).collect();
        lights.sort_by_key(|light| light.id * 617 % 1009);
        let (mut clusters, mut places) = (Vec::new(), Vec::new());
        cluster(&lights, most, &mut clusters, &mut places);
        println!("at most {most}: {} clusters", clusters.len());
        assert!(clusters.len() <= most && 3 * clusters.len() >= most, "{most}: {}", clusters.len());
    }
}

#[test]
fn a_sun_keeps_its_direction_wherever_it_stands_in_the_list() {
    let sun = light(7, direction(0.8, 2.0), 1e4);
    for at in [0, 40, 99] {
        let mut lights = scattered(3, 99, false);
        lights.insert(at, sun);
        let (mut clusters, mut places) = (Vec::new(), Vec::new());
        cluster(&lights, 16, &mut clusters, &mut places);
        let brightest = clusters.iter().max_by(|a, b| a.luminance().total_cmp(&b.luminance())).unwrap();
        assert!(brightest.irradiance[0] >= 1e4);
        // At most 99 lights of up to 1.1 at up to epsilon pull it.
        assert!(angle_between(exact(brightest), exact(&sun)) < 99.0 * 1.1 / 1e4, "{at}");
    }
}

#[test]
fn lights_that_move_a_little_keep_their_cluster_unless_one_stands_on_a_border() {
    const STEP_RAD: f64 = 1e-5;
    let (mut before, mut after, mut places, mut moved_places) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut steady = 0;
    for seed in 0..200 {
        let most = [8, 16, 32, 72][seed as usize % 4];
        let lights = scattered(seed, 100, false);
        let moved: Vec<Light> = lights
            .iter()
            .map(|light| {
                let d = exact(light);
                let turn = d.any_orthonormal_vector() * STEP_RAD;
                Light { direction: (d + turn).as_vec3().to_array(), ..*light }
            })
            .collect();
        cluster(&lights, most, &mut before, &mut places);
        let members = cluster_slowly(&lights, most);
        let founders = || members.iter().map(|members| exact(&lights[members[0]]));
        let is_near_border = lights.iter().any(|light| {
            founders().any(|founder| {
                (angle_between(founder, exact(light)) - epsilon_rad(most)).abs() < 2.5 * STEP_RAD
            })
        });
        let is_full = before.len() == most; // then lights may also stand between two clusters
        if is_near_border || is_full {
            continue;
        }
        cluster(&moved, most, &mut after, &mut moved_places);
        assert_eq!(places, moved_places, "{seed}");
        for (a, b) in before.iter().zip(&after) {
            // A mean of vectors moves by no more than they do, over its length.
            let most_rad = STEP_RAD / f64::from(a.spread_rad).cos() + 3e-7;
            assert!(angle_between(exact(a), exact(b)) < most_rad, "{seed}");
        }
        steady += 1;
    }
    assert!(steady > 150, "{steady} of 200");
}

#[test]
fn degenerate_lists_have_their_answer() {
    let (mut clusters, mut places) = (vec![light(0, DVec3::Y, 1.0)], vec![3]);
    cluster(&[], 4, &mut clusters, &mut places);
    assert!(clusters.is_empty() && places.is_empty());
    let same: Vec<Light> = (0..50).map(|id| light(id, direction(1.0, 2.0), 2.0)).collect();
    cluster(&same, 0, &mut clusters, &mut places);
    assert!(clusters.is_empty() && places == [NO_CLUSTER; 50]);
    for most in [1, 50, usize::MAX] {
        cluster(&same, most, &mut clusters, &mut places);
        assert_eq!((clusters.len(), clusters[0].irradiance), (1, [100.0, 50.0, 25.0]));
        // The length of a unit vector in f32 is good to 1e-7, and acos(1 - 1e-7) = 4.5e-4.
        assert!(clusters[0].spread_rad < 5e-4);
        assert!(angle_between(exact(&clusters[0]), exact(&same[0])) < 1e-7);
    }
    let dark: Vec<Light> = same.iter().map(|light| Light { irradiance: [0.0; 3], ..*light }).collect();
    cluster(&dark, 4, &mut clusters, &mut places);
    assert!(clusters.is_empty() && places == [NO_CLUSTER; 50]);
    // It is alone in its cluster, and bit for bit as it was.
    let odd = Light { direction: [0.6, 0.800_001, 0.0], spread_rad: 0.3, ..same[9] };
    cluster(&[dark[0], odd], 4, &mut clusters, &mut places);
    assert_eq!((clusters.as_slice(), places.as_slice()), (&[odd][..], &[NO_CLUSTER, 0][..]));
}

#[test]
fn opposite_lights_that_cancel_keep_the_direction_of_the_founder() {
    let lights = [light(4, DVec3::Y, 1.0), light(5, -DVec3::Y, 1.0)];
    let (mut clusters, mut places) = (Vec::new(), Vec::new());
    cluster(&lights, 1, &mut clusters, &mut places);
    assert_eq!((clusters.len(), clusters[0].id, clusters[0].direction), (1, 4, [0.0, 1.0, 0.0]));
    assert_eq!(clusters[0].irradiance, [2.0, 1.0, 0.5]);
    assert!((clusters[0].spread_rad - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    cluster(&lights, 2, &mut clusters, &mut places);
    assert_eq!(clusters, lights);
}
