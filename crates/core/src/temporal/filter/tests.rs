use super::*;
use crate::image::{PolarMap, PolarShape};
use crate::light::error::NORMAL_COUNT;
use crate::light::measure::{Emitters, relative_rms};
use crate::light::{Extractor, Light, Options};
use crate::math::{angle_between, direction};
use crate::temporal::test_taps::taps;

fn stamp(t: usize, rate: f64) -> Stamp {
    Stamp {
        sequence: t as u64,
        capture_time_ns: (t as f64 * 1e9 / rate) as i64,
        lost_before: 0,
        frame_rate_hz: rate,
    }
}

fn light(id: u32, towards: DVec3, irradiance: [f32; 3]) -> Light {
    Light { id, direction: towards.as_vec3().to_array(), irradiance, spread_rad: 0.05 }
}

/// A list whose reference irradiances are those of its own lights, so that its error is 0.
fn list(t: usize, rate: f64, lights: Vec<Light>) -> ReferencedList {
    let irradiances = Emitters::from_lights(&lights).irradiances(NORMAL_COUNT);
    let mut list = LightList { stamp: stamp(t, rate), lights, ..LightList::default() };
    list.power = list.sum_of_lights();
    ReferencedList { list, reference_irradiance: irradiances.into_iter().map(|value| value as f32).collect() }
}

fn lamp(t: usize, rate: f64, irradiance: f32) -> ReferencedList {
    list(t, rate, vec![light(0, direction(0.4, 1.0), [irradiance, 2.0 * irradiance, 0.5 * irradiance])])
}

/// Feeds lists, with the taps of their frame rate, and returns the output.
fn run(lists: &[ReferencedList]) -> Vec<ReferencedList> {
    let mut filter = LightFilter::new(Taps::identity(), Directions::ByPower);
    let mut rate_hz = None;
    let step = |list: &ReferencedList| {
        if rate_hz != Some(list.list.stamp.frame_rate_hz) {
            rate_hz = Some(list.list.stamp.frame_rate_hz);
            filter.set_taps(taps(list.list.stamp.frame_rate_hz));
        }
        let mut filtered = ReferencedList::default();
        filter.step(list, &mut filtered);
        filtered
    };
    lists.iter().map(step).collect()
}

fn assert_lawful(left: &ReferencedList) {
    for light in &left.list.lights {
        assert!(light.irradiance.iter().all(|&value| value >= 0.0 && value.is_finite()), "{light:?}");
        let length = DVec3::from_array(light.direction.map(f64::from)).length();
        assert!((length - 1.0).abs() < 1e-6, "{light:?}");
        assert!((0.0..=PI as f32).contains(&light.spread_rad), "{light:?}");
    }
    assert!(left.reference_irradiance.iter().all(|&value| value >= 0.0 && value.is_finite()));
    let error = left.list.error.unwrap();
    assert!(error.is_finite() && error >= 0.0, "{error}");
    assert_eq!(left.list.power, left.list.sum_of_lights());
}

#[test]
fn constant_lists_leave_as_they_came_at_every_rate() {
    for (rate, delay) in
        [(10.0, 0), (19.2, 3), (24.0, 4), (25.0, 4), (30.0, 5), (60.0, 10), (120.0, 19), (1000.0, 160)]
    {
        let frames = 2 * delay + 20;
        let lists: Vec<ReferencedList> = (0..frames)
            .map(|t| {
                list(
                    t,
                    rate,
                    vec![
                        light(0, direction(0.3, 0.2), [1.5, 2.5, 1e-3]),
                        light(1, direction(1.2, 6.2), [1e6, 0.0, 7.0]),
                        light(2, direction(1.5, 3.0), [0.0; 3]),
                    ],
                )
            })
            .collect();
        for (came, left) in lists.iter().zip(run(&lists)) {
            assert_eq!(left.list.filter_delay_frames, delay as u32);
            assert_eq!((left.list.stamp, left.list.lights.len()), (came.list.stamp, 3));
            for (a, b) in came.list.lights.iter().zip(&left.list.lights) {
                assert_eq!((a.id, a.irradiance), (b.id, b.irradiance), "{rate} Hz");
                assert!((0..3).all(|i| (a.direction[i] - b.direction[i]).abs() < 2e-7), "{a:?} {b:?}");
                assert!((a.spread_rad - b.spread_rad).abs() < 1e-8);
            }
            assert_eq!(came.reference_irradiance, left.reference_irradiance);
            assert!(left.list.error.unwrap() < 1e-6, "{:?}", left.list.error);
        }
    }
}

