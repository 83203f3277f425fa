use super::{halves, regions, variance, variance_minimisation};
use crate::compare::rectangles::{Axis, Content, Pixels, Rectangle};
use glam::DVec3;
use lightcast_core::image::{PolarMap, PolarShape, luminance_f64};
use lightcast_core::test_data::real_maps;

/// The paper's sum, computed directly, with the distance to a direction.
fn variance_slowly(map: &PolarMap, rectangle: &Rectangle, centroid: DVec3) -> f64 {
    let mut sum = 0.0;
    for row in rectangle.rows.clone() {
        for column in rectangle.columns.clone() {
            let energy = f64::from(map.luminance(row, column)) * map.shape.pixel_solid_angle(row);
            sum += energy * (map.shape.pixel_direction(row, column) - centroid).length_squared();
        }
    }
    sum
}

fn centroid(map: &PolarMap, rectangle: &Rectangle) -> DVec3 {
    Pixels::new(map).share(rectangle, Content::Light).moment.normalize_or(DVec3::Y)
}

fn mottled(shape: PolarShape) -> PolarMap {
    PolarMap::from_fn(shape, |row, column| {
        let value = (1 + (row * 31 + column * 17) % 23) as f32;
        [value, 0.5 * value, 2.0 + value]
    })
}

#[test]
fn variance_is_the_sum_of_energy_times_squared_distance() {
    let map = mottled(PolarShape::sphere(30, 15));
    for rectangle in [
        Rectangle { rows: 0..15, columns: 0..30 },
        Rectangle { rows: 3..9, columns: 4..11 },
        Rectangle { rows: 7..8, columns: 20..22 },
        Rectangle { rows: 7..8, columns: 20..21 },
    ] {
        let expected = variance_slowly(&map, &rectangle, centroid(&map, &rectangle));
        let got = variance(&Pixels::new(&map).share(&rectangle, Content::Light));
        assert!((got - expected).abs() < 1e-5 * expected + 1e-6, "{rectangle:?}: {got} {expected}");
    }
}

#[test]
fn no_other_cut_has_a_smaller_maximum() {
    let map = mottled(PolarShape::hemisphere(24, 12));
    let pixels = Pixels::new(&map);
    for rectangle in regions(&pixels, 7) {
        let worst = |[first, second]: &[Rectangle; 2]| {
            let of = |half: &Rectangle| variance_slowly(&map, half, centroid(&map, half));
            of(first).max(of(second))
        };
        let chosen = worst(&halves(&pixels, &rectangle).unwrap());
        for axis in [Axis::Rows, Axis::Columns] {
            for length in 1..rectangle.length(axis) {
                let other = worst(&rectangle.cut(axis, length));
                assert!(chosen <= other * (1.0 + 1e-6), "{rectangle:?} {axis:?} {length}: {chosen} {other}");
            }
        }
    }
}

#[test]
fn two_lamps_get_a_region_each() {
    // Figure 2 of the paper: lamps of different power; an even division would go through the brighter one.
    let lamp = |row: usize, column: usize, at: usize| row.abs_diff(40) <= 2 && column.abs_diff(at) <= 2;
    let map = PolarMap::from_fn(PolarShape::hemisphere(360, 90), |row, column| {
        if lamp(row, column, 100) {
            [900.0; 3]
        } else if lamp(row, column, 130) {
            [100.0; 3]
        } else {
            [0.0; 3]
        }
    });
    let mut lights = Vec::new();
    variance_minimisation(&map, 2, &mut lights);
    let mut powers = [0, 1].map(|i| f64::from(lights[i].luminance()) / luminance_f64(map.power()));
    powers.sort_by(f64::total_cmp);
    assert!((powers[0] - 0.1).abs() < 1e-6 && (powers[1] - 0.9).abs() < 1e-6, "{powers:?}");
}

#[test]
fn variance_of_all_regions_is_below_that_of_median_cut() {
    for (name, map) in real_maps(PolarShape::hemisphere(360, 90)) {
        let pixels = Pixels::new(&map);
        let sum = |regions: Vec<Rectangle>| -> f64 {
            regions.iter().map(|region| variance(&pixels.share(region, Content::Light))).sum()
        };
        let (ours, other) =
            (sum(regions(&pixels, 64)), sum(crate::compare::median_cut::regions(&pixels, 64)));
        println!("{name}: variance {ours:.4}, of median cut {other:.4}");
        assert!(ours < other, "{name}");
    }
}
