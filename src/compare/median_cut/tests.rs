use super::{median_cut, regions};
use crate::compare::rectangles::{Content, Pixels, Rectangle};
use crate::compare::variance_minimisation;
use lightcast_core::image::{PolarMap, PolarShape, luminance_f64};
use lightcast_core::light::Light;
use lightcast_core::test_data::{hard_maps, real_maps};

const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);

fn energy(pixels: &Pixels<'_>, rectangle: &Rectangle) -> f64 {
    luminance_f64(pixels.share(rectangle, Content::Light).flux)
}

/// Number of rectangles with pixels of a source, which `is_of` identifies.
fn count_sharing(rectangles: &[Rectangle], is_of: impl Fn(usize, usize) -> bool) -> usize {
    let shares =
        |r: &&Rectangle| r.rows.clone().any(|row| r.columns.clone().any(|column| is_of(row, column)));
    rectangles.iter().filter(shares).count()
}

/// Checks that every pixel lies in exactly one rectangle.
fn check_tiling(case: &str, map: &PolarMap, rectangles: &[Rectangle]) {
    let mut visits = vec![0; map.pixels.len()];
    for Rectangle { rows, columns } in rectangles {
        for row in rows.clone() {
            for column in columns.clone() {
                visits[row * map.shape.columns() + column] += 1;
            }
        }
    }
    assert!(visits.iter().all(|&n| n == 1), "{case}");
}

#[test]
fn regions_of_a_smooth_map_are_even_in_energy() {
    // With fine pixels and a sky that brightens smoothly towards one side, each of six cuts is off by at most
    // half a slice.
    let shape = PolarShape::hemisphere(1440, 720);
    let map = PolarMap::from_fn(shape, |row, column| {
        let direction = shape.pixel_direction(row, column);
        [(2.0 + direction.x + direction.y) as f32; 3]
    });
    let pixels = Pixels::new(&map);
    let share = luminance_f64(map.power()) / 64.0;
    let regions = regions(&pixels, 64);
    assert_eq!(regions.len(), 64);
    check_tiling("smooth", &map, &regions);
    for region in &regions {
        let off = energy(&pixels, region) / share - 1.0;
        assert!(off.abs() < 0.03, "{region:?}: {off}");
    }
}

#[test]
fn a_constant_map_gives_even_rectangles() {
    // At its middle row, this map is 4.3 rad wide, and it is 1.5 rad high: the first two cuts divide the
    // azimuth.
    let shape = PolarShape::new(320, 5, 1.5).unwrap();
    for map in [PolarMap::from_fn(shape, |_, _| [3.0; 3]), PolarMap::black(shape)] {
        // The order is that of the cuts: the first 2^k lie in different regions of round k.
        let expected = [0, 160, 80, 240].map(|start| Rectangle { rows: 0..5, columns: start..start + 80 });
        assert_eq!(regions(&Pixels::new(&map), 4), expected);
    }
}

#[test]
fn powers_of_two_are_rounds_and_what_is_between_cuts_the_brightest() {
    let map = PolarMap::from_fn(SHAPE, |row, column| [(1 + row * column % 17) as f32; 3]);
    let pixels = Pixels::new(&map);
    let (eight, eleven, sixteen) = (regions(&pixels, 8), regions(&pixels, 11), regions(&pixels, 16));
    // Every region of 16 is half of the region of 8 with the same index.
    for (index, parent) in eight.iter().enumerate() {
        let [first, second] = [&sixteen[index], &sixteen[index + 8]];
        let both = energy(&pixels, first) + energy(&pixels, second);
        assert!((both / energy(&pixels, parent) - 1.0).abs() < 1e-12);
    }
    let mut ranked: Vec<usize> = (0..8).collect();
    ranked.sort_by(|&a, &b| energy(&pixels, &eight[b]).total_cmp(&energy(&pixels, &eight[a])));
    for (rank, &index) in ranked.iter().enumerate() {
        assert_eq!(eleven[index] == eight[index], rank >= 3, "rank {rank}");
    }
    check_tiling("eleven", &map, &eleven);
}