#[test]
fn strobe_at_every_frame_flash_and_step_never_leave_negative_power() {
    let strobe = |t: usize| if t.is_multiple_of(2) { 1e4f32 } else { 0.0 };
    let flash = |t: usize| if t == 20 { 1e6f32 } else { 0.01 };
    let step = |t: usize| if t < 20 { 0.0f32 } else { 1.0 };
    for (name, signal) in [("strobe", &strobe as &dyn Fn(usize) -> f32), ("flash", &flash), ("step", &step)] {
        let lists: Vec<ReferencedList> = (0..60).map(|t| lamp(t, 25.0, signal(t))).collect();
        for left in run(&lists) {
            assert_lawful(&left);
            // One light and its own truth pass the same filter.
            assert!(left.list.error.unwrap() < 1e-5, "{name}: {:?}", left.list.error);
        }
    }
}

#[test]
fn a_light_arrives_four_frames_late_and_half_way_up_in_between() {
    let lists: Vec<ReferencedList> = (0..40).map(|t| lamp(t, 25.0, if t < 20 { 1.0 } else { 3.0 })).collect();
    let left = run(&lists);
    let power = |t: usize| left[t].list.lights[0].irradiance[0];
    // The step response of symmetric taps is at one half between the frames delay - 1 and delay.
    assert!((0.5 * (power(23) + power(24)) - 2.0).abs() < 1e-5);
    assert!(power(23) < 2.0 && power(24) > 2.0);
}

#[test]
fn energy_of_every_channel_is_kept_over_a_long_random_sequence() {
    let mut state = 5u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    let mut filter = LightFilter::new(taps(25.0), Directions::ByPower);
    let (mut came, mut left) = ([0.0f64; 3], [0.0f64; 3]);
    let mut filtered = ReferencedList::default();
    let mut input = ReferencedList::default();
    input.list.lights = (0..4).map(|id| light(id, direction(0.3 * f64::from(id), 1.0), [0.0; 3])).collect();
    for t in 0..50_020 {
        input.list.stamp = stamp(t, 25.0);
        for light in &mut input.list.lights {
            light.irradiance = [0; 3].map(|_| {
                let dark = t == 0 || t >= 50_000;
                if dark { 0.0 } else { 100.0 * random().powi(8) }
            });
        }
        filter.step(&input, &mut filtered);
        let power = input.list.sum_of_lights();
        for channel in 0..3 {
            came[channel] += power[channel];
            left[channel] += filtered.list.power[channel];
        }
    }
    let worst = (0..3).map(|channel| (left[channel] / came[channel] - 1.0).abs()).fold(0.0, f64::max);
    println!("50,000 frames: energy of the worst channel off by {worst:.1e}");
    assert!(worst < 1e-7);
}

#[test]
fn a_source_that_jumps_to_the_opposite_side_goes_over_without_leaving_the_sphere() {
    for rate in [25.0, 60.0, 240.0] {
        for miss in [0.0, 1e-3, 0.05] {
            let from = direction(1.0, 0.5);
            let to = -direction(1.0 + miss, 0.5);
            let lists: Vec<ReferencedList> = (0..200)
                .map(|t| list(t, rate, vec![light(0, if t < 50 { from } else { to }, [1.0; 3])]))
                .collect();
            let left = run(&lists);
            left.iter().for_each(assert_lawful);
            let towards = |t: usize| DVec3::from_array(left[t].list.lights[0].direction.map(f64::from));
            assert!(angle_between(towards(49), from) < 1e-6 && angle_between(towards(199), to) < 1e-6);
            // The direction is never between the two, where there is no light: it is always near one of them.
            let astray = (0..200)
                .map(|t| angle_between(towards(t), from).min(angle_between(towards(t), to)))
                .fold(0.0, f64::max);
            assert!(astray < 12.0 * miss + 1e-6, "{rate} Hz, {miss} rad: {astray}");
        }
    }
}

#[test]
fn directions_turn_smoothly_and_lag_by_the_delay() {
    let at = |t: f64| direction(0.8, 0.02 * t);
    let lists: Vec<ReferencedList> =
        (0..60).map(|t| list(t, 25.0, vec![light(0, at(t as f64), [1.0; 3])])).collect();
    for (t, left) in run(&lists).iter().enumerate().skip(8) {
        let towards = DVec3::from_array(left.list.lights[0].direction.map(f64::from));
        // Symmetric taps leave the azimuth at the centre tap's; the polar angle bends in a little.
        assert!(angle_between(towards, at(t as f64 - 4.0)) < 5e-3);
    }
}

