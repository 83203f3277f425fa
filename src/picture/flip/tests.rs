use super::*;

const WIDTH: usize = 96;
const HEIGHT: usize = 64;
const DISTANT: f64 = 20.0;

/// One value of reproducible noise for every pixel, channel and seed.
fn noise(seed: u32, x: usize, y: usize, channel: usize) -> usize {
    let mut value = (x as u32 + 4096 * y as u32 + 16_777_216 * channel as u32) ^ seed;
    for factor in [0x9E37_79B1u32, 0x85EB_CA77] {
        value = value.wrapping_mul(factor);
        value ^= value >> 15;
    }
    (value >> 8 & 255) as usize
}

fn gradient(x: usize, y: usize, channel: usize) -> usize {
    [x * 255 / 95, y * 255 / 63, 255 - x * 255 / 95][channel]
}

fn in_disc(x: usize, y: usize) -> bool {
    x.abs_diff(48).pow(2) + y.abs_diff(30).pow(2) < 400
}

/// A picture by formula: 8-bit value of a pixel (x, y) and channel.
type Formula = fn(usize, usize, usize) -> usize;

fn picture(formula: Formula) -> Vec<[f32; 3]> {
    (0..WIDTH * HEIGHT)
        .map(|i| linear_from_srgb8([0, 1, 2].map(|c| formula(i % WIDTH, i / WIDTH, c) as u8)))
        .collect()
}

struct Case {
    name: &'static str,
    reference: Formula,
    test: Formula,
    /// Mean and the error of pixel (30, 20) by the reference implementation at [`PIXELS_PER_DEGREE`] ...
    near: [f64; 2],
    /// ... and at [`DISTANT`].
    distant: [f64; 2],
}

/// Results of `flip-evaluator` 1.7 from PyPI for the same pictures; tests/flip/reference.py prints them.
const CASES: [Case; 8] = [
    Case {
        name: "black and white",
        reference: |_, _, _| 0,
        test: |_, _, _| 255,
        near: [0.967_388_3, 0.967_388_3],
        distant: [0.967_391_3, 0.967_391_3],
    },
    Case {
        name: "green and blue",
        reference: |_, _, c| if c == 1 { 255 } else { 0 },
        test: |_, _, c| if c == 2 { 255 } else { 0 },
        near: [1.0, 1.0],
        distant: [1.0, 1.0],
    },
    Case {
        name: "two noises",
        reference: |x, y, c| noise(1, x, y, c),
        test: |x, y, c| noise(2, x, y, c),
        near: [0.338_373_2, 0.263_952_6],
        distant: [0.835_761_3, 0.579_758_7],
    },
    Case {
        name: "gradient, coarser",
        reference: gradient,
        test: |x, y, c| gradient(x, y, c) / 16 * 16,
        near: [0.189_573_5, 0.172_804_2],
        distant: [0.216_376_8, 0.173_578_8],
    },
    Case {
        name: "gradient, with noise",
        reference: gradient,
        test: |x, y, c| (gradient(x, y, c) * 3 + noise(3, x, y, c)) / 4,
        near: [0.373_442_7, 0.275_033_0],
        distant: [0.459_233_3, 0.449_805_7],
    },
    Case {
        name: "edges, shifted by a pixel",
        reference: |x, y, _| 40 + 180 * ((x / 11 + y / 9) % 2),
        test: |x, y, _| 40 + 180 * (((x + 1) / 11 + y / 9) % 2),
        near: [0.176_102_8, 0.445_073_2],
        distant: [0.124_179_7, 0.0],
    },
    Case {
        name: "dots, left out",
        reference: |x, y, _| if x % 13 == 5 && y % 17 == 8 { 250 } else { 90 },
        test: |_, _, _| 90,
        near: [0.027_005_8, 0.000_280_4],
        distant: [0.008_671_7, 0.0],
    },
    Case {
        name: "coloured disc, another colour",
        reference: |x, y, c| if in_disc(x, y) { [200, 30, 60][c] } else { 128 },
        test: |x, y, c| if in_disc(x, y) { [180, 60, 40][c] } else { 128 },
        near: [0.060_502_4, 0.130_120_0],
        distant: [0.056_382_2, 0.033_885_9],
    },
];

