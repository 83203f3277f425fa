//! Real pictures and awkward maps, for tests of this crate and of the program.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod list_checks;

pub use list_checks::{check_dark, check_hard, check_list};

use crate::image::{PolarMap, PolarShape};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A folder of real data: `LIGHTCAST_DATA`, by default `../shared/data`, and `name` below it. `None` where it
/// is missing, after a line that names the running test and says so.
pub fn real_folder(name: &str) -> Option<PathBuf> {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("LIGHTCAST_DATA").map_or(default, PathBuf::from).join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    say_skipped(&format!("no real data in {}", folder.display()));
    None
}

/// Names the running test as skipped, and why.
pub fn say_skipped(reason: &str) {
    let test = std::thread::current().name().unwrap_or_default().to_owned();
    // Not eprintln!, which the test harness swallows when a test passes; in one piece, as tests run side by
    // side.
    let line = format!("skipped: {test}: {reason}\n");
    let _ = std::io::stderr().write_all(line.as_bytes());
}

/// Numbers in [0, 1) without a pattern.
pub fn noise(index: usize) -> f32 {
    (index as u32).wrapping_mul(2_654_435_769).rotate_left(7).wrapping_mul(0x85eb_ca6b) as f32
        / 4_294_967_296.0
}

/// Name and map of every `*_1k.hdr`, in the order of their names, averaged to `shape`; empty where there are
/// none.
pub fn real_maps(shape: PolarShape) -> Vec<(String, PolarMap)> {
    let Some(folder) = real_folder("env") else { return Vec::new() };
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with("_1k.hdr"))
        .collect();
    names.sort();
    assert_eq!(names.len(), 13);
    names.into_iter().map(|name| (name.clone(), real_map(&name, shape).unwrap())).collect()
}

/// One real map, averaged to `shape`; `None` where there are none.
pub fn real_map(name: &str, shape: PolarShape) -> Option<PolarMap> {
    let file = std::fs::File::open(real_folder("env")?.join(name)).unwrap();
    let decoder = ::image::codecs::hdr::HdrDecoder::new(std::io::BufReader::new(file)).unwrap();
    let picture = ::image::DynamicImage::from_decoder(decoder).unwrap().into_rgb32f();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    Some(average(shape, width, height, |row, column| picture.get_pixel(column as u32, row as u32).0))
}

/// Averages a lat-long picture over the pixels of a polar map. Both kinds of pixel are rectangles in (z,
/// phi), so that the overlap in solid angle is a product.
fn average(
    shape: PolarShape,
    width: usize,
    height: usize,
    pixel: impl Fn(usize, usize) -> [f32; 3],
) -> PolarMap {
    let z = |theta: f64| 2.0 * (0.5 * theta).sin().powi(2);
    let rows = overlaps(
        shape.rows(),
        |i| z(shape.theta_edge_rad(i)),
        height,
        |i| z(std::f64::consts::PI * i as f64 / height as f64),
    );
    // File column u in [0, 1) is phi = 2 pi u - pi/2. Two turns of the file cover [0, 1) of the map.
    let columns = overlaps(
        shape.columns(),
        |i| i as f64 / shape.columns() as f64,
        2 * width,
        |i| i as f64 / width as f64 - 0.25,
    );
    PolarMap::from_fn(shape, |row, column| {
        let (mut sum, mut weight) = ([0.0; 3], 0.0);
        for &(source_row, height_part) in &rows[row] {
            for &(source_column, width_part) in &columns[column] {
                let area = height_part * width_part;
                let value = pixel(source_row, source_column % width);
                for channel in 0..3 {
                    sum[channel] += area * f64::from(value[channel]);
                }
                weight += area;
            }
        }
        sum.map(|s| (s / weight) as f32)
    })
}

/// For every target interval the source intervals that it overlaps, with the overlap's length.
fn overlaps(
    targets: usize,
    target: impl Fn(usize) -> f64,
    sources: usize,
    source: impl Fn(usize) -> f64,
) -> Vec<Vec<(usize, f64)>> {
    (0..targets)
        .map(|t| {
            (0..sources)
                .map(|s| (s, source(s + 1).min(target(t + 1)) - source(s).max(target(t))))
                .filter(|&(_, length)| length > 0.0)
                .collect()
        })
        .collect()
}

