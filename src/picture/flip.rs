//! Perceived difference between two pictures: LDR-FLIP.
//!
//! P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström and M. D. Fairchild 2020, *FLIP: A
//! Difference Evaluator for Alternating Images* (Proc. ACM Comput. Graph. Interact. Tech. 3, 2, article 15),
//! called the paper below, with its authors' later corrections (research.nvidia.com/publication/flip):
//! luminance is divided by 116, and the mean is the best summary of an error map. An error is the difference
//! that an observer notices when flipping between the two pictures: 0 for none, 1 for the largest possible.
//!
//! It is implemented here because the only crate for it (`nv-flip`) wraps the reference implementation, needs
//! a C++ compiler and has not been released for a long time.
//!
//! | paper | here |
//! |---|---|
//! | p, pixels per degree | `pixels_per_degree` |
//! | Y Cx Cz | [`opponent`], without the constants, which the inverse transform removes again |
//! | S, contrast sensitivity | [`Sensitivity`] |
//! | q_c, p_c, p_t | [`COLOUR_EXPONENT`], [`KNEE`], [`KNEE_ERROR`] |
//! | w, q_f | [`FEATURE_WIDTH_DEG`], [`FEATURE_EXPONENT`] |
//! | delta E_c, delta E_f, delta E | [`colour_error`], [`feature_error`], what [`flip`] returns |

mod filter;
#[cfg(test)]
mod tests;

use filter::{Derivative, Sensitivity, derivative, separable};
use glam::{DMat3, DVec3};
use lightcast_core::math::linear_from_srgb;

/// Pixels per degree for an observer 0.7 m away from a screen that is 0.7 m and 3840 pixels wide, FLIP's own
/// default.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * std::f64::consts::PI / 180.0;

/// Compresses large differences of colour (q_c).
const COLOUR_EXPONENT: f64 = 0.7;
/// The compressed difference of colour, as a fraction of the largest, up to which errors are stretched (p_c)
/// ...
const KNEE: f64 = 0.4;
/// ... and the error there (p_t).
const KNEE_ERROR: f64 = 0.95;
/// Width of an edge that people see well, in degrees of visual angle (w).
const FEATURE_WIDTH_DEG: f64 = 0.082;
/// Stretches small differences of features (q_f).
const FEATURE_EXPONENT: f64 = 0.5;

/// The perceived difference between two pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct FlipError {
    /// Mean of the map; 0 for pictures without pixels.
    pub mean: f64,
    /// Error of every pixel in [0, 1], row by row.
    pub map: Vec<f32>,
}

/// LDR-FLIP between two pictures of `width` columns, linear RGB (Rec. 709) in [0, 1], row by row. Values
/// outside are clamped, NaN is black. 8-bit pictures are converted with [`linear_from_srgb8`]. The error is
/// symmetric.
///
/// # Panics
/// When the pictures differ in size, `width` does not divide it, or `pixels_per_degree` is not in [1, 1000].
pub fn flip(reference: &[[f32; 3]], test: &[[f32; 3]], width: usize, pixels_per_degree: f64) -> FlipError {
    assert_eq!(reference.len(), test.len(), "both pictures are of one size");
    assert!((1.0..=1000.0).contains(&pixels_per_degree), "{pixels_per_degree} pixels per degree");
    if reference.is_empty() {
        return FlipError { mean: 0.0, map: Vec::new() };
    }
    assert!(width > 0 && reference.len().is_multiple_of(width), "{} pixels in {width} columns", test.len());
    let colour_space = ColourSpace::new();
    let [reference, test] =
        [reference, test].map(|pixels| Seen::new(pixels, width, pixels_per_degree, &colour_space));
    let largest = colour_space.largest_difference();
    let errors: Vec<f64> = (0..reference.colours.len())
        .map(|i| {
            let colour = colour_error(reference.colours[i], test.colours[i], largest);
            let feature = feature_error(reference.features[i], test.features[i]);
            // Where features differ, a difference of colour counts more.
            colour.powf(1.0 - feature)
        })
        .collect();
    FlipError {
        mean: errors.iter().sum::<f64>() / errors.len() as f64,
        map: errors.iter().map(|&error| error as f32).collect(),
    }
}

/// Linear RGB of an 8-bit sRGB pixel (IEC 61966-2-1).
pub fn linear_from_srgb8(rgb: [u8; 3]) -> [f32; 3] {
    rgb.map(|code| linear_from_srgb(f32::from(code) / 255.0))
}

/// A picture as an observer perceives it.
struct Seen {
    /// Hunt-adjusted L\*a\*b\* after blurring by the contrast sensitivity of the eye.
    colours: Vec<DVec3>,
    /// Strength of edges and of points.
    features: Vec<[f64; 2]>,
}

