//! How far a picture is from its reference (METHODS section 9, *image*).

use crate::picture::{PIXELS_PER_DEGREE, ToneCurve, flip, linear_from_srgb8};

/// RMS difference of linear radiance over the pixels that show a surface in the reference, and over the three
/// channels, relative to the mean of the reference over the same pixels.
///
/// Pixels are linear RGB and the share that shows a surface. Without surfaces 0; against a black reference 0
/// for a black picture and infinite for any other.
///
/// # Panics
/// When the pictures are not of one size.
pub fn relative_rms(reference: &[[f32; 4]], test: &[[f32; 4]]) -> f64 {
    assert_eq!(reference.len(), test.len(), "both pictures are of one size");
    let (mut squares, mut sum, mut count) = (0.0, 0.0, 0u64);
    for (reference, test) in reference.iter().zip(test).filter(|(reference, _)| reference[3] > 0.0) {
        for channel in 0..3 {
            let (expected, found) = (f64::from(reference[channel]), f64::from(test[channel]));
            squares += (found - expected).powi(2);
            sum += expected;
            count += 1;
        }
    }
    if squares == 0.0 {
        return 0.0;
    }
    if sum > 0.0 { (squares / count as f64).sqrt() / (sum / count as f64) } else { f64::INFINITY }
}

/// Mean FLIP over the pixels that show a surface in the reference; pixels as for [`relative_rms`], in rows of
/// `width`. Both pictures are mapped to 8-bit sRGB by the tone curve that suits the reference: individual
/// curves would hide differences in brightness. Without surfaces 0.
///
/// # Panics
/// When the pictures are not of one size or `width` does not divide it.
pub fn mean_flip(reference: &[[f32; 4]], test: &[[f32; 4]], width: usize) -> f64 {
    let rgb = |pixels: &[[f32; 4]]| pixels.iter().map(|&[r, g, b, _]| [r, g, b]).collect::<Vec<_>>();
    let [colours, test] = [reference, test].map(rgb);
    let is_surface = |at: usize| reference[at][3] > 0.0;
    let surfaces = || (0..reference.len()).filter(|&at| is_surface(at));
    let curve = ToneCurve::for_pixels(surfaces().map(|at| &colours[at]));
    let [seen, test] = [colours, test]
        .map(|pixels| pixels.iter().map(|&pixel| linear_from_srgb8(curve.apply(pixel))).collect::<Vec<_>>());
    let error = flip(&seen, &test, width, PIXELS_PER_DEGREE);
    let count = surfaces().count();
    let sum: f64 = surfaces().map(|at| f64::from(error.map[at])).sum();
    if count == 0 { 0.0 } else { sum / count as f64 }
}

/// The middle value, or the upper of the two middle ones for an even number; `None` for no values.
#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::stills::geometric_mean;

    fn grey(value: f32) -> [f32; 4] {
        [value, value, value, 1.0]
    }

    #[test]
    fn rms_is_relative_to_the_mean_of_the_surfaces() {
        // Differences 1 and -3 in all channels: sqrt((1 + 9) / 2) over a mean of 4. The sky does not count.
        let (reference, test) = ([grey(2.0), grey(6.0), [0.0; 4]], [grey(3.0), grey(3.0), [9.0; 4]]);
        assert!((relative_rms(&reference, &test) - 5f64.sqrt() / 4.0).abs() < 1e-12);
        // One channel of three: a third of the square, a third of the sum.
        let (reference, test) = ([[3.0, 0.0, 0.0, 1.0]], [[4.0, 0.0, 0.0, 1.0]]);
        assert!((relative_rms(&reference, &test) - (1.0f64 / 3.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn pictures_without_light_or_surface_have_an_error_too() {
        assert_eq!(relative_rms(&[], &[]), 0.0);
        assert_eq!(relative_rms(&[[0.0; 4]], &[grey(1.0)]), 0.0, "no surface");
        assert_eq!(relative_rms(&[grey(0.0)], &[grey(0.0)]), 0.0);
        assert_eq!(relative_rms(&[grey(0.0)], &[grey(1.0)]), f64::INFINITY);
        assert_eq!(mean_flip(&[], &[], 0), 0.0);
        assert_eq!(mean_flip(&[[0.0; 4]], &[grey(1.0)], 1), 0.0);
        assert_eq!(mean_flip(&[grey(0.0)], &[grey(0.0)], 1), 0.0);
    }

    #[test]
    fn both_pictures_have_the_exposure_of_the_reference() {
        let picture =
            |scale: f32| -> Vec<[f32; 4]> { (0..64).map(|i| grey(scale * (1.0 + (i % 8) as f32))).collect() };
        assert_eq!(mean_flip(&picture(1.0), &picture(1.0), 8), 0.0);
        let (slight, strong) =
            (mean_flip(&picture(1.0), &picture(1.1), 8), mean_flip(&picture(1.0), &picture(2.0), 8));
        assert!(0.0 < slight && slight < 0.5 * strong, "{slight} {strong}");
        // The absolute brightness does not matter.
        assert!((mean_flip(&picture(1e4), &picture(2e4), 8) / strong - 1.0).abs() < 0.02);
    }

    #[test]
    fn the_sky_does_not_count() {
        let (reference, test) = (vec![grey(1.0); 64], vec![grey(2.0); 64]);
        let alone = mean_flip(&reference, &test, 8);
        let beside = |picture: &[[f32; 4]], sky: f32| {
            let far = [[sky, sky, sky, 0.0]; 64];
            [picture, &[[0.0; 4]; 576], &far].concat()
        };
        // There is ten times as much sky as surface; the edge between them is one more difference.
        let with_sky = mean_flip(&beside(&reference, 0.0), &beside(&test, 0.0), 8);
        assert!((alone..1.5 * alone).contains(&with_sky), "{with_sky} {alone}");
        // Nor do differences within the sky count.
        assert_eq!(mean_flip(&beside(&reference, 0.0), &beside(&reference, 1.0), 8), 0.0);
    }

    #[test]
    fn means_are_geometric() {
        assert!((geometric_mean([0.01, 0.0001]) - 0.001).abs() < 1e-15);
        assert_eq!((geometric_mean([0.0, 4.0]), geometric_mean([])), (0.0, 0.0));
    }
}
