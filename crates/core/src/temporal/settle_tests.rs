//! A cut, a lamp that appears, a peak that dissolves: adaptive lights after the filter, against the filtered
//! truth.
//!
//! The filter is 9 frames long. From the ninth frame after a change on, its window contains nothing from
//! before the change, so lists must again be about as good as those of a static scene. While the change is in
//! the window, no point may be brighter, by an amount that would be seen as a flash, than the filtered truth,
//! or than the part that is steady throughout the window: the filter outputs that part even where the
//! filtered truth, which rings, is below it.

use super::test_taps::taps;
use super::{Directions, LightFilter};
use crate::image::{PolarMap, PolarShape, Stamp, luminance_f64};
use crate::light::measure::{Emitters, relative_rms, soft_ground_cells};
use crate::light::{Extractor, Light, Options, REST_S, ReferencedList};
use crate::math::{angle_between, direction};
use crate::test_data::real_maps;

const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);
const LIGHTS: usize = 128;
const FILTER_LENGTH: usize = 9;

/// What a list gives at 100 normals and in 10 x 10 cells of ground, softened by its lights' spreads.
fn values(lights: &[Light]) -> Vec<f64> {
    let mut values = soft_ground_cells(lights, 10, 3);
    values.extend(Emitters::from_lights(lights).irradiances(100));
    values
}

fn truth(map: &PolarMap) -> Vec<f64> {
    let emitters = Emitters::from_map(map);
    let mut values = emitters.ground_cells(10, 3);
    values.extend(emitters.irradiances(100));
    values
}

/// Of every filtered list of a sequence: its relative RMS error, and the most by which a value is brighter
/// than it may be, relative to the mean of the brightest truth in the window.
struct Track {
    error: Vec<f64>,
    excess: Vec<f64>,
}

/// `truths` has what every map gives; maps that are the same may share one.
fn track(maps: &[&PolarMap], truths: &[&Vec<f64>]) -> Track {
    let taps = taps(25.0);
    assert_eq!(taps.as_slice().len(), FILTER_LENGTH);
    let mut extractor = Extractor::new(SHAPE, &Options { count: LIGHTS, ..Options::default() }).unwrap();
    let mut filter = LightFilter::new(taps.clone(), Directions::ByPower);
    let (mut list, mut filtered) = (ReferencedList::default(), ReferencedList::default());
    let mut track = Track { error: Vec::new(), excess: Vec::new() };
    for (t, map) in maps.iter().enumerate() {
        let stamp = Stamp {
            sequence: t as u64,
            capture_time_ns: 40_000_000 * t as i64,
            lost_before: 0,
            frame_rate_hz: 25.0,
        };
        extractor.step(&PolarMap { stamp, ..(*map).clone() }, &mut list);
        filter.step(&list, &mut filtered);
        let reference: Vec<f64> = (0..truths[t].len())
            .map(|place| {
                let taps = taps.as_slice().iter().enumerate();
                taps.map(|(age, tap)| tap * truths[t.saturating_sub(age)][place]).sum()
            })
            .collect();
        let values = values(&filtered.list.lights);
        let window = &truths[t.saturating_sub(FILTER_LENGTH - 1)..=t];
        let mean_of = |truth: &Vec<f64>| truth.iter().sum::<f64>() / truth.len() as f64;
        let mean = window.iter().map(|truth| mean_of(truth)).fold(0.0, f64::max);
        let above = values.iter().zip(&reference).enumerate().map(|(place, (value, reference))| {
            let steady = window.iter().map(|truth| truth[place]).fold(f64::INFINITY, f64::min);
            (value - reference.max(steady)) / mean
        });
        track.error.push(relative_rms(&values, &reference));
        track.excess.push(above.fold(0.0, f64::max));
    }
    track
}

fn quantile(values: &mut [f64], fraction: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * fraction) as usize]
}

