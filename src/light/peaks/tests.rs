use crate::image::{PolarMap, PolarShape, Stamp};
use crate::light::{Extractor, Light, LightList, Options, PeakOptions, Sampler};
use crate::math::{angle_between, direction};
use glam::DVec3;

const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);

fn extractor(shape: PolarShape, slots: usize) -> Extractor {
    let peaks = PeakOptions { slots, ..PeakOptions::default() };
    Extractor::new(shape, &Options { count: 16, peaks, ..Options::default() }).unwrap()
}

/// A round spot of 1.5 degrees (standard deviation).
struct Spot {
    direction: DVec3,
    radiance: f64,
}

/// Spots over a sky that is twice as bright in the north as in the south, at frame `number` of 10 a second.
fn sky(shape: PolarShape, number: u64, spots: &[Spot]) -> PolarMap {
    let mut map = PolarMap::from_fn(shape, |row, column| {
        let d = shape.pixel_direction(row, column);
        let of_spot = |spot: &Spot| {
            spot.radiance * (-0.5 * (angle_between(d, spot.direction).to_degrees() / 1.5).powi(2)).exp()
        };
        let sum: f64 = spots.iter().map(of_spot).sum();
        let grey = 3.0 + d.x;
        [grey + sum, grey + 0.9 * sum, grey + 0.7 * sum].map(|value| value as f32)
    });
    map.stamp = Stamp {
        sequence: number,
        capture_time_ns: 100_000_000 * number as i64,
        frame_rate_hz: 10.0,
        ..Stamp::default()
    };
    map
}

fn off_deg(light: &Light, to: DVec3) -> f64 {
    angle_between(DVec3::from(light.direction.map(f64::from)), to).to_degrees()
}

fn spot(theta: f64, phi: f64, radiance: f64) -> Spot {
    Spot { direction: direction(theta, phi), radiance }
}

#[test]
fn a_spot_that_moves_and_fades_keeps_light_0_and_its_direction() {
    let (mut with, mut without) = (extractor(SHAPE, 1), extractor(SHAPE, 0));
    let mut list = LightList::default();
    let (mut worst, mut best_without) = (0.0f64, f64::INFINITY);
    for number in 0..40 {
        let moved = 0.004 * number as f64;
        let spot = spot(0.9 + 0.5 * moved, 3.0 + moved, 60.0 - number as f64);
        let at = spot.direction;
        let map = sky(SHAPE, number, &[spot]);
        with.extract(&map, &mut list);
        worst = worst.max(off_deg(&list.lights[0], at));
        assert!(list.lights[0].spread_rad.to_degrees() < 2.5 && list.lights[0].irradiance[0] > 0.0);
        assert!(list.lights.iter().enumerate().all(|(id, light)| light.id == id as u32));
        assert_eq!(list.lights.len(), 16);
        for (of_lights, of_map) in list.power.into_iter().zip(map.power()) {
            assert!((of_lights / of_map - 1.0).abs() < 1e-6, "{of_lights} {of_map}");
        }
        without.extract(&map, &mut list);
        let nearest = list.lights.iter().map(|light| off_deg(light, at)).fold(f64::INFINITY, f64::min);
        best_without = best_without.min(nearest);
    }
    println!("a peak apart: at most {worst:.3} degrees off; in a cell: at least {best_without:.3}");
    // A tenth of a pixel: what each has above the threshold counts at its centre.
    assert!(worst < 0.1, "{worst}");
    assert!(best_without > 4.0 * worst, "{best_without} {worst}");
}

#[test]
fn a_spot_on_the_seam_or_a_pole_is_one_peak() {
    let shape = PolarShape::sphere(360, 180);
    for spot in [
        spot(1.2, 0.0, 80.0),
        spot(0.0, 0.0, 80.0),
        spot(0.01, 2.0, 80.0),
        spot(std::f64::consts::PI, 0.0, 80.0),
    ] {
        let at = spot.direction;
        let mut list = LightList::default();
        extractor(shape, 2).extract(&sky(shape, 0, &[spot]), &mut list);
        assert!(off_deg(&list.lights[0], at) < 0.05, "{at}: {}", off_deg(&list.lights[0], at));
        assert_eq!(list.lights[1].irradiance, [0.0; 3], "{at}: a second peak");
    }
}

