use super::*;
use crate::math::direction;

fn light(towards: DVec3, power: f32) -> Light {
    Light {
        id: 0,
        direction: towards.as_vec3().to_array(),
        irradiance: [power, 0.5 * power, 0.25 * power],
        spread_rad: 0.0,
    }
}

fn exact(direction: [f32; 3]) -> DVec3 {
    DVec3::from(direction.map(f64::from))
}

fn lights_over_sphere(count: usize) -> Vec<Light> {
    fibonacci_sphere(count).map(|d| light(d, 1.0)).collect()
}

/// Whether each region (row) keeps each light (column).
fn membership(regions: &Regions, lights: &[Light]) -> Vec<Vec<bool>> {
    let mut lists = RegionLists::default();
    regions.assign(lights, lights.len(), &mut lists);
    (0..regions.count())
        .map(|region| {
            let mut row = vec![false; lights.len()];
            lists.kept(region).iter().for_each(|&index| row[index as usize] = true);
            row
        })
        .collect()
}

/// 100,000 directions: half of them even, half within rounding of the corners of cells, where regions end.
fn directions(side: u32) -> Vec<[f32; 3]> {
    let even = fibonacci_sphere(50_000).map(|d| d.as_vec3().to_array());
    let edge = (0..50_000u32).map(|i| {
        let (row, column) = (i / 6 % (side + 1), i / 6 / (side + 1) % (side + 1));
        let nudge =
            |k: u32| 1e-6 * (f64::from(i.wrapping_mul(2_654_435_761).rotate_left(k) % 1000) - 499.5) / 500.0;
        let corner = cube_direction(i % 6, f64::from(row), f64::from(column), side);
        (corner + DVec3::new(nudge(0), nudge(9), nudge(18))).as_vec3().to_array()
    });
    even.chain(edge).collect()
}

#[test]
fn no_light_that_a_normal_sees_is_missing_from_its_region() {
    for regions in [Regions::for_normals(), Regions::new(7, FRAC_PI_2), Regions::new(1, FRAC_PI_2)] {
        // Every second light is one that the farthest corner of some region only just sees, or just does not.
        let mut lights = lights_over_sphere(1000);
        for index in 0..1000 {
            let region = index % regions.count();
            let centre = exact(regions.caps[region][..3].try_into().unwrap());
            let side = centre.any_orthonormal_vector();
            let turn = centre.cross(side) * (index as f64).sin() + side * (index as f64).cos();
            let border_rad = regions.reach_rad(region) + FRAC_PI_2 + 1e-7 * (index % 5) as f64 - 2e-7;
            lights.push(light(centre * border_rad.cos() + turn * border_rad.sin(), 1.0));
        }
        let member = membership(&regions, &lights);
        let (mut seen, mut missing) = (0, 0);
        for normal in directions(regions.side()) {
            let row = &member[regions.region(normal)];
            for (light, &is_member) in lights.iter().zip(row) {
                let is_seen = exact(normal).dot(exact(light.direction)) > 0.0;
                seen += usize::from(is_seen);
                missing += usize::from(is_seen && !is_member);
            }
        }
        assert!(missing == 0 && seen > 90_000_000, "{missing} of {seen}");
    }
}