#[test]
fn a_cut_settles_within_the_filters_length_and_flashes_little() {
    const BEFORE: usize = 12;
    const AFTER: usize = 24;
    // All maps have the same power, so that a value brighter than the truth cannot come from a difference
    // between the maps.
    let mut maps = real_maps(SHAPE);
    for (_, map) in &mut maps {
        let power = luminance_f64(map.power());
        map.pixels.iter_mut().for_each(|pixel| *pixel = pixel.map(|value| (f64::from(value) / power) as f32));
    }
    let truths: Vec<Vec<f64>> = maps.iter().map(|(_, map)| truth(map)).collect();
    let (mut settled, mut flashes) = (Vec::new(), Vec::new());
    // The error that a static scene has by then.
    let still: Vec<f64> = (0..maps.len())
        .map(|i| {
            track(&[&maps[i].1; FILTER_LENGTH + 1], &[&truths[i]; FILTER_LENGTH + 1]).error[FILTER_LENGTH]
        })
        .collect();
    for step in [1, 5, 9] {
        for from in 0..maps.len() {
            let to = (from + step) % maps.len();
            let sequence: Vec<usize> =
                (0..BEFORE + AFTER).map(|t| if t < BEFORE { from } else { to }).collect();
            let maps: Vec<&PolarMap> = sequence.iter().map(|&i| &maps[i].1).collect();
            let truths: Vec<&Vec<f64>> = sequence.iter().map(|&i| &truths[i]).collect();
            let Track { error, excess } = track(&maps, &truths);
            settled.push(error[BEFORE + FILTER_LENGTH] / still[to]);
            flashes.push(excess[BEFORE..].iter().copied().fold(0.0, f64::max));
        }
    }
    if maps.is_empty() {
        return;
    }
    let [median, p90, worst] = [0.5, 0.9, 1.0].map(|part| quantile(&mut settled, part));
    let [flash, flash_p90, flash_worst] = [0.5, 0.9, 1.0].map(|part| quantile(&mut flashes, part));
    println!(
        "{FILTER_LENGTH} frames after a cut, error over that of a scene that stood still: median {median:.2}, p90 \
         {p90:.2}, worst {worst:.2}; brighter than the filtered truth at any place by at most, relative to the mean: \
         median {flash:.2}, p90 {flash_p90:.2}, worst {flash_worst:.2}"
    );
    assert!(median < 1.25 && p90 < 2.0, "{median} {p90}");
    assert!(flash_p90 < 0.2 && flash_worst < 0.5, "{flash_p90} {flash_worst}");
}

/// A sky with a lamp of 0.8 degrees (standard deviation) and some radiance.
fn sky(lamp: f64) -> PolarMap {
    let at = direction(0.8, 2.0);
    PolarMap::from_fn(SHAPE, |row, column| {
        let d = SHAPE.pixel_direction(row, column);
        let of_lamp = lamp * (-0.5 * (angle_between(d, at).to_degrees() / 0.8).powi(2)).exp();
        let grey = 1.0 + 0.4 * d.x + 0.3 * (5.0 * d.z).sin();
        [grey + of_lamp, grey + 0.9 * of_lamp, 1.2 * grey + 0.7 * of_lamp].map(|value| value as f32)
    })
}

/// A lamp of the radiance `lamp(t)` in frame t: the largest error from frame `settled` on, divided by that of
/// the last frame, and the most that any value is above the filtered truth.
fn lamp_track(lamp: impl Fn(usize) -> f64, settled: usize) -> [f64; 2] {
    const FRAMES: usize = 60;
    let maps: Vec<PolarMap> = (0..FRAMES).map(|t| sky(lamp(t))).collect();
    let truths: Vec<Vec<f64>> = maps.iter().map(truth).collect();
    let Track { error, excess } = track(&maps.iter().collect::<Vec<_>>(), &truths.iter().collect::<Vec<_>>());
    let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    [most(&error[settled..]) / error[FRAMES - 1], most(&excess)]
}

#[test]
fn a_lamp_that_appears_settles_within_the_filters_length_and_does_not_flash() {
    // The lamp has 0.06, 0.5 and 9 times the power of the sky.
    for radiance in [200.0, 2000.0, 30_000.0] {
        let [settled, flash] = lamp_track(|t| if t < 20 { 0.0 } else { radiance }, 20 + FILTER_LENGTH);
        println!("a lamp of {radiance} appears: error {settled:.2} of the last frame's, flash {flash:.3}");
        assert!(settled < 1.05 && flash < 0.02, "{radiance}: {settled} {flash}");
    }
}

#[test]
fn a_lamp_that_goes_out_settles_within_the_filters_length_and_does_not_flash() {
    for radiance in [200.0, 2000.0, 30_000.0] {
        let [settled, flash] = lamp_track(|t| if t < 20 { radiance } else { 0.0 }, 20 + FILTER_LENGTH);
        println!("a lamp of {radiance} goes out: error {settled:.2} of the last frame's, flash {flash:.3}");
        assert!(settled < 1.05 && flash < 0.02, "{radiance}: {settled} {flash}");
    }
}

#[test]
fn a_peak_that_dissolves_does_not_flash() {
    for radiance in [2000.0, 30_000.0] {
        // Gone within 30 frames, through everything between a peak and nothing.
        let lamp = |t: usize| radiance * (0.75f64).powi(t.saturating_sub(10) as i32) * f64::from(t < 40);
        let [settled, flash] = lamp_track(lamp, 40 + FILTER_LENGTH);
        println!("a lamp of {radiance} dissolves: error {settled:.2} of the last frame's, flash {flash:.3}");
        assert!(settled < 1.05 && flash < 0.02, "{radiance}: {settled} {flash}");
    }
}

#[test]
fn lights_rest_longer_than_the_default_filter_is() {
    for rate_hz in [20.0, 24.0, 25.0, 29.97, 48.0, 50.0, 60.0, 90.0, 100.0, 120.0, 240.0, 500.0, 1000.0] {
        let length = taps(rate_hz).as_slice().len();
        assert!((REST_S * rate_hz).ceil() >= length as f64, "{length} taps at {rate_hz} Hz");
    }
}
