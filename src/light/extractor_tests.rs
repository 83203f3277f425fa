//! Extractor on real and awkward maps: power, errors against METHODS' tables, degenerate input.

use super::error::ListError;
use super::measure::Reference;
use super::test_maps::{hard_maps, real_maps};
use super::{Extractor, Inversion, Light, LightList, Options, Sampler};
use crate::error::Kind;
use crate::image::{PolarMap, PolarShape};

const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);

const SAMPLERS: [Sampler; 3] = [Sampler::EqualPower, Sampler::Refined, Sampler::Persistent];
const INVERSIONS: [Inversion; 2] = [Inversion::Bicontinuous, Inversion::Standard];

fn extract(map: &PolarMap, count: usize, sampler: Sampler, inversion: Inversion) -> LightList {
    let mut list = LightList::default();
    let options = Options { count, sampler, inversion, ..Options::default() };
    Extractor::new(map.shape, &options).unwrap().step(map, &mut list);
    ListError::new().measure(&mut list);
    list
}

/// Everything that any list must be.
fn check_list(case: &str, list: &LightList, count: usize) {
    assert_eq!(list.lights.len(), count, "{case}");
    for (slot, Light { id, direction, irradiance, spread_rad }) in list.lights.iter().enumerate() {
        assert_eq!(*id as usize, slot, "{case}");
        let length = direction.iter().map(|d| d * d).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-6, "{case}: {direction:?}");
        assert!(irradiance.iter().all(|v| v.is_finite() && *v >= 0.0), "{case}: {irradiance:?}");
        assert!((0.0..=std::f32::consts::FRAC_PI_2).contains(spread_rad), "{case}: {spread_rad}");
    }
    assert!(list.error >= 0.0 && list.error.is_finite(), "{case}: error {}", list.error);
    assert_eq!(list.prefix_errors.last(), Some(&(count as u32, list.error)), "{case}");
}

fn luminance(rgb: [f64; 3]) -> f64 {
    super::refine::luminance(rgb)
}

#[test]
fn power_is_kept_on_every_real_map() {
    let mut worst = 0f64;
    for (name, map) in real_maps("power_is_kept_on_every_real_map", SHAPE) {
        let expected = map.power();
        for sampler in SAMPLERS {
            for inversion in INVERSIONS {
                let list = extract(&map, 64, sampler, inversion);
                check_list(&name, &list, 64);
                let off = (luminance(list.power) / luminance(expected) - 1.0).abs();
                worst = worst.max(off);
                assert!(off < 1e-4, "{name} {sampler:?}: {off}");
                if sampler != Sampler::EqualPower {
                    for channel in 0..3 {
                        assert!((list.power[channel] / expected[channel] - 1.0).abs() < 1e-4, "{name}");
                    }
                }
            }
        }
    }
    println!("power kept: worst {worst:.1e}");
}