#[test]
fn a_hundred_turns_of_a_sun_leave_power_and_lag_as_in_the_first() {
    // A degree a frame past a flickering lamp, so that debts could accumulate.
    let at = |t: usize| direction(1.0, (t as f64).to_radians());
    let mut filter = LightFilter::new(taps(25.0), Directions::ByPower);
    let mut filtered = ReferencedList::default();
    let (mut first, mut highest) = ([0.0f64; 2], [0.0f64; 2]);
    for t in 0..36_000 {
        let lamp = if t % 5 == 0 { 3e4 } else { 1.0 };
        let mut input = ReferencedList::default();
        input.list.stamp = stamp(t, 25.0);
        input.list.lights =
            vec![light(0, at(t), [1e5; 3]), light(1, direction(0.2, 3.0), [lamp, 0.5 * lamp, 0.0])];
        filter.step(&input, &mut filtered);
        if t < 8 {
            continue;
        }
        let sun = &filtered.list.lights[0];
        let towards = DVec3::from_array(sun.direction.map(f64::from));
        let off = [
            f64::from(sun.irradiance[0] / 1e5 - 1.0).abs(),
            (angle_between(towards, at(t - 4))).to_degrees(),
        ];
        let figures = if t < 360 { &mut first } else { &mut highest };
        *figures = [0, 1].map(|i| figures[i].max(off[i]));
    }
    println!("sun's power and direction: off by {first:?} in the first turn, {highest:?} in the others");
    // Rounding of f32 directions depends on the azimuth, the same in every turn but for that of the angle
    // itself.
    assert!(highest[0] <= first[0] + 1e-7 && highest[1] <= first[1] + 1e-5, "{first:?} {highest:?}");
    assert!(first[0] < 1e-6 && first[1] < 0.1, "{first:?}");
}

#[test]
fn lost_frames_hold_the_last_list_up_to_the_length_of_the_filter() {
    let value = |t: usize| 1.0 + (t % 7) as f32;
    for lost in 1..=9 {
        let complete: Vec<ReferencedList> = (0..60)
            .map(|t| lamp(t, 25.0, if (30..30 + lost).contains(&t) { value(29) } else { value(t) }))
            .collect();
        let mut gappy = complete.clone();
        gappy.drain(30..30 + lost);
        gappy[30].list.stamp.lost_before = lost as u64;
        let (complete, gappy) = (run(&complete), run(&gappy));
        for t in 30 + lost..60 {
            let other = &gappy[t - lost];
            assert_eq!(
                (&other.list.lights, other.list.stamp.sequence),
                (&complete[t].list.lights, t as u64),
                "{lost}"
            );
        }
        assert_eq!(gappy[30].list.stamp.lost_before, lost as u64);
    }
}

/// Whether the filter forgot everything before the last of these lists.
fn forgot(lists: &[ReferencedList]) -> bool {
    let last = lists.last().unwrap();
    run(lists).last().unwrap().list.lights == run(std::slice::from_ref(last)).last().unwrap().list.lights
}

#[test]
fn longer_gaps_backwards_time_and_changed_rates_or_sizes_start_afresh() {
    let before: Vec<ReferencedList> = (0..30).map(|t| lamp(t, 25.0, 5.0)).collect();
    let after = |change: &dyn Fn(&mut ReferencedList)| {
        let mut lists = before.clone();
        let mut last = lamp(30, 25.0, 1.0);
        change(&mut last);
        lists.push(last);
        forgot(&lists)
    };
    assert!(!after(&|_| ()));
    assert!(!after(&|list| list.list.stamp.lost_before = 9));
    assert!(after(&|list| list.list.stamp.lost_before = 10));
    assert!(after(&|list| list.list.stamp.lost_before = u64::MAX));
    assert!(!after(&|list| list.list.stamp.capture_time_ns = before[29].list.stamp.capture_time_ns));
    assert!(after(&|list| list.list.stamp.capture_time_ns = before[29].list.stamp.capture_time_ns - 1));
    assert!(after(&|list| list.list.stamp.capture_time_ns = i64::MIN));
    assert!(after(&|list| list.list.stamp.frame_rate_hz = 30.0));
    assert!(after(&|list| list.list.lights.push(list.list.lights[0])));
    assert!(after(&|list| list.reference_irradiance.truncate(10)));
}