/// The hard cases of METHODS section 10 that a map can show, with their names.
pub fn hard_maps() -> Vec<(&'static str, PolarMap)> {
    const DARK: [f32; 3] = [1e-3, 2e-3, 4e-3];
    let shape = PolarShape::hemisphere(36, 9);
    let sun = |spots: &'static [(usize, usize)]| {
        PolarMap::from_fn(
            shape,
            |row, column| if spots.contains(&(row, column)) { [1e6, 9e5, 8e5] } else { DARK },
        )
    };
    vec![
        ("all black", PolarMap::black(shape)),
        ("constant", PolarMap::from_fn(shape, |_, _| [1.0, 2.0, 0.5])),
        ("constant sphere", PolarMap::from_fn(PolarShape::sphere(36, 18), |_, _| [1.0; 3])),
        ("1 x 1", PolarMap::from_fn(PolarShape::hemisphere(1, 1), |_, _| [3.0, 2.0, 1.0])),
        ("1 x 1 sphere", PolarMap::from_fn(PolarShape::sphere(1, 1), |_, _| [3.0, 2.0, 1.0])),
        ("one column", PolarMap::from_fn(PolarShape::hemisphere(1, 7), |row, _| [row as f32; 3])),
        ("one row", PolarMap::from_fn(PolarShape::hemisphere(7, 1), |_, column| [column as f32; 3])),
        (
            "one pixel of 1e8 over a dark map",
            PolarMap::from_fn(shape, |row, column| if (row, column) == (4, 20) { [1e8; 3] } else { DARK }),
        ),
        (
            "one pixel of 1e8 over a black map",
            PolarMap::from_fn(
                shape,
                |row, column| if (row, column) == (4, 20) { [1e8; 3] } else { [0.0; 3] },
            ),
        ),
        ("sun on the pole", sun(&[(0, 7)])),
        ("sun on phi = 0", sun(&[(4, 0), (4, 35)])),
        ("sun on the rim", sun(&[(8, 11)])),
        ("sun between two rows", sun(&[(3, 11), (4, 11)])),
        ("rows of zeros", PolarMap::from_fn(shape, |row, _| [(row % 2) as f32; 3])),
        ("zeros but for the rim", PolarMap::from_fn(shape, |row, _| [(row / 8) as f32; 3])),
        ("tiny values", PolarMap::from_fn(shape, |_, column| [1e-40 * column as f32; 3])),
        ("largest values", PolarMap::from_fn(shape, |_, _| [f32::MAX; 3])),
        ("one channel only", PolarMap::from_fn(shape, |_, column| [0.0, 0.0, column as f32])),
        (
            "lower hemisphere dark",
            PolarMap::from_fn(PolarShape::sphere(36, 18), |row, _| [(9 / (row + 1)) as f32; 3]),
        ),
        (
            "220 degree lens",
            PolarMap::from_fn(PolarShape::new(36, 9, 110f64.to_radians()).unwrap(), |row, column| {
                [(row * column) as f32, 1.0, 0.5]
            }),
        ),
    ]
}

#[test]
fn averaging_keeps_power_and_a_constant() {
    let shape = PolarShape::hemisphere(360, 90);
    let constant = average(shape, 1024, 512, |_, _| [2.0; 3]);
    assert!(constant.pixels.iter().flatten().all(|&v| v == 2.0));
    // One bright source pixel of the upper half keeps its radiance times solid angle, and lies where it
    // should: column 512 of 1024 starts at u = 1/2, phi = pi/2, the map's column 90.
    let spot = average(
        shape,
        1024,
        512,
        |row, column| if (row, column) == (100, 512) { [1.0; 3] } else { [0.0; 3] },
    );
    let expected = PolarShape::sphere(1024, 512).pixel_solid_angle(100);
    assert!((spot.power()[0] / expected - 1.0).abs() < 1e-6);
    assert!(spot.luminance(35, 90) > 0.0 && spot.luminance(35, 89) == 0.0);
}
