use super::*;
use crate::camera::{LOOKING_UP, LensParameters};
use crate::image::LatLongCentres;
use std::f64::consts::PI;

fn area(points: &[ChartPoint]) -> f64 {
    points.windows(2).map(|p| 0.5 * (p[0][1] + p[1][1]) * (p[1][0] - p[0][0])).sum()
}

fn lens(width: usize, height: usize, f: f64, centre: (f64, f64), field_of_view_deg: f64) -> Projection {
    Projection::Fisheye(
        Lens::new(LensParameters {
            width,
            height,
            fx: f,
            fy: 1.01 * f,
            cx: centre.0,
            cy: centre.1,
            k: [0.01, -0.002, 0.0, 0.0],
            field_of_view_rad: field_of_view_deg.to_radians(),
        })
        .unwrap(),
    )
}

fn tilted() -> DMat3 {
    DMat3::from_rotation_x(0.7) * DMat3::from_rotation_y(2.1) * LOOKING_UP
}

#[test]
fn footprints_fill_the_field_of_view_also_with_the_pole_on_corners_and_edges() {
    for field_of_view_deg in [20.0, 180.0, 220.0, 360.0] {
        for centre in [(32.0, 32.0), (32.0, 31.5), (32.37, 31.81)] {
            for rotation in [LOOKING_UP, tilted(), DMat3::IDENTITY] {
                let projection = lens(64, 64, 8.0, centre, field_of_view_deg);
                let mut sum = 0.0;
                Footprints::new(&projection, rotation).for_each(|_, _, polygon| {
                    let area = area(polygon);
                    assert!(area > -1e-9, "{area}");
                    sum += area;
                });
                let theta_max = 0.5 * field_of_view_deg.to_radians();
                let cap = TAU * (1.0 - theta_max.cos());
                // Only the rim is not shared: its arcs err by the edge tolerance.
                assert!((sum / cap - 1.0).abs() < 1e-4, "{field_of_view_deg} {centre:?}: {}", sum / cap);
            }
        }
    }
}

#[test]
fn lat_long_footprints_fill_the_sphere_turned_or_not_and_down_to_one_pixel() {
    for (width, height) in [(64, 32), (1, 1), (2, 1), (5, 3)] {
        for centres in [LatLongCentres::Half, LatLongCentres::Ends] {
            for rotation in [DMat3::IDENTITY, DMat3::from_rotation_y(1.0), tilted()] {
                let projection = Projection::LatLong { width, height, centres };
                let mut sum = 0.0;
                Footprints::new(&projection, rotation).for_each(|_, _, polygon| sum += area(polygon));
                assert!((sum / (4.0 * PI) - 1.0).abs() < 1e-9, "{width} x {height}: {}", sum / (4.0 * PI));
            }
        }
    }
}

#[test]
fn a_field_of_view_inside_one_pixel_is_seen_whole() {
    let projection = lens(64, 64, 8.0, (10.4, 20.6), 1.0);
    let mut seen = Vec::new();
    Footprints::new(&projection, tilted()).for_each(|row, column, polygon| {
        seen.push((row, column, area(polygon)));
    });
    let cap = TAU * (1.0 - 0.5f64.to_radians().cos());
    assert_eq!(seen.len(), 1);
    assert_eq!((seen[0].0, seen[0].1), (20, 10));
    assert!((seen[0].2 / cap - 1.0).abs() < 1e-3, "{}", seen[0].2 / cap);
}

#[test]
fn pixels_of_each_place_of_a_mosaic_have_their_centres_in_the_middle_and_end_with_the_frame() {
    let borders = |first, count: usize| {
        (0..=count / 2).map(|pixel| position_of_place(pixel as f64, first, count)).collect::<Vec<_>>()
    };
    assert_eq!(borders(0, 8), [0.0, 1.5, 3.5, 5.5, 8.0]);
    assert_eq!(borders(1, 8), [0.0, 2.5, 4.5, 6.5, 8.0]);
    assert_eq!(borders(1, 2), [0.0, 2.0]);
    assert_eq!([1.5, 3.5].map(|position| position_of_place(position, 0, 8)), [2.5, 6.75]);
    for (width, height) in [(64, 64), (6, 4), (2, 2)] {
        let projection = lens(width, height, 0.4 * height as f64, (1.1, 0.9), 200.0);
        let seen = |mut footprints: Footprints| {
            let mut sum = 0.0;
            footprints.for_each(|_, _, polygon| sum += area(polygon));
            sum
        };
        let whole = seen(Footprints::new(&projection, tilted()));
        for place in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            let of_place = seen(Footprints::of_place(&projection, tilted(), place));
            assert!(
                (of_place / whole - 1.0).abs() < 1e-3,
                "{width} x {height} {place:?}: {of_place} {whole}"
            );
        }
    }
}