#[test]
fn lights_that_the_farthest_corner_just_sees_are_kept_and_those_a_little_beyond_are_not() {
    let regions = Regions::for_normals();
    let side = regions.side();
    let mut farthest = vec![(0.0, DVec3::ZERO); regions.count()];
    for (cell, &region) in regions.table().iter().enumerate() {
        let cell = cell as u32;
        let (face, row, column) = (cell / (side * side), cell / side % side, cell % side);
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let corner = cube_direction(face, f64::from(row + i), f64::from(column + j), side);
            let centre = exact(regions.caps[region as usize][..3].try_into().unwrap());
            let angle_rad = angle_between(centre, corner);
            if angle_rad > farthest[region as usize].0 {
                farthest[region as usize] = (angle_rad, corner);
            }
        }
    }
    for (region, (angle_rad, corner)) in farthest.into_iter().enumerate() {
        assert!((angle_rad - regions.reach_rad(region)).abs() < 2e-6);
        let centre = exact(regions.caps[region][..3].try_into().unwrap());
        let across = (corner - centre * corner.dot(centre)).try_normalize().unwrap();
        let at = |rad: f64| light(centre * (angle_rad + rad).cos() - across * (angle_rad + rad).sin(), 1.0);
        let beyond = |rad: f64| {
            // Opposite to the corner as seen from the centre, at reach + pi/2 + rad from it.
            let light = at(FRAC_PI_2 + rad);
            membership(&regions, &[light])[region][0]
        };
        assert!(beyond(-1e-6) && beyond(0.0) && !beyond(1e-5), "{region}");
    }
}

#[test]
fn every_cone_about_a_direction_lies_in_its_region() {
    for gamma_rad in [5f64.to_radians(), 20f64.to_radians(), 1.5] {
        let regions = Regions::for_cones(gamma_rad);
        let lights = lights_over_sphere(2000);
        let member = membership(&regions, &lights);
        let (mut inside, cos) = (0, (0.5 * gamma_rad).cos());
        for axis in directions(regions.side()).into_iter().step_by(7) {
            let length = exact(axis).length();
            for (light, &is_member) in lights.iter().zip(&member[regions.region(axis)]) {
                let is_inside = exact(axis).dot(exact(light.direction)) >= cos * length;
                assert!(!is_inside || is_member, "{gamma_rad} {axis:?} {light:?}");
                inside += usize::from(is_inside);
            }
        }
        // The expected number follows from the solid angle of the cone.
        let expected = 0.5 * (1.0 - cos) * 2000.0 * 100_000.0 / 7.0;
        assert!((inside as f64 / expected - 1.0).abs() < 0.2, "{gamma_rad}: {inside}, {expected}");
    }
}

#[test]
fn centres_of_cones_are_about_gamma_apart() {
    for degrees in [6.0, 10.0, 25.0] {
        let gamma_rad = f64::to_radians(degrees);
        let regions = Regions::for_cones(gamma_rad);
        let centres: Vec<DVec3> = regions.caps.iter().map(|c| exact([c[0], c[1], c[2]])).collect();
        for (i, &a) in centres.iter().enumerate() {
            let others = centres.iter().enumerate().filter(|&(j, _)| j != i);
            let nearest_rad = others.map(|(_, &b)| angle_between(a, b)).fold(PI, f64::min);
            assert!((0.8..1.1).contains(&(nearest_rad / gamma_rad)), "{degrees}: {nearest_rad}");
        }
        assert!((0..regions.count()).all(|region| regions.reach_rad(region) < gamma_rad));
    }
    assert_eq!(Regions::for_cones(0.01).count(), MAX_REGIONS);
    for gamma_rad in [0.0, -1.0, f64::NAN] {
        assert_eq!(Regions::for_cones(gamma_rad).count(), MAX_REGIONS, "{gamma_rad}");
    }
    for gamma_rad in [7.0, f64::INFINITY] {
        assert_eq!(Regions::for_cones(gamma_rad).caps[0][3], EVERYTHING, "{gamma_rad}");
    }
}

#[test]
fn culling_gains_what_the_paper_found() {
    let regions = Regions::for_normals();
    let hemisphere: Vec<Light> = lights_over_sphere(600).into_iter().take(300).collect();
    assert!(hemisphere.iter().all(|light| light.direction[1] > 0.0));
    for (name, lights) in [("sphere", lights_over_sphere(300)), ("hemisphere", hemisphere)] {
        let mut lists = RegionLists::default();
        regions.assign(&lights, 300, &mut lists);
        let mean = regions.mean_lights(&lists);
        let gain = 300.0 / mean;
        println!("300 lights over the {name}, 200 regions: {mean:.1} a region, gain {gain:.3}");
        assert!((1.6..1.8).contains(&gain), "{name}: {gain}");
    }
    let reaches = || (0..regions.count()).map(|region| regions.reach_rad(region).to_degrees());
    println!(
        "side {}, reach {:.2} to {:.2} degrees",
        regions.side(),
        reaches().fold(180.0, f64::min),
        reaches().fold(0.0, f64::max)
    );
}

