//! Hard sequences: the output of the filter, and errors that accumulate over time.

use super::super::plain_paper;
use super::maps::{power, reference};
use super::{Bound, Case, Row, row};
use crate::design::{FilterOptions, RateFilter, low_pass};
use crate::error::Result;
use glam::DVec3;
use lightcast_core::image::{PolarMap, PolarShape, Stamp};
use lightcast_core::light::ReferencedList;
use lightcast_core::light::{Extractor, Light, LightList, Options};
use lightcast_core::math::{angle_between, direction};
use lightcast_core::sampling::sample_points;

const RATE_HZ: f64 = 25.0;
const UP: [f32; 3] = [0.0, 1.0, 0.0];
const DOWN: [f32; 3] = [0.0, -1.0, 0.0];

/// Our filter and the naive one on one light.
struct Both {
    ours: RateFilter,
    plain: Option<plain_paper::Filter>,
    filtered: ReferencedList,
}

impl Both {
    fn new() -> Result<Self> {
        let ours = RateFilter::new(&FilterOptions::default())?;
        Ok(Self { ours, plain: None, filtered: ReferencedList::default() })
    }

    /// Filtered direction and power, ours and naive, for these inputs at a time in frames, after `lost` lost
    /// frames.
    fn step(
        &mut self,
        direction: [f32; 3],
        power: f32,
        lost: u64,
        frame: i64,
    ) -> Result<[([f32; 3], f32); 2]> {
        let stamp = Stamp {
            sequence: frame.unsigned_abs(),
            capture_time_ns: frame * 40_000_000,
            lost_before: lost,
            frame_rate_hz: RATE_HZ,
        };
        let lights = vec![Light { id: 0, direction, irradiance: [power; 3], spread_rad: 0.0 }];
        let list = LightList { stamp, lights, ..LightList::default() };
        self.ours.step(&ReferencedList { list, ..ReferencedList::default() }, &mut self.filtered)?;
        let light = self.filtered.list.lights[0];
        let plain = self.plain.get_or_insert_with(|| plain_paper::Filter::new(direction, power));
        Ok([(light.direction, light.irradiance[1]), plain.step(direction, power)])
    }
}

/// A lamp that is on in every other frame, after darkness.
fn strobe() -> Result<[Row; 2]> {
    let mut both = Both::new()?;
    let (mut negative, mut sums, mut came_in) = ([0.0; 2], [0.0; 2], 0.0);
    for frame in 0..230 {
        let power = if (10..210).contains(&frame) && frame % 2 == 0 { 1.0f32 } else { 0.0 };
        came_in += f64::from(power);
        for (i, (_, power)) in both.step(UP, power, 0, frame)?.into_iter().enumerate() {
            negative[i] += f64::from(u8::from(power < 0.0));
            sums[i] += f64::from(power);
        }
    }
    let names =
        |quantity| ["a strobe at every frame", "power 1, 0, 1, 0 ... for 200 frames, dark around", quantity];
    Ok([
        row(names("negative powers that leave"), negative[1], negative[0], 0.0, Bound::Absolute(0.0)),
        row(names("power that leaves in all"), sums[1], sums[0], came_in, Bound::Relative(1e-6)),
    ])
}

/// A source that alternates between up and down from frame to frame: the weighted directions nearly cancel.
fn opposite() -> Result<Row> {
    let mut both = Both::new()?;
    let mut worst = [0.0f64; 2];
    for frame in 0..100 {
        // The filter delays by 4 frames, an even number: its output has the source's current direction.
        let now = if frame % 2 == 0 { UP } else { DOWN };
        for (i, (direction, _)) in both.step(now, 1.0, 0, frame)?.into_iter().enumerate() {
            let [a, b] = [direction, now].map(|d| DVec3::from(d.map(f64::from)));
            if frame > 16 {
                // A NaN is kept.
                worst[i] = if worst[i] >= angle_between(a, b) { worst[i] } else { angle_between(a, b) };
            }
        }
    }
    let [ours, plain] = worst.map(f64::to_degrees);
    let names = [
        "jump to the opposite side",
        "up and down in turns, frame by frame",
        "direction that leaves, degrees off",
    ];
    Ok(row(names, plain, ours, 0.0, Bound::Absolute(1e-3)))
}

