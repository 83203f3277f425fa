use super::*;
use crate::calibrate::{PatchCodes, Rectangle};
use lightcast_core::image::{Frame, Pixels};

/// Marsaglia's xorshift64, as approximately normally distributed numbers.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let uniform = (0..12).map(|_| {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        });
        uniform.sum::<f64>() - 6.0
    }
}

/// A patch of 20 x 20 pixels as `model` codes it, with Gaussian noise of `noise_codes`.
fn patch(model: &ResponseModel, luminance_cd_m2: f64, noise_codes: f64, noise: &mut Noise) -> Patch {
    let response = Response::new(model.clone()).unwrap();
    let (black, saturation) = (f64::from(response.black_clip_code()), f64::from(response.saturation_code()));
    let exact = match model {
        ResponseModel::Logarithmic { a, b, .. } => a + b * luminance_cd_m2.ln(),
        ResponseModel::Linear { black_level, gain, .. } => f64::from(*black_level) + luminance_cd_m2 / gain,
        _ => f64::from(response.encode(luminance_cd_m2 as f32)),
    };
    let codes = (0..400)
        .map(|_| (exact + noise_codes * noise.next()).round().clamp(black, saturation) as u16)
        .collect();
    let frame = Frame { width: 20, height: 20, pixels: Pixels::Codes(codes), ..Frame::default() };
    let mut codes = PatchCodes::default();
    codes.add(&frame, Rectangle { x: 0, y: 0, width: 20, height: 20 }).unwrap();
    Patch { luminance_cd_m2, codes, is_held_out: false }
}

/// 12 bits over 8 decades, 1e-3 to 1e5 cd/m2.
fn logarithmic() -> ResponseModel {
    let b = 4000.0 / (8.0 * 10f64.ln());
    ResponseModel::Logarithmic { a: 50.0 + 3.0 * 4000.0 / 8.0, b, black_clip_code: 0, saturation_code: 4095 }
}

fn worst_ratio(found: &Response, truth: &ResponseModel, codes: std::ops::RangeInclusive<u16>) -> f64 {
    let truth = Response::new(truth.clone()).unwrap();
    codes
        .map(|code| {
            let code = usize::from(code);
            (f64::from(found.table()[code]) / f64::from(truth.table()[code]) - 1.0).abs()
        })
        .fold(0.0, f64::max)
}

#[test]
fn eight_decades_in_twelve_bits_come_back_within_two_per_cent() {
    for seed in 1..=20 {
        let mut noise = Noise(seed);
        // The paper's six patches, two of them held out.
        let mut patches: Vec<Patch> =
            [3e-3, 0.1, 4.0, 90.0, 2e3, 7e4].map(|l| patch(&logarithmic(), l, 1.0, &mut noise)).into();
        patches[2].is_held_out = true;
        patches[4].is_held_out = true;
        let fit = fit_patches(&patches, &PatchFitOptions::default()).unwrap();
        assert_eq!(fit.family, Family::Logarithmic);
        let worst = worst_ratio(&fit.response, &logarithmic(), 50..=4050);
        assert!(worst < 0.02, "seed {seed}: {worst}");
        for result in &fit.patches {
            assert!(stops(result.fitted_cd_m2.unwrap(), result.luminance_cd_m2).abs() < 0.01, "{result:?}");
        }
        assert_eq!(fit.patches.iter().filter(|patch| patch.usage == PatchUse::HeldOut).count(), 2);
    }
}

#[test]
fn clipped_patches_are_found_and_take_no_part() {
    let model = ResponseModel::Logarithmic { a: 500.0, b: 60.0, black_clip_code: 180, saturation_code: 1000 };
    let mut noise = Noise(5);
    let luminances = [1e-5, 1e-3, 0.03, 1.0, 30.0, 900.0, 1e4, 1e5];
    let patches = luminances.map(|l| patch(&model, l, 1.0, &mut noise));
    let fit = fit_patches(&patches, &PatchFitOptions::default()).unwrap();
    let usages: Vec<PatchUse> = fit.patches.iter().map(|patch| patch.usage).collect();
    assert_eq!(usages[..2], [PatchUse::BlackClipped; 2]);
    assert_eq!(usages[2..6], [PatchUse::Fitted; 4]);
    assert_eq!(usages[6..], [PatchUse::Saturated; 2]);
    let (black, saturation) = (fit.response.black_clip_code(), fit.response.saturation_code());
    assert!((180..=186).contains(&black) && (994..=1000).contains(&saturation), "{black} {saturation}");
    assert!(worst_ratio(&fit.response, &model, 190..=990) < 0.02);
    // A single saturated patch cannot be found by comparison with another, but by the largest code of 12
    // bits.
    let bright = [0.01, 1.0, 100.0, 1e7].map(|l| patch(&logarithmic(), l, 1.0, &mut noise));
    let fit = fit_patches(&bright, &PatchFitOptions::default()).unwrap();
    assert_eq!((fit.patches[3].usage, fit.response.saturation_code()), (PatchUse::Saturated, 4095));
}