#[test]
fn starting_afresh_forgives_debts() {
    let mut lists: Vec<ReferencedList> =
        (0..12).map(|t| lamp(t, 25.0, if t == 4 { 1e6 } else { 1.0 })).collect();
    lists.push(lamp(0, 25.0, 1.0));
    let left = run(&lists);
    assert_eq!(left[12].list.lights[0].irradiance, [1.0, 2.0, 0.5]);
}

#[test]
fn slots_of_no_power_stay_dark_and_keep_a_direction() {
    let lists: Vec<ReferencedList> = (0..30)
        .map(|t| {
            let flash = if t == 5 { 1e5 } else { 0.0 };
            list(
                t,
                25.0,
                vec![
                    light(0, direction(0.1, 0.0), [flash, 0.0, flash]),
                    light(1, direction(1.0, 2.0), [0.0; 3]),
                ],
            )
        })
        .collect();
    for (t, left) in run(&lists).iter().enumerate() {
        assert_lawful(left);
        assert_eq!(left.list.lights[1].irradiance, [0.0; 3]);
        assert_eq!(left.list.lights[0].irradiance[1], 0.0);
        assert_eq!(
            left.list.lights[0].irradiance[0] > 0.0,
            matches!(t, 5 | 6 | 8..=10),
            "frame {t}: {left:?}"
        );
    }
}

#[test]
fn numbers_that_break_the_contract_never_leave() {
    let mut filter = LightFilter::new(taps(25.0), Directions::ByPower);
    let mut filtered = ReferencedList::default();
    for t in 0..30 {
        let mut input = lamp(t, 25.0, 1e30);
        if t == 10 {
            input.list.lights[0].irradiance = [f32::NAN, f32::INFINITY, -1.0];
            input.list.lights[0].direction = [f32::NAN; 3];
            input.list.lights[0].spread_rad = f32::NAN;
            input.reference_irradiance[3] = f32::NAN;
        }
        if (11..21).contains(&t) {
            input.list.lights[0].direction = [0.0; 3];
        }
        filter.step(&input, &mut filtered);
        assert_lawful(&filtered);
    }
}

#[test]
fn list_that_is_not_filtered_is_a_copy() {
    let mut input = lamp(0, 15.0, 2.0);
    let left = run(&[input.clone()]);
    ListError::new().measure(&mut input);
    assert_eq!(left[0], input);
    assert_eq!(left[0].list.prefix_errors.len(), 1);
}

#[test]
fn empty_list_passes() {
    let mut input = ReferencedList::default();
    input.list.stamp = stamp(0, 25.0);
    let left = run(&[input.clone(), input]);
    assert_eq!(
        (left[1].list.lights.len(), left[1].list.error, left[1].list.filter_delay_frames),
        (0, None, 4)
    );
}

#[test]
fn error_of_a_filtered_list_is_the_slow_one_against_the_filtered_truth() {
    let shape = PolarShape::hemisphere(180, 45);
    let options = Options { count: 64, ..Options::default() };
    let mut extractor = Extractor::new(shape, &options).unwrap();
    let mut filter = LightFilter::new(taps(25.0), Directions::ByPower);
    let taps = taps(25.0);
    let (mut truth, mut filtered) = (Vec::new(), ReferencedList::default());
    for t in 0..30 {
        // A sun that walks on through a cloudy sky, and a lamp that is switched on.
        let mut map = PolarMap::from_fn(shape, |row, column| {
            let sky = 1.0 + 0.5 * (0.1 * (column + 2 * row) as f32).sin();
            let lamp = t >= 12 && row == 30 && column / 3 == 50;
            if row / 2 == 10 && column / 2 == 20 + t / 2 {
                [900.0; 3]
            } else {
                [sky + f32::from(lamp) * 200.0; 3]
            }
        });
        map.stamp = stamp(t, 25.0);
        let mut list = ReferencedList::default();
        extractor.step(&map, &mut list);
        filter.step(&list, &mut filtered);
        truth.push(Emitters::from_map(&map).irradiances(300));
        let filtered_truth: Vec<f64> = (0..300)
            .map(|n| (0..9).map(|k| taps.as_slice()[k] * truth[t.saturating_sub(k)][n]).sum())
            .collect();
        let slow =
            relative_rms(&Emitters::from_lights(&filtered.list.lights).irradiances(300), &filtered_truth);
        let quick = f64::from(filtered.list.error.unwrap());
        assert!((quick / slow - 1.0).abs() < 0.1, "frame {t}: {quick} and {slow}");
        assert_lawful(&filtered);
    }
}