/// A sun of one pixel that makes a hundred turns, one column per frame.
fn turns() -> Result<[Row; 2]> {
    let shape = PolarShape::hemisphere(72, 18);
    let options = Options { count: 32, ..Options::default() };
    let points = sample_points(options.count, options.relaxation_steps);
    let (mut extractor, mut list) = (Extractor::new(shape, &options)?, LightList::default());
    let mut map = PolarMap::black(shape);
    let (mut worst_power, mut worst_rad) = ([0.0f64; 2], [0.0f64; 2]);
    for frame in 0..7200 {
        map.pixels.fill([0.01; 3]);
        map.pixels[9 * 72 + frame % 72] = [1e5; 3];
        extractor.extract(&map, &mut list);
        let plain = plain_paper::lights(&map, &points);
        let expected = reference(&map).0;
        let sun = direction((9.5f64 * 5.0).to_radians(), ((frame % 72) as f64 + 0.5) * 5f64.to_radians());
        for (i, lights) in [&list.lights, &plain].into_iter().enumerate() {
            worst_power[i] = worst_power[i].max((power(lights) / expected - 1.0).abs());
            let brightest = lights.iter().max_by(|a, b| a.luminance().total_cmp(&b.luminance()));
            let towards = brightest.map_or(DVec3::Y, |light| DVec3::from(light.direction.map(f64::from)));
            worst_rad[i] = worst_rad[i].max(angle_between(towards, sun));
        }
    }
    let names = |quantity| {
        ["a hundred turns of a sun", "one pixel of 1e5 over 72 x 18 of 0.01, 7,200 frames", quantity]
    };
    let [ours, plain] = worst_rad.map(f64::to_degrees);
    Ok([
        row(
            names("worst relative error of power"),
            worst_power[1],
            worst_power[0],
            0.0,
            Bound::Absolute(1e-6),
        ),
        row(names("brightest light, degrees off at worst"), plain, ours, 0.0, Bound::Absolute(0.05)),
    ])
}

/// Four frames are missing while a lamp becomes brighter: the last frame is held for them in the filter's
/// history.
fn gap() -> Result<Row> {
    let taps = low_pass(RATE_HZ, &FilterOptions::default())?;
    let inputs = [(1.0f32, 0), (1.0, 0), (1.0, 0), (3.0, 0), (3.0, 4)];
    let (mut both, mut frame, mut last) = (Both::new()?, 0, [0.0; 2]);
    let mut history = vec![1.0f64; taps.as_slice().len()];
    let mut before = 1.0;
    for (power, lost) in inputs {
        frame += 1 + lost;
        let out = both.step(UP, power, lost as u64, frame)?;
        last = out.map(|(_, power)| f64::from(power));
        history.extend(std::iter::repeat_n(before, lost as usize));
        history.push(f64::from(power));
        before = f64::from(power);
    }
    let expected = taps.as_slice().iter().zip(history.iter().rev()).map(|(tap, power)| tap * power).sum();
    let names =
        ["frame gaps", "power 1 becomes 3, then 4 frames are lost", "power that leaves after the gap"];
    Ok(row(names, last[1], last[0], expected, Bound::Relative(1e-6)))
}

/// The clock runs backwards because another recording begins.
fn backwards() -> Result<Row> {
    let mut both = Both::new()?;
    for frame in 100..120 {
        both.step(UP, 1.0, 0, frame)?;
    }
    let [ours, plain] = both.step(UP, 100.0, 0, 0)?.map(|(_, power)| f64::from(power));
    let names =
        ["timestamps that run backwards", "power 1, then 100 at time 0", "power that leaves at time 0"];
    Ok(row(names, plain, ours, 100.0, Bound::Relative(1e-6)))
}

pub(super) const CASES: [Case; 5] = [
    || Ok(strobe()?.into()),
    || Ok(vec![opposite()?]),
    || Ok(turns()?.into()),
    || Ok(vec![gap()?]),
    || Ok(vec![backwards()?]),
];