#[test]
fn hard_maps_are_tiled_and_every_pixel_alone_is_the_end() {
    for (name, map) in hard_maps() {
        let pixels = Pixels::new(&map);
        for count in [1, 2, 7, 64, 5000] {
            for (method, regions) in [
                ("median cut", regions(&pixels, count)),
                ("variance", variance_minimisation::regions(&pixels, count)),
            ] {
                let case = format!("{name} {method} {count}");
                assert_eq!(regions.len(), count.min(map.pixels.len()), "{case}");
                check_tiling(&case, &map, &regions);
            }
        }
    }
}

#[test]
fn lights_are_the_power_of_their_regions() {
    let map = PolarMap::from_fn(SHAPE, |row, column| [1.0, row as f32, column as f32]);
    let mut lights: Vec<Light> = Vec::new();
    median_cut(&map, 48, &mut lights);
    let (power, sum) = (map.power(), |channel: usize| {
        lights.iter().map(|light| f64::from(light.irradiance[channel])).sum::<f64>()
    });
    for channel in 0..3 {
        assert!((sum(channel) / power[channel] - 1.0).abs() < 1e-6);
    }
}

/// The result of Viriyothai and Debevec (2009): median cut cuts through the brightest source, as an even
/// division of energy must, and their method does not.
#[test]
fn cuts_go_through_the_brightest_source_where_variance_minimisation_spares_it() {
    // A sun of 4 x 4 pixels with nearly all the light.
    let is_sun = |row: usize, column: usize| (30..34).contains(&row) && (200..204).contains(&column);
    let map = PolarMap::from_fn(SHAPE, |r, c| if is_sun(r, c) { [1e6; 3] } else { [1.0; 3] });
    let pixels = Pixels::new(&map);
    let (even, of_little_variance) = (regions(&pixels, 64), variance_minimisation::regions(&pixels, 64));
    assert_eq!(count_sharing(&even, is_sun), 16);
    let shared = count_sharing(&of_little_variance, is_sun);
    assert!(shared < 16, "{shared}");
    // Median cut has cut through the sun before a cut isolates it.
    let first = |count| count_sharing(&regions(&pixels, count), is_sun);
    assert!(first(2) == 2 && first(4) > 2, "{} {}", first(2), first(4));
    assert_eq!(count_sharing(&variance_minimisation::regions(&pixels, 4), is_sun), 1);
}

#[test]
fn cuts_go_through_the_brightest_source_of_real_maps() {
    let (mut sums, maps) = ([0, 0], real_maps(SHAPE));
    for (name, map) in &maps {
        let brightest = (0..map.pixels.len())
            .max_by(|&a, &b| map.luminance(a / 360, a % 360).total_cmp(&map.luminance(b / 360, b % 360)))
            .unwrap();
        let limit = 0.5 * map.luminance(brightest / 360, brightest % 360);
        // The pixels with at least half its luminance within 5 pixels in either direction.
        let is_source = |row: usize, column: usize| {
            let apart = column.abs_diff(brightest % 360);
            row.abs_diff(brightest / 360) <= 5
                && apart.min(360 - apart) <= 5
                && map.luminance(row, column) >= limit
        };
        let pixels = Pixels::new(map);
        let shared = [regions(&pixels, 64), variance_minimisation::regions(&pixels, 64)]
            .map(|regions| count_sharing(&regions, is_source));
        println!(
            "{name}: the brightest source lies in {} regions of median cut, {} of little variance",
            shared[0], shared[1]
        );
        sums = [sums[0] + shared[0], sums[1] + shared[1]];
    }
    assert!(maps.is_empty() || sums[0] > 2 * maps.len() && sums[1] < sums[0], "{sums:?}");
}
