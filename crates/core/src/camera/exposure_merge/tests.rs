use super::*;
use crate::camera::ResponseModel;
use crate::error::Kind;

fn linear() -> Response {
    Response::new(ResponseModel::Linear { black_level: 16, white_level: 1023, gain: 1e-3 }).unwrap()
}

fn frame(codes: Vec<u16>, channels: usize) -> Frame {
    let width = codes.len() / channels;
    Frame { width, height: 1, channels, pixels: Pixels::Codes(codes), ..Frame::default() }
}

fn merged(merge: &mut ExposureMerge, frames: &[Frame]) -> (Vec<f32>, MergeCounts) {
    frames.iter().enumerate().for_each(|(index, frame)| merge.add(frame, index).unwrap());
    let mut out = Frame::default();
    let counts = merge.finish(&mut out).unwrap();
    let Pixels::Radiance(values) = out.pixels else { panic!("codes") };
    (values, counts)
}

#[test]
fn radiance_over_five_decades_comes_back_within_a_code_of_the_best_exposure() {
    let response = linear();
    // The exposures are not sorted by their times.
    let times = [0.01, 1.0, 0.1];
    let radiances: Vec<f32> = (0..400).map(|n| 10f32.powf(-1.5 + 3.4 * n as f32 / 399.0)).collect();
    let frames = times.map(|time| {
        frame(radiances.iter().map(|radiance| response.encode(radiance * time as f32)).collect(), 1)
    });
    let mut merge = ExposureMerge::new(&response, &times, &SensorNoise::default()).unwrap();
    let (values, counts) = merged(&mut merge, &frames);
    assert_eq!(counts, MergeCounts::default());
    for (value, radiance) in values.iter().zip(&radiances) {
        // Each exposure is off by half a code of 1e-3 at most. Weights grow with the time (photon noise) or
        // its square (read noise); where they grow the least, the mean is off by half a code times n / (t1 +
        // ... + tn).
        let codes = |time: f64| 16.0 + f64::from(*radiance) * time * 1e3;
        let telling: Vec<f64> =
            times.iter().copied().filter(|&time| (16.5..950.0).contains(&codes(time))).collect();
        let most = 0.5e-3 * telling.len() as f64 / telling.iter().sum::<f64>() + 1e-6 * f64::from(*radiance);
        assert!(f64::from((value - radiance).abs()) <= most, "{radiance}: {value}");
    }
}

#[test]
fn what_no_exposure_measures_is_counted_and_has_the_limit() {
    let times = [1.0, 1e-5];
    let mut merge = ExposureMerge::new(&linear(), &times, &SensorNoise::default()).unwrap();
    // The first samples are saturated in both exposures, black in both, and too bright for the one and too
    // dark for the other; the last two are measured by one each.
    let long = frame(vec![1023, 16, 1023, 516, 2000], 1);
    let short = frame(vec![1050, 3, 16, 16, 516], 1);
    let (values, counts) = merged(&mut merge, &[long, short]);
    assert_eq!(counts, MergeCounts { saturated: 1, black_clipped: 1, between: 1 });
    let expected = [1.007e5, 0.0, 1.007, 0.5, 0.5e5];
    for (value, expected) in values.iter().zip(expected) {
        assert!((value - expected).abs() <= 1e-5 * expected, "{values:?}");
    }
    // A sensor whose black level still stands for some light: the sample gets the geometric mean of the
    // limits.
    let model = ResponseModel::Logarithmic { a: 500.0, b: 60.0, black_clip_code: 20, saturation_code: 1000 };
    let response = Response::new(model).unwrap();
    let mut merge = ExposureMerge::new(&response, &times, &SensorNoise::default()).unwrap();
    let (values, counts) = merged(&mut merge, &[frame(vec![1000, 20], 1), frame(vec![20, 20], 1)]);
    assert_eq!((counts.between, counts.black_clipped), (1, 1));
    let limits = (500.0f64 / 60.0).exp() * (-8.0f64).exp() / 1e-5;
    assert!((f64::from(values[0]) / limits.sqrt() - 1.0).abs() < 1e-5);
    assert!((f64::from(values[1]) / (-8.0f64).exp() - 1.0).abs() < 1e-5);
}

#[test]
fn a_pixel_counts_once_and_the_mean_is_weighted_by_noise() {
    let times = [1.0, 0.1];
    let noise = SensorNoise { read_codes: 1.0, full_well_electrons: 1e12 };
    let mut merge = ExposureMerge::new(&linear(), &times, &noise).unwrap();
    let (values, counts) = merged(
        &mut merge,
        &[frame(vec![1023, 1023, 116, 1, 1, 1], 3), frame(vec![1023, 16, 16, 1, 1, 1], 3)],
    );
    assert_eq!(counts, MergeCounts { saturated: 1, black_clipped: 1, between: 0 });
    assert!((values[2] - 0.1).abs() < 1e-6);
    // With read noise of one code alone, the longer exposure has a hundred times the weight.
    let (values, _) = merged(&mut merge, &[frame(vec![116], 1), frame(vec![36], 1)]);
    assert!((values[0] - (100.0 * 0.1 + 0.2) / 101.0).abs() < 1e-5, "{values:?}");
}

#[test]
fn cycles_that_lack_a_frame_or_mix_sizes_are_refused() {
    let mut merge = ExposureMerge::new(&linear(), &[1.0, 0.1], &SensorNoise::default()).unwrap();
    let mut out = Frame { width: 9, ..Frame::default() };
    merge.add(&frame(vec![100, 100], 1), 1).unwrap();
    let errors = [
        merge.add(&frame(vec![100, 100], 1), 1).unwrap_err(),
        merge.add(&frame(vec![100], 1), 0).unwrap_err(),
        merge.add(&frame(vec![100, 100], 1), 2).unwrap_err(),
        merge.finish(&mut out).unwrap_err(),
        merge.add(&Frame { pixels: Pixels::Radiance(vec![1.0]), ..Frame::default() }, 0).unwrap_err(),
    ];
    let parts = [
        "came twice",
        "first frame is 2 x 1 x 1",
        "not one of the cycle's 2",
        "lacks the exposures [0]",
        "raw codes",
    ];
    for (error, part) in errors.iter().zip(parts) {
        assert_eq!(error.kind(), Kind::BadFrame);
        assert!(error.to_string().contains(part), "{error}");
    }
    assert_eq!(out.width, 9);
    // After that the next cycle is not affected.
    let (values, _) = merged(&mut merge, &[frame(vec![516], 1), frame(vec![66], 1)]);
    assert!((values[0] - 0.5).abs() < 1e-3);
}

#[test]
fn settings_that_cannot_be_merged_are_refused() {
    let failure = |response: &Response, times: &[f64], noise: &SensorNoise| {
        ExposureMerge::new(response, times, noise).unwrap_err().to_string()
    };
    let usual = SensorNoise::default();
    assert!(failure(&Response::default(), &[1.0, 0.1], &usual).starts_with("response: exposures of raw"));
    assert!(failure(&linear(), &[1.0], &usual).starts_with("exposures_s: 1 exposures"));
    assert!(failure(&linear(), &[1.0, f64::NAN], &usual).starts_with("exposures_s[1] = NaN: must be"));
    assert!(failure(&linear(), &[1.0, 0.5, 1.0], &usual).starts_with("exposures_s[2] = 1: is there twice"));
    assert!(failure(&linear(), &[1.0, 1e-39], &usual).contains("more than a float holds"));
    let silent = SensorNoise { read_codes: 0.0, ..usual };
    assert!(failure(&linear(), &[1.0, 0.1], &silent).starts_with("noise.read_codes = 0: must be"));
}
