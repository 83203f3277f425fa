use super::*;
use crate::files::{exposure_settings, read};
use lightcast_core::camera::{ExposureMerge, SensorNoise};
use lightcast_core::image::{Frame, Pixels};
use lightcast_core::test_data::real_folder;

/// Marsaglia's xorshift64, from -1/2 to 1/2.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }
}

/// An S-curve typical of cameras: the straight foot of sRGB, then a shoulder.
fn ordinary(exposure: f64) -> f64 {
    let x = (1.3 * exposure).clamp(0.0, 1.0);
    let srgb = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    255.0 * (srgb * srgb * (3.0 - 2.0 * srgb)).mul_add(0.5, 0.5 * srgb)
}

/// Gradients over five decades of radiance, 256 x 256 px.
fn picture(code: impl Fn(f64) -> f64, time_s: f64, random: &mut Random) -> Frame {
    let codes = (0..256 * 256)
        .map(|at| {
            let radiance =
                10f64.powf(-2.5 + 5.0 * (at % 256) as f64 / 255.0 + 0.1 * (at / 256) as f64 / 255.0);
            (code(radiance * time_s) + 1.5 * random.next()).round().clamp(0.0, 255.0) as u16
        })
        .collect();
    Frame { width: 256, height: 256, pixels: Pixels::Codes(codes), ..Frame::default() }
}

fn samples(code: impl Fn(f64) -> f64, times_s: &[f64]) -> BracketSamples {
    let mut random = Random(77);
    let mut samples = BracketSamples::default();
    for &time in times_s {
        samples.add(&picture(&code, time, &mut random)).unwrap();
    }
    samples
}

/// Largest deviation of the response from the curve in a range of codes, as a ratio after optimal scaling.
fn worst(fit: &BracketFit, code_of: impl Fn(f64) -> f64, codes: std::ops::Range<u16>) -> f64 {
    let logs: Vec<f64> = codes
        .map(|code| {
            // Bisection finds the exposure of the code.
            let (mut low, mut high) = (1e-9f64, 10.0f64);
            for _ in 0..60 {
                let middle = (low * high).sqrt();
                if code_of(middle) < f64::from(code) { low = middle } else { high = middle }
            }
            (f64::from(fit.response.table()[usize::from(code)]) / low).ln()
        })
        .collect();
    let (least, most) =
        logs.iter().fold((f64::MAX, f64::MIN), |(least, most), &log| (least.min(log), most.max(log)));
    ((most - least) / 2.0).exp() - 1.0
}

const TIMES: [f64; 6] = [8.0, 2.0, 0.5, 0.125, 0.03, 0.008];

#[test]
fn the_curve_of_an_ordinary_camera_comes_back() {
    let fit = fit_bracket(&samples(ordinary, &TIMES), &TIMES, &CodeLimits::default()).unwrap();
    let worst = worst(&fit, ordinary, 10..250);
    assert!(worst < 0.05, "{worst}");
    for (found, time) in fit.recovered_s.iter().zip(TIMES) {
        assert!((found / time - 1.0).abs() < 0.03, "{found} {time}");
    }
    assert!(fit.misfit_stops.iter().all(|misfit| *misfit < 0.2), "{:?}", fit.misfit_stops);
}

#[test]
fn a_linear_camera_comes_back() {
    let linear = |exposure: f64| 255.0 * exposure;
    let fit = fit_bracket(&samples(linear, &TIMES), &TIMES, &CodeLimits::default()).unwrap();
    let worst = worst(&fit, linear, 10..250);
    assert!(worst < 0.05, "{worst}");
}

#[test]
fn a_wrong_time_is_found_by_the_others() {
    let mut wrong = TIMES;
    wrong[2] *= 1.3;
    let fit = fit_bracket(&samples(ordinary, &TIMES), &wrong, &CodeLimits::default()).unwrap();
    let off: Vec<f64> =
        fit.recovered_s.iter().zip(wrong).map(|(found, given)| (found / given).ln()).collect();
    let largest = off.iter().enumerate().max_by(|one, two| one.1.abs().total_cmp(&two.1.abs())).unwrap().0;
    assert_eq!(largest, 2, "{off:?}");
    assert!((fit.recovered_s[2] / TIMES[2] - 1.0).abs() < 0.05, "{:?}", fit.recovered_s);
}

#[test]
fn times_follow_from_a_known_response() {
    let fit = fit_bracket(&samples(ordinary, &TIMES), &TIMES, &CodeLimits::default()).unwrap();
    let other = [0.2, 1.7, 0.05];
    let found = recover_exposures(&samples(ordinary, &other), &fit.response).unwrap();
    for (found, time) in found.iter().zip(other) {
        assert!((found / (time / 0.2) - 1.0).abs() < 0.05, "{found} {time}");
    }
    assert!(recover_exposures(&samples(ordinary, &other), &Response::default()).is_err());
}

