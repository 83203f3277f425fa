//! The two moving scenes of METHODS section 7, frame by frame, from two still panoramas.

use lightcast_core::image::PolarMap;
use lightcast_core::math::{percentile, zone_solid_angle};
use std::f64::consts::TAU;

/// The garden in frame t: `map` (`chinese_garden_1k`) turned so that its brightest column is at column 20 -
/// t. Its sun crosses phi = 0 in frame 20.
pub(super) fn garden_frame(map: &PolarMap, t: usize) -> PolarMap {
    let columns = map.shape.columns();
    // The column that ends up at 20 - t is the brightest one.
    let turn = (brightest_column(map) + t + 20 * (columns - 1)) % columns;
    PolarMap::from_fn(map.shape, |row, column| map.pixels[row * columns + (column + turn) % columns])
}

/// The hall in frame t: `map` (`dancing_hall_1k`), whose pixels in columns 71-149 above its 97th percentile
/// of luminance are multiplied by `1 + 0.5 sin(2 pi 0.38 t)`: at 25 frames/s lamps that flicker at 9.5 Hz.
pub(super) fn hall_frame(map: &PolarMap, t: usize) -> PolarMap {
    let luminance = |i: usize| f64::from(map.luminance(i / map.shape.columns(), i % map.shape.columns()));
    let mut luminances: Vec<f64> = (0..map.shape.len()).map(luminance).collect();
    luminances.sort_by(f64::total_cmp);
    let threshold = percentile(&luminances, 0.97);
    let gain = (1.0 + 0.5 * (TAU * 0.38 * t as f64).sin()) as f32;
    PolarMap::from_fn(map.shape, |row, column| {
        let pixel = map.pixels[row * map.shape.columns() + column];
        let lamp = (71..=149).contains(&column) && f64::from(map.luminance(row, column)) > threshold;
        if lamp { pixel.map(|value| value * gain) } else { pixel }
    })
}

/// Column of the largest luminous power, the first among equals.
fn brightest_column(map: &PolarMap) -> usize {
    let shape = map.shape;
    let solid_angle = |row| zone_solid_angle(shape.theta_edge_rad(row), shape.theta_edge_rad(row + 1), 1.0);
    let power = |column: usize| -> f64 {
        (0..shape.rows()).map(|row| f64::from(map.luminance(row, column)) * solid_angle(row)).sum()
    };
    let powers: Vec<f64> = (0..shape.columns()).map(power).collect();
    (0..shape.columns()).rev().max_by(|&a, &b| powers[a].total_cmp(&powers[b])).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::image::PolarShape;

    const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);

    #[test]
    fn sun_of_the_garden_walks_through_the_seam() {
        let map = PolarMap::from_fn(SHAPE, |row, column| {
            if (row, column) == (30, 217) { [1e4; 3] } else { [1e-3 * column as f32; 3] }
        });
        for (t, column) in [(0, 20), (7, 13), (20, 0), (21, 359), (39, 341)] {
            let frame = garden_frame(&map, t);
            assert_eq!(frame.luminance(30, column), map.luminance(30, 217), "frame {t}");
            assert_eq!(frame.pixels[30 * 360 + (column + 1) % 360], [1e-3 * 218.0; 3]);
        }
    }

    #[test]
    fn lamps_of_the_hall_flicker_and_nothing_else_does() {
        // 3 % of 32,400 pixels are 972; 79 columns of 8 rows are 632 lamps.
        let map = PolarMap::from_fn(SHAPE, |row, _| if row < 8 { [10.0; 3] } else { [1.0; 3] });
        let lamp = |t: usize| hall_frame(&map, t).pixels[3 * 360 + 100][0];
        for t in 0..8 {
            let gain = 1.0 + 0.5 * (TAU * 0.38 * t as f64).sin();
            // 8 of 90 rows are more than 3 %, so the threshold is the lamps' own luminance: nothing is above
            // it.
            assert_eq!(lamp(t), 10.0);
            let few = PolarMap::from_fn(SHAPE, |row, _| if row < 2 { [10.0; 3] } else { [1.0; 3] });
            let frame = hall_frame(&few, t);
            for (column, expected) in [(70, 10.0), (71, 10.0 * gain), (149, 10.0 * gain), (150, 10.0)] {
                assert!((f64::from(frame.pixels[column][0]) - expected).abs() < 1e-5, "frame {t}");
            }
            assert_eq!(frame.pixels[40 * 360 + 100], [1.0; 3]);
        }
    }
}
