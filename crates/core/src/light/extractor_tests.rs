//! Extractor on real and awkward maps: power, degenerate input; errors against METHODS' tables are in the
//! program's report, beside those of other methods.

use super::error::ListError;
use super::occlusion::OcclusionError;
use super::{Extractor, LightList, MapIrradiance, Options, ReferencedList, Sampler};
use crate::error::Kind;
use crate::image::{PolarMap, PolarShape, luminance_f64};
use crate::math::fibonacci_sphere;
use crate::test_data::{check_dark, check_hard, check_list, hard_maps, real_maps};
use glam::DVec3;

const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);

const SAMPLERS: [Sampler; 4] =
    [Sampler::EqualPower, Sampler::Refined, Sampler::Persistent, Sampler::Adaptive];

fn extract(map: &PolarMap, count: usize, sampler: Sampler) -> LightList {
    let mut list = ReferencedList::default();
    let options = Options { count, sampler, ..Options::default() };
    Extractor::new(map.shape, &options).unwrap().step(map, &mut list);
    ListError::new().measure(&mut list);
    list.list
}

#[test]
fn power_is_kept_on_every_real_map() {
    let mut worst = 0f64;
    for (name, map) in real_maps(SHAPE) {
        let expected = map.power();
        for sampler in SAMPLERS {
            let list = extract(&map, 64, sampler);
            check_list(&name, &list, 64);
            let off = (luminance_f64(list.power) / luminance_f64(expected) - 1.0).abs();
            worst = worst.max(off);
            assert!(off < 1e-4, "{name} {sampler:?}: {off}");
            if sampler != Sampler::EqualPower {
                for channel in 0..3 {
                    assert!((list.power[channel] / expected[channel] - 1.0).abs() < 1e-4, "{name}");
                }
            }
        }
    }
    println!("power kept: worst {worst:.1e}");
}

/// More lights are not always better: a step adds sites, and all of them move. `cargo test --package
/// lightcast-core rises -- --nocapture` prints where the error rises from one number to the next.
#[test]
fn rises_of_the_error_with_the_number_of_lights_are_known() {
    const COUNTS: [usize; 16] = [4, 6, 8, 12, 16, 18, 24, 32, 36, 48, 64, 72, 96, 128, 192, 256];
    let shape = PolarShape::sphere(360, 180);
    let (mut steps, mut rises, mut worst) = (0, 0, 0f64);
    for (name, map) in real_maps(shape) {
        let errors = COUNTS.map(|count| extract(&map, count, Sampler::Refined).error.unwrap());
        for (counts, pair) in COUNTS.windows(2).zip(errors.windows(2)) {
            let rise = f64::from(pair[1] / pair[0]);
            steps += 1;
            worst = worst.max(rise);
            if rise > 1.1 {
                rises += 1;
                println!(
                    "{name}: {} lights {:.4}, {} lights {:.4}: {rise:.2} times",
                    counts[0], pair[0], counts[1], pair[1]
                );
            }
        }
        // From one end to the other it always gets better.
        assert!(errors[15] < 0.2 * errors[0], "{name}: {errors:?}");
    }
    println!("{rises} rises of more than a tenth in {steps} steps, worst {worst:.2} times");
    assert!(worst < 2.5, "{worst}");
}

#[test]
fn hard_maps_give_whole_lists_and_keep_their_power() {
    for (name, map) in hard_maps() {
        for sampler in SAMPLERS {
            for count in [1, 2, 64, 300] {
                let case = format!("{name} {sampler:?} {count}");
                check_hard(&case, name, &map, &extract(&map, count, sampler), count);
            }
        }
    }
}

#[test]
fn lights_of_8192_x_2048_pixels_keep_the_power_that_f32_sums_would_lose() {
    // 1 everywhere beside one pixel of 1e8: f32 sums of radiance drop every other pixel from there on.
    let shape = PolarShape::hemisphere(8192, 2048);
    let (row, column) = (1100, 4);
    let map = PolarMap::from_fn(shape, |r, c| if (r, c) == (row, column) { [1e8; 3] } else { [1.0; 3] });
    let sun = 1e8 * shape.pixel_solid_angle(row);
    let mut referenced = ReferencedList::default();
    for sampler in SAMPLERS {
        let options = Options { count: 64, sampler, ..Options::default() };
        let mut extractor = Extractor::new(shape, &options).unwrap();
        // The second frame of persistent and adaptive lights starts from the first's.
        let is_followed = matches!(sampler, Sampler::Persistent | Sampler::Adaptive);
        for _ in 0..if is_followed { 2 } else { 1 } {
            extractor.step(&map, &mut referenced);
            ListError::new().measure(&mut referenced);
            let list = &referenced.list;
            check_list(&format!("{sampler:?}"), list, 64);
            let expected = std::f64::consts::TAU + sun - shape.pixel_solid_angle(row);
            assert!((list.power[1] / expected - 1.0).abs() < 1e-6, "{sampler:?}: {:?}", list.power);
        }
        if sampler != Sampler::EqualPower {
            let brightest =
                referenced.list.lights.iter().max_by(|a, b| a.luminance().total_cmp(&b.luminance())).unwrap();
            let direction = DVec3::from_array(brightest.direction.map(f64::from));
            let off = crate::math::angle_between(direction, shape.pixel_direction(row, column));
            // A peak leaves four mean radiances in the map.
            assert!(
                off < 1e-3 && f64::from(brightest.irradiance[1]) > 0.9999 * sun,
                "{sampler:?}: {off} {brightest:?}"
            );
        }
    }
}