/// The reference implementation works in f32. Where a few pixels differ and all others are nearly equal, the
/// exponents of 0.7 and 0.5 amplify its rounding to up to 8e-5 of the mean; between pictures that differ
/// everywhere it is below 1e-6.
#[test]
fn agrees_with_the_reference_implementation() {
    for case in &CASES {
        let (reference, test) = (picture(case.reference), picture(case.test));
        for (pixels_per_degree, [mean, pixel]) in [(PIXELS_PER_DEGREE, case.near), (DISTANT, case.distant)] {
            let error = flip(&reference, &test, WIDTH, pixels_per_degree);
            let tolerance =
                if ["two noises", "gradient, coarser", "gradient, with noise"].contains(&case.name) {
                    1e-6
                } else {
                    1e-4
                };
            assert!((error.mean / mean - 1.0).abs() < tolerance, "{}: {} {mean}", case.name, error.mean);
            let found = f64::from(error.map[20 * WIDTH + 30]);
            assert!((found - pixel).abs() < 2e-4, "{}: {found} {pixel}", case.name);
        }
    }
}

#[test]
fn equal_pictures_have_no_error_and_the_order_does_not_matter() {
    for case in &CASES {
        let (reference, test) = (picture(case.reference), picture(case.test));
        let there = flip(&reference, &test, WIDTH, PIXELS_PER_DEGREE);
        assert_eq!(there, flip(&test, &reference, WIDTH, PIXELS_PER_DEGREE));
        assert!(there.map.iter().all(|error| (0.0..=1.0).contains(error)));
        let same = flip(&test, &test, WIDTH, PIXELS_PER_DEGREE);
        assert!(same.mean == 0.0 && same.map.iter().all(|&error| error == 0.0));
    }
}

#[test]
fn green_and_blue_differ_most() {
    let space = ColourSpace::new();
    let largest = space.largest_difference();
    let steps = 6;
    let colours: Vec<DVec3> = (0..steps * steps * steps)
        .map(|i| DVec3::new(f64::from(i % steps), f64::from(i / steps % steps), f64::from(i / steps / steps)))
        .map(|step| hunt_adjusted_lab(space.xyz_from_rgb * (step / f64::from(steps - 1)).powf(2.2)))
        .collect();
    for one in &colours {
        for other in &colours {
            assert!(hyab(*one, *other).powf(COLOUR_EXPONENT) <= largest * (1.0 + 1e-12));
        }
    }
}

#[test]
fn pictures_of_any_shape_and_values_out_of_range_are_defined() {
    assert_eq!(flip(&[], &[], 0, 1.0), FlipError { mean: 0.0, map: Vec::new() });
    // Constant pictures of any shape: the error is only the difference of two colours.
    for (width, height) in [(1, 1), (1, 9), (7, 2)] {
        let (black, white) = (vec![[0.0f32; 3]; width * height], vec![[1.0f32; 3]; width * height]);
        for pixels_per_degree in [1.0, PIXELS_PER_DEGREE, 1000.0] {
            assert!((flip(&black, &white, width, pixels_per_degree).mean - 0.967_38).abs() < 1e-4);
        }
        let odd = vec![[f32::NAN, -1.0, f32::NEG_INFINITY]; width * height];
        assert_eq!(flip(&black, &odd, width, PIXELS_PER_DEGREE).mean, 0.0);
        let bright = vec![[f32::INFINITY, 1.0, 7.0]; width * height];
        assert_eq!(flip(&white, &bright, width, PIXELS_PER_DEGREE).mean, 0.0);
    }
}

#[test]
#[should_panic(expected = "of one size")]
fn pictures_of_two_sizes_are_refused() {
    flip(&[[0.0; 3]; 4], &[[0.0; 3]; 2], 2, PIXELS_PER_DEGREE);
}

#[test]
fn srgb_is_inverted() {
    // IEC 61966-2-1: the ends, the linear part, and code 188, which is half of white.
    let close = |code: u8, linear: f32| (linear_from_srgb8([code; 3])[1] - linear).abs() < 1e-6;
    assert!(close(0, 0.0) && close(255, 1.0) && close(10, 10.0 / 255.0 / 12.92));
    assert!((linear_from_srgb8([188; 3])[0] - 0.5).abs() < 0.003);
}
