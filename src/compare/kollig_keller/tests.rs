use super::{grow, kollig_keller, relax};
use lightcast_core::image::{PolarMap, PolarShape, luminance_f64};
use lightcast_core::light::{Light, Voronoi};
use lightcast_core::math::fibonacci_sphere;
use lightcast_core::test_data::{hard_maps, real_map};

fn even_sites(count: usize) -> Vec<[f32; 3]> {
    fibonacci_sphere(count).map(|direction| direction.as_vec3().to_array()).collect()
}

fn run(map: &PolarMap, count: usize) -> Vec<Light> {
    let (mut voronoi, mut sites, mut lights) =
        (Voronoi::new(map.shape, count), even_sites(count), Vec::new());
    kollig_keller(map, &mut voronoi, &mut sites, &mut lights);
    lights
}

/// Sum over pixels of flux times squared distance to the nearest site, by brute force.
fn energy(map: &PolarMap, sites: &[[f32; 3]]) -> f64 {
    let mut sum = 0.0;
    for row in 0..map.shape.rows() {
        for column in 0..map.shape.columns() {
            let direction = map.shape.pixel_direction(row, column);
            let squares = sites.iter().map(|&[x, y, z]| {
                (direction - glam::DVec3::new(f64::from(x), f64::from(y), f64::from(z))).length_squared()
            });
            sum += f64::from(map.luminance(row, column))
                * map.shape.pixel_solid_angle(row)
                * squares.fold(f64::INFINITY, f64::min);
        }
    }
    sum
}

fn garden() -> Option<PolarMap> {
    real_map("chinese_garden_1k.hdr", PolarShape::hemisphere(120, 30))
}

#[test]
fn neither_relaxation_nor_growth_raises_the_energy() {
    let spotted = PolarMap::from_fn(PolarShape::hemisphere(72, 18), |row, column| {
        [(1 + (row * 31 + column * 17) % 23) as f32, 1.0, if row == 9 { 40.0 } else { 0.5 }]
    });
    for map in [Some(spotted), garden()].into_iter().flatten() {
        let (count, mut used) = (64, 1);
        let (mut voronoi, mut sites, mut lights) =
            (Voronoi::new(map.shape, count), even_sites(count), Vec::new());
        relax(&mut voronoi, &map, &mut sites[..1], &mut lights);
        let mut last = energy(&map, &sites[..1]);
        let start = last;
        while used < count {
            let grown = grow(map.shape, &mut sites, used, 0, &lights).unwrap();
            assert!(grown > used);
            used = grown;
            for _ in 0..3 {
                let now = energy(&map, &sites[..used]);
                // Sites are rounded to f32.
                assert!(now <= last * (1.0 + 1e-6), "{used} sites: {last} to {now}");
                last = now;
                relax(&mut voronoi, &map, &mut sites[..used], &mut lights);
            }
        }
        assert!(last < 0.1 * start, "{start} to {last}");
    }
}

#[test]
fn lights_are_much_alike_in_power_on_a_smooth_map() {
    let shape = PolarShape::hemisphere(180, 45);
    let map =
        PolarMap::from_fn(shape, |row, column| [(1.5 + shape.pixel_direction(row, column).x) as f32; 3]);
    let lights = run(&map, 64);
    let mean = luminance_f64(map.power()) / 64.0;
    let worst = lights.iter().map(|light| f64::from(light.luminance()) / mean).fold(0.0, f64::max);
    assert!(worst < 2.0, "{worst}");
}

#[test]
fn a_sun_of_one_pixel_is_split_no_further() {
    let shape = PolarShape::hemisphere(36, 9);
    let map = PolarMap::from_fn(shape, |r, c| if (r, c) == (4, 20) { [1e8; 3] } else { [1.0; 3] });
    let lights = run(&map, 64);
    let bright = lights.iter().filter(|light| light.luminance() > 1e3).count();
    let dark = lights.iter().filter(|light| light.luminance() == 0.0).count();
    assert!(bright == 1 && dark < 8, "{bright} bright, {dark} dark");
}

#[test]
fn two_lamps_are_two_lights_wherever_they_are() {
    let shape = PolarShape::hemisphere(36, 9);
    for second in 0..shape.len() {
        let first = 4 * 36 + 20;
        let mut map = PolarMap::black(shape);
        (map.pixels[first], map.pixels[second]) = ([5.0; 3], [7.0; 3]);
        for count in [2, 3, 7] {
            let lights = run(&map, count);
            let lit: Vec<&Light> = lights.iter().filter(|light| light.luminance() > 0.0).collect();
            assert_eq!(
                lit.len(),
                if first == second { 1 } else { 2 },
                "{second}, {count} lights: {lights:?}"
            );
            assert!(lit.iter().all(|light| light.spread_rad == 0.0), "{second}, {count} lights: {lit:?}");
        }
    }
}

#[test]
fn power_is_kept_on_hard_maps_and_without_light_sites_stay() {
    for (name, map) in hard_maps().into_iter().filter(|(name, _)| *name != "largest values") {
        for count in [1, 7, 64] {
            let lights = run(&map, count);
            assert_eq!(lights.len(), count, "{name}");
            for channel in 0..3 {
                let sum: f64 = lights.iter().map(|light| f64::from(light.irradiance[channel])).sum();
                let expected = map.power()[channel];
                // Below 1e-38 f32 has less precision.
                let tolerance = if name == "tiny values" { 0.05 } else { 1e-5 };
                assert!((sum - expected).abs() <= tolerance * expected, "{name} {count}: {sum} {expected}");
            }
        }
    }
    let black = PolarMap::black(hard_maps()[0].1.shape);
    let lights = run(&black, 20);
    for (light, site) in lights.iter().zip(even_sites(20)) {
        assert!(light.direction == site && light.irradiance == [0.0; 3]);
    }
}