#[test]
fn all_black_map_gives_uniform_directions_without_power() {
    let map = PolarMap::black(SHAPE);
    for sampler in SAMPLERS {
        let list = extract(&map, 144, sampler);
        assert_eq!(list.error, Some(0.0));
        // By the inverse transform: uniform up to the unevenness of the points themselves.
        check_dark(&format!("{sampler:?}"), &list, [0.02, 0.01, 0.02]);
    }
}

#[test]
fn one_light_is_the_map_itself() {
    // A closed form: a constant hemisphere of radiance 1 has flux 2 pi and first moment pi towards the
    // zenith.
    let map = PolarMap::from_fn(SHAPE, |_, _| [1.0; 3]);
    let list = extract(&map, 1, Sampler::Refined);
    let light = list.lights[0];
    assert!((f64::from(light.irradiance[0]) / std::f64::consts::TAU - 1.0).abs() < 1e-6);
    assert!((light.direction[1] - 1.0).abs() < 1e-6);
    assert!((f64::from(light.spread_rad).cos() - 0.5).abs() < 1e-4, "{}", light.spread_rad);
}

#[test]
fn spread_of_an_even_disc_is_its_rms_angle() {
    // Disc of radius 0.3 rad about the pole: the RMS angle is 0.3 / sqrt 2 less terms of the fourth order.
    let shape = PolarShape::new(64, 300, 0.3).unwrap();
    let map = PolarMap::from_fn(shape, |_, _| [1.0; 3]);
    let spread = extract(&map, 1, Sampler::Refined).lights[0].spread_rad;
    assert!((f64::from(spread) / (0.3 / 2f64.sqrt()) - 1.0).abs() < 3e-3, "{spread}");
}

#[test]
fn equal_power_lights_are_equal_and_take_the_colour_of_their_pixel() {
    let map =
        PolarMap::from_fn(SHAPE, |_, column| if column < 180 { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 2.0] });
    let list = extract(&map, 64, Sampler::EqualPower);
    let share = luminance_f64(map.power()) / 64.0;
    for light in &list.lights {
        assert!((f64::from(light.luminance()) / share - 1.0).abs() < 1e-5);
        // Columns below 180 are azimuths below pi, which is where z is positive.
        let channel = if light.direction[2] > 0.0 { 0 } else { 2 };
        assert!(light.irradiance[channel] > 0.0 && light.irradiance[2 - channel] == 0.0, "{light:?}");
    }
}

#[test]
fn counts_beyond_reason_are_refused() {
    let refused = |options: &Options| Extractor::new(SHAPE, options).unwrap_err();
    for count in [0, super::MAX_LIGHTS + 1, usize::MAX] {
        let error = refused(&Options { count, ..Options::default() });
        assert_eq!(error.kind(), Kind::Usage);
        assert!(error.to_string().starts_with(&format!("count = {count}: ")), "{error}");
    }
    assert!(refused(&Options { relaxation_steps: 101, ..Options::default() }).to_string().contains("101"));
}

/// How many lights are chosen for a map that stays the same for 40 seconds, with the errors of the last list:
/// the one by which they are chosen, and that of irradiance.
fn chosen(map: &PolarMap, error_target: f32) -> (u32, [f32; 2]) {
    let options = Options { count: 512, error_target: Some(error_target), ..Options::default() };
    let (mut extractor, mut list) = (Extractor::new(map.shape, &options).unwrap(), ReferencedList::default());
    let mut map = map.clone();
    map.stamp.frame_rate_hz = 25.0;
    let mut last = 0;
    for frame in 0..1000 {
        extractor.step(&map, &mut list);
        let chosen = list.list.chosen_lights.unwrap();
        // Hysteresis: once settled, the number stays.
        assert!(frame < 900 || chosen == last, "frame {frame}: {last}, {chosen}");
        last = chosen;
    }
    let lit = list.list.lights.iter().filter(|light| light.luminance() > 0.0).count();
    assert!((lit as u32).abs_diff(last) <= last / 16 + 1, "{lit} of {last}");
    (last, errors(&map, &list.list))
}