impl Seen {
    fn new(pixels: &[[f32; 3]], width: usize, pixels_per_degree: f64, colour_space: &ColourSpace) -> Self {
        let clean = |value: f32| if value > 0.0 { f64::from(value).min(1.0) } else { 0.0 };
        let opponents: Vec<DVec3> = pixels
            .iter()
            .map(|rgb| opponent(colour_space.xyz_from_rgb * DVec3::from_array(rgb.map(clean))))
            .collect();
        let [luminance, red_green, blue_yellow] =
            [0, 1, 2].map(|channel| opponents.iter().map(|value| value[channel]).collect::<Vec<f64>>());

        let blurred = [
            (Sensitivity::LUMINANCE, &luminance),
            (Sensitivity::RED_GREEN, &red_green),
            (Sensitivity::BLUE_YELLOW, &blue_yellow),
        ]
        .map(|(sensitivity, plane)| sensitivity.blur(plane, width, pixels_per_degree));
        let colours = (0..pixels.len())
            .map(|i| colour_space.lab(DVec3::from_array(blurred.each_ref().map(|plane| plane[i]))))
            .collect();

        // Edges and points are found in y, relative luminance, which equals (Y + 16) / 116. The standard
        // deviation is such that the first derivative's lobes are `FEATURE_WIDTH_DEG` apart.
        let deviation_px = 0.5 * FEATURE_WIDTH_DEG * pixels_per_degree;
        let blur = derivative(Derivative::None, deviation_px);
        let strength = |order| {
            let kernel = derivative(order, deviation_px);
            let across = separable(&luminance, width, &kernel, &blur);
            let down = separable(&luminance, width, &blur, &kernel);
            across.into_iter().zip(down).map(|(x, y)| x.hypot(y))
        };
        let features = strength(Derivative::First).zip(strength(Derivative::Second));
        Self { colours, features: features.map(|(edge, point)| [edge, point]).collect() }
    }
}

/// The channels of Y Cx Cz without its constants, which the normalised filters preserve and the inverse
/// transform removes: y, x - y and y - z of XYZ relative to white.
fn opponent(xyz: DVec3) -> DVec3 {
    DVec3::new(xyz.y, xyz.x - xyz.y, xyz.y - xyz.z)
}

/// Linear RGB and XYZ relative to its white (D65).
struct ColourSpace {
    xyz_from_rgb: DMat3,
    rgb_from_xyz: DMat3,
}

impl ColourSpace {
    fn new() -> Self {
        // The primaries (0.64, 0.33), (0.3, 0.6), (0.15, 0.06) and D65 at (0.3127, 0.329), computed exactly.
        let [x, y, z] = [
            DVec3::new(10_135_552.0, 8_788_810.0, 4_435_075.0) / 24_577_794.0,
            DVec3::new(2_613_072.0, 8_788_810.0, 887_015.0) / 12_288_897.0,
            DVec3::new(1_425_312.0, 8_788_810.0, 70_074_185.0) / 73_733_382.0,
        ]
        // Relative to white: each row sums to 1.
        .map(|row| row / row.element_sum());
        let xyz_from_rgb = DMat3::from_cols(x, y, z).transpose();
        Self { xyz_from_rgb, rgb_from_xyz: xyz_from_rgb.inverse() }
    }

    /// Hunt-adjusted L\*a\*b\* of opponent channels, which are first clamped to the gamut.
    fn lab(&self, opponent: DVec3) -> DVec3 {
        let xyz = DVec3::new(opponent.x + opponent.y, opponent.x, opponent.x - opponent.z);
        let rgb = (self.rgb_from_xyz * xyz).clamp(DVec3::ZERO, DVec3::ONE);
        hunt_adjusted_lab(self.xyz_from_rgb * rgb)
    }

    /// The difference between pure green and pure blue, the two colours of the gamut that differ most.
    fn largest_difference(&self) -> f64 {
        let [green, blue] = [DVec3::Y, DVec3::Z].map(|rgb| hunt_adjusted_lab(self.xyz_from_rgb * rgb));
        hyab(green, blue).powf(COLOUR_EXPONENT)
    }
}

/// CIE L\*a\*b\*, a and b scaled by 0.01 L\*: colour counts less where it is dark (Hunt effect).
fn hunt_adjusted_lab(xyz: DVec3) -> DVec3 {
    const DELTA: f64 = 6.0 / 29.0;
    let root = |t: f64| {
        if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let [x, y, z] = xyz.to_array().map(root);
    let lightness = 116.0 * y - 16.0;
    let hunt = 0.01 * lightness;
    DVec3::new(lightness, 500.0 * (x - y) * hunt, 200.0 * (y - z) * hunt)
}

/// The HyAB distance of Abasi et al. 2020, designed for large differences: city-block in lightness, Euclidean
/// in chroma.
fn hyab(one: DVec3, other: DVec3) -> f64 {
    let difference = one - other;
    difference.x.abs() + difference.y.hypot(difference.z)
}

/// Error of a pixel's colour in [0, 1].
fn colour_error(reference: DVec3, test: DVec3, largest: f64) -> f64 {
    let difference = hyab(reference, test).powf(COLOUR_EXPONENT) / largest;
    if difference < KNEE {
        difference * KNEE_ERROR / KNEE
    } else {
        // Rounding may exceed the largest difference by its last bit.
        (KNEE_ERROR + (difference - KNEE) / (1.0 - KNEE) * (1.0 - KNEE_ERROR)).min(1.0)
    }
}

/// Error of a pixel's features in [0, 1]: the larger one of edges and points.
fn feature_error(reference: [f64; 2], test: [f64; 2]) -> f64 {
    let [edge, point] = [0, 1].map(|feature| (reference[feature] - test[feature]).abs());
    (edge.max(point) * std::f64::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT).min(1.0)
}