#[test]
fn errors_reach_the_published_table() {
    /// A row of METHODS section 6: shadow, irradiance, glossy at 64 and 256 lights; by how much ours may be above.
    type Row = (&'static str, Sampler, Inversion, [[f64; 2]; 3], f64);
    const TABLE: [Row; 3] = [
        (
            "standard, equal power",
            Sampler::EqualPower,
            Inversion::Standard,
            [[0.0324, 0.0110], [0.0410, 0.0159], [0.216, 0.081]],
            1.25,
        ),
        (
            "bicontinuous, equal power",
            Sampler::EqualPower,
            Inversion::Bicontinuous,
            [[0.0213, 0.0062], [0.0606, 0.0173], [0.280, 0.088]],
            1.25,
        ),
        (
            "refined",
            Sampler::Refined,
            Inversion::Bicontinuous,
            [[0.0060, 0.0014], [0.0031, 0.00066], [0.0311, 0.0051]],
            1.15,
        ),
    ];
    let maps = real_maps("errors_reach_the_published_table", SHAPE);
    if maps.is_empty() {
        return;
    }
    let references: Vec<Reference> = maps.iter().map(|(_, map)| Reference::new(map)).collect();
    let mut missed = Vec::new();
    for (row, sampler, inversion, published, factor) in TABLE {
        for (column, count) in [64, 256].into_iter().enumerate() {
            let mut logarithms = [0.0; 3];
            for ((_, map), reference) in maps.iter().zip(&references) {
                let errors = reference.errors(&extract(map, count, sampler, inversion).lights);
                for (sum, error) in
                    logarithms.iter_mut().zip([errors.shadow, errors.irradiance, errors.glossy])
                {
                    *sum += error.ln();
                }
            }
            for (measure, sum) in logarithms.into_iter().enumerate() {
                let (mean, target) = ((sum / maps.len() as f64).exp(), published[measure][column]);
                let name = ["shadow", "irradiance", "glossy"][measure];
                println!(
                    "{row:28} {count:4} {name:10} {mean:.5} published {target:.5} ({:+.0} %)",
                    100.0 * (mean / target - 1.0)
                );
                if mean > factor * target {
                    missed.push(format!("{row} {count} {name}: {mean:.5} against {target:.5}"));
                }
            }
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn hard_maps_give_whole_lists_and_keep_their_power() {
    for (name, map) in hard_maps() {
        for sampler in SAMPLERS {
            for inversion in INVERSIONS {
                for count in [1, 2, 64, 300] {
                    let case = format!("{name} {sampler:?} {inversion:?} {count}");
                    let list = extract(&map, count, sampler, inversion);
                    if name == "largest values" {
                        // Irradiances are held at f32::MAX: only finiteness can be asked.
                        assert!(list.lights.iter().flat_map(|l| l.irradiance).all(f32::is_finite), "{case}");
                        continue;
                    }
                    check_list(&case, &list, count);
                    let (power, expected) = (luminance(list.power), luminance(map.power()));
                    // Below 1e-38 f32 has fewer digits.
                    let tolerance = if name == "tiny values" { 0.05 } else { 1e-4 };
                    assert!((power - expected).abs() <= tolerance * expected, "{case}: {power} {expected}");
                }
            }
        }
    }
}

#[test]
fn all_black_map_gives_uniform_directions_without_power() {
    let map = PolarMap::black(SHAPE);
    for sampler in SAMPLERS {
        for inversion in INVERSIONS {
            let list = extract(&map, 144, sampler, inversion);
            assert!(list.lights.iter().all(|l| l.irradiance == [0.0; 3] && l.spread_rad == 0.0));
            assert_eq!((list.error, list.power), (0.0, [0.0; 3]));
            // Uniform over the hemisphere: cos theta has mean 1/2, the horizontal components cancel.
            let mean =
                [0, 1, 2].map(|axis| list.lights.iter().map(|l| l.direction[axis]).sum::<f32>() / 144.0);
            assert!((mean[1] - 0.5).abs() < 0.01 && mean[0].abs() < 0.02 && mean[2].abs() < 0.02, "{mean:?}");
        }
    }
}

#[test]
fn one_light_is_the_map_itself() {
    // A closed form: a constant hemisphere of radiance 1 has flux 2 pi and first moment pi towards the zenith.
    let map = PolarMap::from_fn(SHAPE, |_, _| [1.0; 3]);
    let list = extract(&map, 1, Sampler::Refined, Inversion::Bicontinuous);
    let light = list.lights[0];
    assert!((f64::from(light.irradiance[0]) / std::f64::consts::TAU - 1.0).abs() < 1e-6);
    assert!((light.direction[1] - 1.0).abs() < 1e-6);
    assert!((f64::from(light.spread_rad).cos() - 0.5).abs() < 1e-4, "{}", light.spread_rad);
}

#[test]
fn spread_of_an_even_disc_is_its_rms_angle() {
    // Disc of radius 0.3 rad about the pole: the RMS angle is 0.3 / sqrt 2 less terms of the fourth order.
    let shape = PolarShape { columns: 64, rows: 300, theta_max_rad: 0.3 };
    let map = PolarMap::from_fn(shape, |_, _| [1.0; 3]);
    let spread = extract(&map, 1, Sampler::Refined, Inversion::Standard).lights[0].spread_rad;
    assert!((f64::from(spread) / (0.3 / 2f64.sqrt()) - 1.0).abs() < 3e-3, "{spread}");
}

#[test]
fn equal_power_lights_are_equal_and_take_the_colour_of_their_pixel() {
    let map =
        PolarMap::from_fn(SHAPE, |_, column| if column < 180 { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 2.0] });
    let list = extract(&map, 64, Sampler::EqualPower, Inversion::Bicontinuous);
    let share = luminance(map.power()) / 64.0;
    for light in &list.lights {
        assert!((f64::from(light.luminance()) / share - 1.0).abs() < 1e-5);
        // Columns below 180 are azimuths below pi, which is where z is positive.
        let channel = if light.direction[2] > 0.0 { 0 } else { 2 };
        assert!(light.irradiance[channel] > 0.0 && light.irradiance[2 - channel] == 0.0, "{light:?}");
    }
}

#[test]
fn counts_and_shapes_beyond_reason_are_refused() {
    let refused = |shape, options: &Options| Extractor::new(shape, options).unwrap_err();
    for count in [0, super::MAX_LIGHTS + 1, usize::MAX] {
        let error = refused(SHAPE, &Options { count, ..Options::default() });
        assert_eq!(error.kind(), Kind::Usage);
        assert!(error.to_string().starts_with("count: "), "{error}");
    }
    assert!(
        refused(SHAPE, &Options { relaxation_steps: 101, ..Options::default() }).to_string().contains("101")
    );
    for shape in [
        PolarShape::hemisphere(0, 9),
        PolarShape::hemisphere(9, 0),
        PolarShape::hemisphere(usize::MAX, 2),
        PolarShape { theta_max_rad: f64::NAN, ..SHAPE },
        PolarShape { theta_max_rad: 3.2, ..SHAPE },
        PolarShape { theta_max_rad: 0.0, ..SHAPE },
    ] {
        assert_eq!(refused(shape, &Options::default()).kind(), Kind::Usage, "{shape:?}");
    }
}

#[test]
fn options_are_read_by_name_and_unknown_names_refused() {
    let options: Options = toml::from_str(
        "count = 300\nsampler = \"equal-power\"\ninversion = \"standard\"\nrelaxation_steps = 0",
    )
    .unwrap();
    let expected = Options {
        count: 300,
        sampler: Sampler::EqualPower,
        inversion: Inversion::Standard,
        relaxation_steps: 0,
    };
    assert_eq!(options, expected);
    assert_eq!(toml::from_str::<Options>("").unwrap(), Options::default());
    assert!(toml::from_str::<Options>("cuont = 3").unwrap_err().to_string().contains("cuont"));
}
