use super::*;
use lightcast_core::image::PolarShape;
use lightcast_core::math::direction;

/// A lamp overhead of some power, and another one at the side, at this azimuth.
fn list(power: f32, azimuth_rad: f64) -> LightList {
    let light = |id, theta: f64, irradiance: f32| Light {
        id,
        direction: direction(theta, azimuth_rad).as_vec3().to_array(),
        irradiance: [irradiance; 3],
        spread_rad: 0.0,
    };
    let lights = vec![light(0, 0.0, power), light(1, std::f64::consts::FRAC_PI_2, 0.0)];
    LightList { lights, ..LightList::default() }
}

fn truth(list: &LightList) -> Vec<f64> {
    values(&Emitters::from_lights(&list.lights))
}

#[test]
fn steady_offsets_are_error_without_flicker_and_alternating_ones_are_both() {
    let reference: Vec<Vec<f64>> = vec![truth(&list(1.0, 0.0)); 10];
    let mean = reference[0].iter().sum::<f64>() / 200.0;
    let square = reference[0].iter().map(|value| value * value).sum::<f64>() / 200.0;
    // All values scale with the power, so an offset of 10 % is 0.1 of the RMS value.
    let tenth = 0.1 * square.sqrt() / mean;
    let steady: Vec<LightList> = (0..10).map(|_| list(1.1, 0.0)).collect();
    let found = figures(&steady, &reference, hard, &|| true).unwrap();
    assert!((found.error / tenth - 1.0).abs() < 1e-6 && found.flicker < 1e-12, "{found:?}");
    let alternating: Vec<LightList> =
        (0..10).map(|t| list(if t % 2 == 0 { 1.1 } else { 0.9 }, 0.0)).collect();
    let found = figures(&alternating, &reference, hard, &|| true).unwrap();
    // Second difference of +e, -e, +e is 4 e.
    assert!((found.error / tenth - 1.0).abs() < 1e-6, "{found:?}");
    assert!((found.flicker / (4.0 * tenth) - 1.0).abs() < 1e-6, "{found:?}");
}

#[test]
fn motion_is_in_degrees_a_frame_over_all_slots() {
    let lists: Vec<LightList> = (0..10).map(|t| list(1.0, 0.02 * f64::from(t))).collect();
    let reference: Vec<Vec<f64>> = lists.iter().map(truth).collect();
    let [p50, p99, max] = figures(&lists, &reference, hard, &|| true).unwrap().motion_deg;
    // Half the lights stand still, the others turn by 0.02 rad.
    let turn = 0.02f64.to_degrees();
    assert!((p50 - 0.5 * turn).abs() < 1e-4 && (p99 - turn).abs() < 1e-4 && (max - turn).abs() < 1e-4);
}

#[test]
fn any_maps_of_one_shape_are_a_sequence_and_black_ones_have_no_error() {
    let shape = PolarShape::hemisphere(12, 4);
    let maps = |count, rate, gain: f32| -> Vec<PolarMap> {
        let frame = |t| PolarMap {
            stamp: stamp(t, rate),
            ..PolarMap::from_fn(shape, |row, column| [gain * (row * 7 + (column + t) % 12) as f32; 3])
        };
        (0..count).map(frame).collect()
    };
    let sequence = |maps| Sequence::from_maps(maps, &|| true).unwrap().unwrap();
    let measure = |sequence: &Sequence, method, count| -> Timed {
        sequence.measure(method, count, &|| true).unwrap().unwrap()
    };
    let moving = sequence(maps(12, 25.0, 1.0));
    assert_eq!((moving.frame_count(), moving.is_filtered()), (12, true));
    let few = measure(&moving, SequenceMethod::Persistent, 4).measured;
    let many = measure(&moving, SequenceMethod::Persistent, 32);
    assert!(many.time > Duration::ZERO);
    assert!(many.measured.after.error < few.after.error, "{many:?} {few:?}");
    // Below 19.2 Hz nothing is filtered.
    let slow = sequence(maps(3, 10.0, 1.0));
    let BeforeAndAfter { before, after, .. } = measure(&slow, SequenceMethod::Refined, 8).measured;
    assert!(!slow.is_filtered() && before == after);
    let black = sequence(maps(12, 25.0, 0.0));
    let BeforeAndAfter { before, after, .. } = measure(&black, SequenceMethod::Paper, 8).measured;
    assert_eq!([before.error, before.flicker, after.error, after.flicker], [0.0; 4]);
    let refused = |maps| Sequence::from_maps(maps, &|| true).err().unwrap().to_string();
    assert_eq!([25.0, 10.0].map(|rate_hz| Sequence::least_frames(rate_hz).unwrap()), [11, 3]);
    assert!(refused(maps(10, 25.0, 1.0)).contains("10 frames that can be used; give at least 11"));
    assert!(refused(Vec::new()).contains("0 frames"));
    let mut uneven = maps(12, 25.0, 1.0);
    uneven[5] = PolarMap::black(PolarShape::hemisphere(6, 4));
    assert!(refused(uneven).contains("different shapes"));
}

#[test]
fn who_stops_a_measurement_is_heard_at_every_frame() {
    let maps = || -> Vec<PolarMap> {
        let map = PolarMap::from_fn(PolarShape::hemisphere(12, 4), |row, column| [(row + column) as f32; 3]);
        vec![map; 12]
    };
    // With stamps of 0 Hz nothing is filtered: `goes_on` is called 12 times for the truth, and again as many
    // times when lights are made and for each of the four kinds of figures.
    let sequence = Sequence::from_maps(maps(), &|| true).unwrap().unwrap();
    for limit in 0..60 {
        let asked = std::cell::Cell::new(0);
        let goes_on = || asked.replace(asked.get() + 1) < limit;
        assert!(sequence.measure(SequenceMethod::Refined, 4, &goes_on).unwrap().is_none());
        assert_eq!(asked.get(), limit + 1);
        if limit < 12 {
            asked.set(0);
            assert!(Sequence::from_maps(maps(), &goes_on).unwrap().is_none());
            assert_eq!(asked.get(), limit + 1);
        }
    }
}

#[test]
fn maps_of_another_shape_are_refused() {
    let error = Sequence::garden(&PolarMap::black(PolarShape::sphere(360, 180)), &|| true).err().unwrap();
    assert!(error.to_string().contains("360 x 180"), "{error}");
}