#[test]
fn brackets_that_tell_nothing_are_refused_with_what_to_do() {
    let failure = |times: &[f64], given: &[f64], limits: CodeLimits| {
        fit_bracket(&samples(ordinary, times), given, &limits).unwrap_err().to_string()
    };
    let none = CodeLimits::default();
    assert!(failure(&[1.0], &[1.0], none).contains("take at least two"));
    assert!(failure(&[1.0, 0.1], &[1.0], none).contains("give one for each"));
    assert!(failure(&[1.0, 0.1], &[1.0, -0.1], none).contains("positive"));
    assert!(failure(&[1.0, 0.1], &[1.0, 1.0], none).contains("nearly the same exposure time"));
    let apart = failure(&[8.0, 1e-6], &[8.0, 1e-6], none);
    assert!(apart.contains("pictures 1 and 2") && apart.contains("exposures between them"), "{apart}");
    let swapped = CodeLimits { black_code: Some(255), saturation_code: Some(0) };
    assert!(failure(&[1.0, 0.1], &[1.0, 0.1], swapped).contains("no codes between them"));
    let reversed = failure(&[1.0, 0.25, 0.06], &[0.06, 0.25, 1.0], none);
    assert!(reversed.contains("exposure times belong to the pictures"), "{reversed}");
    let mut samples = BracketSamples::default();
    samples.add(&picture(ordinary, 1.0, &mut Random(1))).unwrap();
    let narrow = Frame { width: 2, height: 1, pixels: Pixels::Codes(vec![1, 2]), ..Frame::default() };
    assert!(samples.add(&narrow).unwrap_err().to_string().contains("must be alike"));
    let radiance = Frame { pixels: Pixels::Radiance(vec![1.0, 2.0]), ..narrow };
    assert!(samples.add(&radiance).unwrap_err().to_string().contains("holds radiance"));
}

/// Every third pixel of every third row.
fn thinned(frame: &Frame) -> Frame {
    let Pixels::Codes(codes) = &frame.pixels else { panic!("radiance") };
    let (width, height) = (frame.width / 3, frame.height / 3);
    let pixel = |row: usize, column: usize| {
        let at = (3 * row * frame.width + 3 * column) * frame.channels;
        codes[at..at + frame.channels].iter().copied()
    };
    let codes = (0..height).flat_map(|row| (0..width).flat_map(move |column| pixel(row, column))).collect();
    Frame { width, height, channels: frame.channels, pixels: Pixels::Codes(codes), ..Frame::default() }
}

#[test]
fn the_office_tells_its_exposures_within_five_per_cent_and_merges() {
    let Some(folder) = real_folder("seq/office_fisheye_bracket") else { return };
    let mut samples = BracketSamples::default();
    let (mut frame, mut frames, mut times) = (Frame::default(), Vec::new(), Vec::new());
    for number in [6955, 6958, 6961, 6964, 6967, 6970] {
        let path = folder.join(format!("IMG_{number}.JPG"));
        read(&path, &mut frame).unwrap();
        samples.add(&frame).unwrap();
        frames.push(thinned(&frame));
        times.push(exposure_settings(&path).unwrap().unwrap().time_s);
    }
    let fit = fit_bracket(&samples, &times, &CodeLimits::default()).unwrap();
    for (found, time) in fit.recovered_s.iter().zip(&times) {
        assert!((found / time - 1.0).abs() < 0.05, "{:?}", fit.recovered_s);
    }
    // With a known curve and unknown times, the times relative to the first are found too.
    let found = recover_exposures(&samples, &fit.response).unwrap();
    for pair in 0..5 {
        let (ratio, expected) = (found[pair] / found[pair + 1], times[pair] / times[pair + 1]);
        assert!((ratio / expected - 1.0).abs() < 0.05, "{ratio} {expected}");
    }

    let mut merge = ExposureMerge::new(&fit.response, &times, &SensorNoise::default()).unwrap();
    frames.iter().enumerate().for_each(|(index, frame)| merge.add(frame, index).unwrap());
    let counts = merge.finish(&mut frame).unwrap();
    let Pixels::Radiance(values) = &frame.pixels else { panic!("codes") };
    assert!(values.iter().all(|value| value.is_finite() && *value >= 0.0));
    let pixels = (frame.width * frame.height) as u64;
    assert!(counts.saturated < pixels / 10_000 && counts.between < pixels / 10_000, "{counts:?}");
    // In the middle of the codes each picture equals the merged radiance times its exposure.
    for (frame, time) in frames.iter().zip(&times) {
        let Pixels::Codes(codes) = &frame.pixels else { panic!("radiance") };
        let mut ratios: Vec<f64> = codes
            .iter()
            .zip(values)
            .filter(|(code, _)| (40..=230).contains(*code))
            .map(|(&code, &value)| {
                f64::from(value) * time / f64::from(fit.response.table()[usize::from(code)])
            })
            .collect();
        ratios.sort_by(f64::total_cmp);
        let median = ratios[ratios.len() / 2];
        assert!(ratios.len() > 1000 && (median - 1.0).abs() < 0.05, "{time} s: {median}");
    }
    let brightest = values.iter().fold(0.0f32, |most, &value| most.max(value));
    let shown = fit.response.table()[255] / fit.response.table()[8];
    let darkest = fit.response.table()[8] / times[0] as f32;
    assert!(brightest / darkest > 30.0 * shown, "{brightest} {darkest} {shown}");
}