#[test]
fn linear_and_companded_sensors_are_told_by_the_patches() {
    let mut noise = Noise(9);
    let linear = ResponseModel::Linear { black_level: 64, white_level: 4095, gain: 0.25 };
    let patches = [5.0, 20.0, 60.0, 180.0, 500.0, 950.0].map(|l| patch(&linear, l, 3.0, &mut noise));
    let fit = fit_patches(&patches, &PatchFitOptions::default()).unwrap();
    assert_eq!(fit.family, Family::Linear);
    let ResponseModel::Linear { black_level, gain, .. } = *fit.response.model() else { panic!() };
    assert!(black_level.abs_diff(64) <= 1 && (gain / 0.25 - 1.0).abs() < 0.005, "{black_level} {gain}");

    let companded =
        ResponseModel::PiecewiseLinear { knees: vec![(0, 0.0), (1024, 10.0), (2048, 160.0), (4095, 4000.0)] };
    // Patches are close together where the slope changes.
    let luminances =
        [1.0, 2.0, 4.0, 7.0, 9.0, 11.0, 16.0, 30.0, 60.0, 110.0, 150.0, 170.0, 260.0, 450.0, 1200.0, 3000.0];
    let patches = luminances.map(|l| patch(&companded, l, 1.0, &mut noise));
    let fit = fit_patches(&patches, &PatchFitOptions::default()).unwrap();
    assert_eq!(fit.family, Family::PiecewiseLinear);
    let options = PatchFitOptions {
        knee_codes: vec![1024, 2048],
        black_code: Some(0),
        saturation_code: Some(4095),
        ..PatchFitOptions::default()
    };
    let fit = fit_patches(&patches, &options).unwrap();
    assert!(worst_ratio(&fit.response, &companded, 100..=4090) < 0.02);
}

#[test]
fn what_tells_nothing_is_refused_with_what_to_do() {
    let mut noise = Noise(3);
    let mut made = |luminances: &[f64]| -> Vec<Patch> {
        luminances.iter().map(|&l| patch(&logarithmic(), l, 1.0, &mut noise)).collect()
    };
    let failure =
        |patches: &[Patch], options: &PatchFitOptions| fit_patches(patches, options).unwrap_err().to_string();
    let plain = PatchFitOptions::default();
    assert!(failure(&made(&[1e6, 1e7, 1e8]), &plain).contains("all have one code"));
    assert!(failure(&made(&[1.0, 10.0, 1e7, 1e8]), &plain).contains("2 saturated"));
    assert!(failure(&made(&[1.0, 10.0]), &plain).contains("at least 3 are needed"));
    assert!(failure(&made(&[5.0, 5.0, 5.0, 5.0]), &plain).contains("the same luminance"));
    assert!(failure(&[], &plain).contains("at least 3 are needed"));
    let mut upside_down = made(&[1.0, 10.0, 100.0]);
    upside_down[0].luminance_cd_m2 = 1000.0;
    assert!(failure(&upside_down, &plain).contains("do not rise"));
    upside_down[0].luminance_cd_m2 = 0.0;
    assert!(failure(&upside_down, &plain).contains("positive number"));
    let knees = PatchFitOptions { knee_codes: vec![100, 150, 4000], ..PatchFitOptions::default() };
    assert!(failure(&made(&[1.0, 10.0, 100.0]), &knees).contains("a patch between any two knees"));
    let wrong = PatchFitOptions { black_code: Some(900), saturation_code: Some(10), ..plain };
    assert!(failure(&made(&[1.0, 10.0, 100.0]), &wrong).contains("the wrong way round"));
}