#[test]
fn the_mean_is_that_of_directions_and_every_region_has_cells() {
    for regions in [Regions::for_normals(), Regions::for_cones(0.0), Regions::new(3, 0.4)] {
        assert!((regions.solid_angles_sr.iter().sum::<f64>() / (4.0 * PI) - 1.0).abs() < 1e-12);
        assert!(regions.solid_angles_sr.iter().all(|&sr| sr > 0.0));
        let lights = [light(direction(0.3, 1.0), 1.0), light(direction(1.3, 4.0), 1.0)];
        let mut lists = RegionLists::default();
        regions.assign(&lights, 2, &mut lists);
        let kept = fibonacci_sphere(100_000)
            .map(|d| lists.kept(regions.region(d.as_vec3().to_array())).len())
            .sum::<usize>();
        assert!((kept as f64 / 1e5 - regions.mean_lights(&lists)).abs() < 0.005);
    }
}

#[test]
fn a_region_cut_short_keeps_the_first_lights_and_the_luminance_of_all() {
    let regions = Regions::for_normals();
    let mut lights: Vec<Light> = lights_over_sphere(97)
        .into_iter()
        .enumerate()
        .map(|(i, l)| light(exact(l.direction), i as f32))
        .collect();
    // The Fibonacci points run from pole to pole; they are shuffled, so that the order matters.
    lights.sort_by_key(|light| (light.irradiance[0] as u32 * 41) % 97);
    let (mut all, mut cut) = (RegionLists::default(), RegionLists::default());
    regions.assign(&lights, 97, &mut all);
    for capacity in [97, 20, 1, 0, 40] {
        regions.assign(&lights, capacity, &mut cut);
        assert_eq!((cut.indices.len(), cut.within.as_slice()), (200 * capacity, all.within.as_slice()));
        for region in 0..200 {
            let (whole, kept) = (all.kept(region), cut.kept(region));
            assert_eq!(kept, &whole[..whole.len().min(capacity)]);
            assert!(whole.iter().all(|&index| lights[index as usize].irradiance != [0.0; 3]));
            let sum =
                |list: &[u32]| list.iter().map(|&i| f64::from(lights[i as usize].luminance())).sum::<f64>();
            let factor = f64::from(cut.factors[region]);
            if kept.len() == whole.len() || kept.is_empty() {
                assert_eq!(factor, 1.0);
            } else {
                assert!((factor * sum(kept) / sum(whole) - 1.0).abs() < 1e-6, "{region}");
            }
        }
    }
}

#[test]
fn nothing_and_lights_that_are_not_sound_have_their_answer() {
    let regions = Regions::new(0, f64::NAN);
    assert_eq!((regions.count(), regions.caps[0][3]), (1, EVERYTHING));
    let mut lists = RegionLists::default();
    regions.assign(&[], 4, &mut lists);
    assert_eq!((lists.within.as_slice(), lists.factors.as_slice()), (&[0][..], &[1.0][..]));
    assert!(lists.kept(0).is_empty() && regions.mean_lights(&lists) == 0.0);
    let up = direction(0.0, 0.0);
    let mut lights = [light(up, 1e-45), light(up, 0.0), light(up, f32::MAX), light(up, 1.0)];
    lights[3].direction = [f32::NAN; 3];
    regions.assign(&lights, 1, &mut lists);
    assert_eq!((lists.kept(0), lists.within[0], lists.factors[0]), (&[0][..], 2, f32::MAX));
    assert_eq!(Regions::new(usize::MAX, 0.0).count(), MAX_REGIONS);
}