#[test]
fn a_slot_rests_before_another_peak_has_it_and_the_brightest_are_chosen() {
    let mut extractor = extractor(SHAPE, 2);
    let mut list = LightList::default();
    let (a, b, c) = (|r| spot(0.5, 1.0, r), |r| spot(1.0, 3.0, r), |r| spot(0.8, 5.0, r));
    let mut lights = |number, spots: &[Spot]| {
        extractor.extract(&sky(SHAPE, number, spots), &mut list);
        [list.lights[0], list.lights[1]]
    };
    let first = lights(0, &[a(90.0), b(60.0), c(40.0)]);
    assert!(off_deg(&first[0], a(0.0).direction) < 0.05 && off_deg(&first[1], b(0.0).direction) < 0.05);
    // Brighter than b, but not twice as bright.
    let second = lights(1, &[a(90.0), b(60.0), c(80.0)]);
    assert!(off_deg(&second[1], b(0.0).direction) < 0.05);
    for number in 2..12 {
        let dark = lights(number, &[a(90.0), c(80.0)]);
        assert_eq!(dark[1].irradiance, [0.0; 3], "frame {number}: the slot rests");
        assert!(off_deg(&dark[0], a(0.0).direction) < 0.05 && off_deg(&dark[1], b(0.0).direction) < 0.05);
    }
    let taken = lights(12, &[a(90.0), c(80.0)]);
    assert!(off_deg(&taken[1], c(0.0).direction) < 0.05 && taken[1].irradiance[0] > 0.0);
}

#[test]
fn a_peak_that_comes_back_has_its_slot_again() {
    let mut extractor = extractor(SHAPE, 2);
    let mut list = LightList::default();
    let (a, b) = (|| spot(0.5, 1.0, 60.0), || spot(1.0, 3.0, 90.0));
    extractor.extract(&sky(SHAPE, 0, &[a()]), &mut list);
    extractor.extract(&sky(SHAPE, 1, &[b()]), &mut list);
    extractor.extract(&sky(SHAPE, 2, &[b(), a()]), &mut list);
    assert!(off_deg(&list.lights[0], a().direction) < 0.05 && off_deg(&list.lights[1], b().direction) < 0.05);
}

#[test]
fn what_is_wide_or_even_or_dark_is_no_peak() {
    let half = PolarMap::from_fn(SHAPE, |_, column| if column < 40 { [9.0; 3] } else { [0.5; 3] });
    for map in [half, PolarMap::from_fn(SHAPE, |_, _| [7.0; 3]), PolarMap::black(SHAPE)] {
        let mut list = LightList::default();
        extractor(SHAPE, 3).extract(&map, &mut list);
        assert!(list.lights[..3].iter().all(|light| light.irradiance == [0.0; 3]));
        assert!(list.lights[..3].iter().all(|light| light.direction == [0.0, 1.0, 0.0]));
        assert_eq!(list.lights.len(), 16);
    }
}

#[test]
fn one_enormous_pixel_is_a_peak_of_its_own_direction() {
    let mut map = PolarMap::from_fn(SHAPE, |_, _| [1e-3; 3]);
    map.pixels[40 * 360 + 77] = [1e8; 3];
    let mut list = LightList::default();
    extractor(SHAPE, 1).extract(&map, &mut list);
    assert!(off_deg(&list.lights[0], SHAPE.pixel_direction(40, 77)) < 1e-4);
    assert_eq!(list.lights[0].spread_rad, 0.0);
    let power = map.power()[1];
    assert!((list.power[1] / power - 1.0).abs() < 1e-6);
}

#[test]
fn options_that_make_no_sense_are_refused_by_key() {
    let options = Options { count: 4, ..Options::default() };
    let peaks = PeakOptions { slots: 1, ..PeakOptions::default() };
    for (options, words) in [
        (Options { peaks: PeakOptions { slots: 4, ..peaks }, ..options }, "peaks.slots: 4 of 4"),
        (Options { peaks: PeakOptions { threshold: 1.0, ..peaks }, ..options }, "peaks.threshold: 1 "),
        (Options { peaks: PeakOptions { threshold: f64::NAN, ..peaks }, ..options }, "peaks.threshold: NaN"),
        (Options { peaks, sampler: Sampler::EqualPower, ..options }, "peaks.slots: only refined"),
    ] {
        let message = Extractor::new(SHAPE, &options).unwrap_err().to_string();
        assert!(message.starts_with(words), "{words}: {message}");
    }
}