fn errors(map: &PolarMap, list: &LightList) -> [f32; 2] {
    let (mut irradiance, mut reference) = (MapIrradiance::new(map.shape), Vec::new());
    irradiance.reference(map, &mut reference);
    [
        OcclusionError::new().relative_error(&list.lights, irradiance.blocks()),
        ListError::new().relative_error(&list.lights, &reference),
    ]
}

/// The error by which lights are chosen, of `count` adaptive lights of a static map.
fn error_of(map: &PolarMap, count: u32) -> f32 {
    let options = Options { count: count as usize, ..Options::default() };
    let (mut extractor, mut list) = (Extractor::new(map.shape, &options).unwrap(), LightList::default());
    for _ in 0..30 {
        extractor.extract(map, &mut list);
    }
    errors(map, &list)[0]
}

/// Small lamps that are spread evenly over a ceiling, over a dim floor of light.
fn lamps(count: usize) -> PolarMap {
    let lamps: Vec<DVec3> = fibonacci_sphere(2 * count).filter(|lamp| lamp.y > 0.0).collect();
    assert_eq!(lamps.len(), count);
    PolarMap::from_fn(SHAPE, |row, column| {
        let towards = SHAPE.pixel_direction(row, column);
        let is_lamp = lamps.iter().any(|lamp| lamp.dot(towards) > 1.2f64.to_radians().cos());
        [if is_lamp { 1000.0 } else { 0.1 }; 3]
    })
}

#[test]
fn an_overcast_sky_gets_few_lights_and_a_hall_of_lamps_many() {
    let even = PolarMap::from_fn(SHAPE, |_, _| [1.0; 3]);
    // The standard overcast sky of the CIE: three times as bright at the zenith as at the horizon.
    let overcast =
        PolarMap::from_fn(SHAPE, |row, _| [(1.0 + 2.0 * SHAPE.pixel_direction(row, 0).y as f32) / 3.0; 3]);
    let counts = [
        ("even sky", &even),
        ("overcast sky", &overcast),
        ("30 lamps", &lamps(30)),
        ("120 lamps", &lamps(120)),
    ]
    .map(|(name, map)| {
        let (count, [error, of_irradiance]) = chosen(map, 0.01);
        println!("{name}: {count} of 512 lights, error {error:.5}, of irradiance {of_irradiance:.5}");
        assert!(error <= 0.01, "{name}: {error}");
        count
    });
    assert!(counts[0] <= 20 && counts[1] <= 20, "{counts:?}");
    // With 120 lamps, pairs of them may share a light.
    assert!((30..=40).contains(&counts[2]) && (60..=130).contains(&counts[3]), "{counts:?}");
}

#[test]
fn as_many_lights_are_chosen_as_keep_the_error_below_the_target_and_no_more() {
    let (mut counts, mut halves) = (Vec::new(), Vec::new());
    for (name, map) in real_maps(SHAPE) {
        let [few, many] = [0.01, 0.003].map(|target| {
            let (count, [error, _]) = chosen(&map, target);
            println!("{name}, error below {target}: {count} of 512 lights, error {error:.5}");
            assert!(error <= target, "{name}: {count} {error}");
            // Half as many lights, even if there had been that many from the start.
            halves.push(f64::from(error_of(&map, count / 2) / target));
            count
        });
        assert!(few < many, "{name}: {few} {many}");
        counts.push(few);
    }
    counts.sort_unstable();
    if let [least, .., most] = counts[..] {
        assert!(most > 4 * least, "{counts:?}");
        halves.sort_by(f64::total_cmp);
        assert!(halves[halves.len() / 2] > 1.2, "half as many would do: {halves:?}");
    }
}

#[test]
fn a_number_of_lights_is_chosen_for_adaptive_lights_only() {
    for sampler in SAMPLERS {
        let options = Options { sampler, error_target: Some(0.01), ..Options::default() };
        let refused = Extractor::new(SHAPE, &options).err();
        assert_eq!(refused.is_none(), sampler == Sampler::Adaptive, "{sampler:?}");
        let options = Options { sampler, budget_ms: Some(1.0), ..Options::default() };
        assert_eq!(Extractor::new(SHAPE, &options).is_ok(), sampler == Sampler::Adaptive);
    }
    assert_eq!(extract(&PolarMap::black(SHAPE), 8, Sampler::Adaptive).chosen_lights, None);
    let mut list = ReferencedList::default();
    let options = Options { count: 100, budget_ms: Some(1.0), ..Options::default() };
    let mut extractor = Extractor::new(SHAPE, &options).unwrap();
    let map = PolarMap::from_fn(SHAPE, |row, _| [row as f32 + 1.0; 3]);
    for _ in 0..12 {
        extractor.step(&map, &mut list);
        extractor.took(std::time::Duration::from_millis(2), 25.0);
    }
    assert!(list.list.chosen_lights.unwrap() < 60, "{:?}", list.list.chosen_lights);
}
