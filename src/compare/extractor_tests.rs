//! Methods of others, and other inversions, on real maps and difficult maps; the methods of the live path are
//! tested next to their code.

use super::{AnyExtractor, Inversion, Options, Sampler};
use crate::error::Kind;
use glam::DVec3;
use lightcast_core::image::{PolarMap, PolarShape, luminance_f64};
use lightcast_core::light::ReferencedList;
use lightcast_core::light::error::ListError;
use lightcast_core::light::{self, LightList};
use lightcast_core::test_data::{check_dark, check_hard, check_list, hard_maps, real_maps};

const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);

const EQUAL_POWER: Sampler = Sampler::Live(light::Sampler::EqualPower);
const REFINED: Sampler = Sampler::Live(light::Sampler::Refined);
const METHODS: [(Sampler, Inversion); 7] = [
    (EQUAL_POWER, Inversion::Standard),
    (EQUAL_POWER, Inversion::NormalisedRows),
    (REFINED, Inversion::Standard),
    (Sampler::MedianCut, Inversion::Bicontinuous),
    (Sampler::VarianceMinimisation, Inversion::Bicontinuous),
    (Sampler::Structured, Inversion::Bicontinuous),
    (Sampler::KolligKeller, Inversion::Bicontinuous),
];

fn extract(map: &PolarMap, count: usize, (sampler, inversion): (Sampler, Inversion)) -> LightList {
    let mut list = ReferencedList::default();
    let options = Options { count, sampler, inversion };
    AnyExtractor::new(map.shape, &options).unwrap().step(map, &mut list);
    ListError::new().measure(&mut list);
    list.list
}

#[test]
fn power_is_kept_on_every_real_map() {
    for (name, map) in real_maps(SHAPE) {
        let expected = map.power();
        for method in METHODS {
            let list = extract(&map, 64, method);
            check_list(&name, &list, 64);
            let off = (luminance_f64(list.power) / luminance_f64(expected) - 1.0).abs();
            assert!(off < 1e-4, "{name} {method:?}: {off}");
            if method.0 != EQUAL_POWER {
                for channel in 0..3 {
                    assert!((list.power[channel] / expected[channel] - 1.0).abs() < 1e-4, "{name}");
                }
            }
        }
    }
}

#[test]
fn hard_maps_give_whole_lists_and_keep_their_power() {
    for (name, map) in hard_maps() {
        for method in METHODS {
            for count in [1, 2, 64, 300] {
                let case = format!("{name} {method:?} {count}");
                check_hard(&case, name, &map, &extract(&map, count, method), count);
            }
        }
    }
}

#[test]
fn lights_of_8192_x_2048_pixels_keep_the_power_that_f32_sums_would_lose() {
    // 1 everywhere except for one pixel of 1e8: from there on f32 sums of radiance lose all other pixels.
    let shape = PolarShape::hemisphere(8192, 2048);
    let (row, column) = (1100, 4);
    let map = PolarMap::from_fn(shape, |r, c| if (r, c) == (row, column) { [1e8; 3] } else { [1.0; 3] });
    let sun = 1e8 * shape.pixel_solid_angle(row);
    for method in &METHODS[3..] {
        // Hundreds of passes over 16 million pixels for 64 lights would show no more than a few dozen passes
        // for 4 lights, whose cells contain more than the sun.
        let (count, most_rad) = if method.0 == Sampler::KolligKeller { (4, 1e-2) } else { (64, 1e-3) };
        let list = extract(&map, count, *method);
        check_list(&format!("{method:?}"), &list, count);
        let expected = std::f64::consts::TAU + sun - shape.pixel_solid_angle(row);
        assert!((list.power[1] / expected - 1.0).abs() < 1e-6, "{method:?}: {:?}", list.power);
        let brightest = list.lights.iter().max_by(|a, b| a.luminance().total_cmp(&b.luminance())).unwrap();
        let direction = DVec3::from_array(brightest.direction.map(f64::from));
        let off = lightcast_core::math::angle_between(direction, shape.pixel_direction(row, column));
        assert!(
            off < most_rad && f64::from(brightest.irradiance[1]) > 0.9999 * sun,
            "{method:?}: {off} {brightest:?}"
        );
    }
}

#[test]
fn all_black_map_gives_uniform_directions_without_power() {
    let map = PolarMap::black(SHAPE);
    for method in METHODS {
        // Rectangles and strata are uniform too, but not all of the same size when there are 144 of them.
        let is_by_inversion = matches!(method.0, Sampler::Live(_) | Sampler::KolligKeller);
        let tolerance = if is_by_inversion { [0.02, 0.01, 0.02] } else { [0.1; 3] };
        check_dark(&format!("{method:?}"), &extract(&map, 144, method), tolerance);
    }
}

#[test]
fn counts_beyond_reason_and_inversions_that_a_method_does_not_have_are_refused() {
    let refused = |options: &Options| AnyExtractor::new(SHAPE, options).unwrap_err();
    for count in [0, light::MAX_LIGHTS + 1] {
        for (sampler, inversion) in METHODS {
            let error = refused(&Options { count, sampler, inversion });
            assert!(error.kind() == Kind::Usage && error.to_string().starts_with("count = "), "{error}");
        }
    }
    for sampler in [light::Sampler::Persistent, light::Sampler::Adaptive] {
        let sampler = Sampler::Live(sampler);
        let error = refused(&Options { count: 4, sampler, inversion: Inversion::Standard });
        assert!(error.kind() == Kind::Usage && error.to_string().starts_with("inversion: "), "{error}");
    }
}
