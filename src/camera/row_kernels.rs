//! The inner loops of [`super::FrameToPolar`], over one row of a frame.
//!
//! Portable code on arrays of lanes, compiled for several instruction sets and chosen at run time. Products and
//! sums are written apart (no fused multiply-add), so every instruction set gives the same bits.

use super::PixelCounts;
use multiversion::multiversion;

/// Weights per chunk of a run; the last chunk is filled up with weights of zero. Four, because a run is about as
/// long as a map pixel is wide in the frame, which is often 3 to 10 pixels: longer chunks would be mostly fill.
pub(super) const LANES: usize = 4;

/// Chunks per run at most. A lane then adds 64 products of f32 and the lanes three sums, in all less than
/// 70 roundings of 2^-24 = 4e-6 of a sum of positive numbers; runs are summed in f64.
pub(super) const CHUNKS_MAX: usize = 64;

/// Consecutive pixels of one row that overlap the same map pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Run {
    /// Map pixel.
    pub(super) cell: u32,
    /// First column in the frame.
    pub(super) start: u16,
    /// Number of [`LANES`] weights.
    pub(super) chunks: u16,
}

/// How many of a row's runs have one chunk and how many two; they come in this order, before the longer ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ShortRuns {
    pub(super) of_one: usize,
    pub(super) of_two: usize,
}

/// `sums[run.cell] += weights . radiance[run.start..]` for every run; the weights of the runs follow one
/// another. Runs of one and two chunks have loops of their own: the length of a run is hard to foresee for the
/// processor, and a wrong guess costs more than the run.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
pub(super) fn add_runs(runs: &[Run], short: ShortRuns, weights: &[f32], radiance: &[f32], sums: &mut [f64]) {
    add_runs_body(runs, short, weights, radiance, sums);
}

#[inline(always)]
fn add_runs_body(runs: &[Run], short: ShortRuns, weights: &[f32], radiance: &[f32], sums: &mut [f64]) {
    let (of_one, runs) = runs.split_at(short.of_one);
    let (of_two, longer) = runs.split_at(short.of_two);
    let (own, weights) = weights.split_at(LANES * of_one.len());
    add_runs_of::<LANES>(of_one, own, radiance, sums);
    let (own, weights) = weights.split_at(2 * LANES * of_two.len());
    add_runs_of::<{ 2 * LANES }>(of_two, own, radiance, sums);
    let mut weights = weights;
    for run in longer {
        let (own, rest) = weights.split_at(LANES * usize::from(run.chunks));
        weights = rest;
        let pixels = &radiance[usize::from(run.start)..][..own.len()];
        sums[run.cell as usize] += product(own, pixels);
    }
}

#[inline(always)]
fn add_runs_of<const LENGTH: usize>(runs: &[Run], weights: &[f32], radiance: &[f32], sums: &mut [f64]) {
    for (run, own) in runs.iter().zip(weights.as_chunks::<LENGTH>().0) {
        let start = usize::from(run.start);
        sums[run.cell as usize] += product(own, &radiance[start..start + LENGTH]);
    }
}

/// The scalar product, in four lanes.
#[inline(always)]
fn product(weights: &[f32], pixels: &[f32]) -> f64 {
    let mut lanes = [0.0f32; LANES];
    for (weights, pixels) in weights.as_chunks::<LANES>().0.iter().zip(pixels.as_chunks::<LANES>().0) {
        for lane in 0..LANES {
            lanes[lane] += weights[lane] * pixels[lane];
        }
    }
    f64::from((lanes[0] + lanes[2]) + (lanes[1] + lanes[3]))
}

/// Raw codes of pixels with `channels` interleaved channels to radiance, one plane per channel (`stride` apart).
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
pub(super) fn decode_codes(
    codes: &[u16],
    channels: usize,
    (table, black_clip_code): (&[f32], u16),
    planes: &mut [f32],
    stride: usize,
) -> PixelCounts {
    match channels {
        1 => decode_codes_body::<1>(codes, table, black_clip_code, planes, stride),
        _ => decode_codes_body::<3>(codes, table, black_clip_code, planes, stride),
    }
}

#[inline(always)]
fn decode_codes_body<const CHANNELS: usize>(
    codes: &[u16],
    table: &[f32],
    black_clip_code: u16,
    planes: &mut [f32],
    stride: usize,
) -> PixelCounts {
    let pixels = codes.as_chunks::<CHANNELS>().0;
    let top = (table.len() - 1) as u16;
    // Counting is a loop of its own: it has no look-up and runs in vectors. A row has fewer than 2^16 pixels.
    let (mut saturated, mut black_clipped) = (0u32, 0u32);
    for pixel in pixels {
        saturated += u32::from(pixel.iter().fold(false, |any, &code| any | (code >= top)));
        black_clipped += u32::from(pixel.iter().fold(false, |any, &code| any | (code <= black_clip_code)));
    }
    for channel in 0..CHANNELS {
        let plane = &mut planes[channel * stride..][..pixels.len()];
        for (radiance, pixel) in plane.iter_mut().zip(pixels) {
            *radiance = table[usize::from(pixel[channel].min(top))];
        }
    }
    PixelCounts { saturated: saturated.into(), black_clipped: black_clipped.into(), ..PixelCounts::default() }
}

/// Radiance of pixels with `channels` interleaved channels to planes, without what is no radiance.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
pub(super) fn decode_radiance(
    samples: &[f32],
    channels: usize,
    planes: &mut [f32],
    stride: usize,
) -> PixelCounts {
    match channels {
        1 => decode_radiance_body::<1>(samples, planes, stride),
        _ => decode_radiance_body::<3>(samples, planes, stride),
    }
}

#[inline(always)]
fn decode_radiance_body<const CHANNELS: usize>(
    samples: &[f32],
    planes: &mut [f32],
    stride: usize,
) -> PixelCounts {
    let pixels = samples.as_chunks::<CHANNELS>().0;
    let (mut nan, mut infinite, mut negative) = (0u32, 0u32, 0u32);
    for pixel in pixels {
        nan += u32::from(pixel.iter().fold(false, |any, value| any | value.is_nan()));
        infinite += u32::from(pixel.iter().fold(false, |any, &value| any | (value == f32::INFINITY)));
        // Minus infinity is below zero.
        negative += u32::from(pixel.iter().fold(false, |any, &value| any | (value < 0.0)));
    }
    for channel in 0..CHANNELS {
        let plane = &mut planes[channel * stride..][..pixels.len()];
        for (radiance, pixel) in plane.iter_mut().zip(pixels) {
            let value = pixel[channel];
            *radiance = if value > 0.0 && value < f32::INFINITY { value } else { 0.0 };
        }
    }
    PixelCounts {
        nan: nan.into(),
        infinite: infinite.into(),
        negative: negative.into(),
        ..PixelCounts::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in [0, 1) without a pattern.
    fn noise(index: usize) -> f32 {
        (index as u32).wrapping_mul(2_654_435_769).rotate_left(7).wrapping_mul(0x85eb_ca6b) as f32
            / 4_294_967_296.0
    }

    #[test]
    fn chosen_instruction_set_gives_the_bits_of_the_plain_code() {
        let mut runs = Vec::new();
        for index in 0..500 {
            runs.push(Run {
                cell: (index * 7 % 90) as u32,
                start: (index * 13 % 700) as u16,
                chunks: 1 + (index % 9) as u16,
            });
        }
        runs.sort_by_key(|run| run.chunks);
        let count = |chunks| runs.iter().filter(|run| run.chunks == chunks).count();
        let short = ShortRuns { of_one: count(1), of_two: count(2) };
        let weights: Vec<f32> =
            (0..runs.iter().map(|run| LANES * usize::from(run.chunks)).sum()).map(noise).collect();
        let radiance: Vec<f32> = (0..800).map(|index| noise(index + 77) * 1e3).collect();
        let (mut chosen, mut plain) = (vec![0.0; 90], vec![0.0; 90]);
        add_runs(&runs, short, &weights, &radiance, &mut chosen);
        add_runs_body(&runs, short, &weights, &radiance, &mut plain);
        assert_eq!(chosen, plain);
        // And both are the sum that is meant.
        let (mut exact, mut rest) = (vec![0.0f64; 90], weights.as_slice());
        for run in &runs {
            for pixel in 0..LANES * usize::from(run.chunks) {
                exact[run.cell as usize] +=
                    f64::from(rest[pixel]) * f64::from(radiance[usize::from(run.start) + pixel]);
            }
            rest = &rest[LANES * usize::from(run.chunks)..];
        }
        for (sum, exact) in chosen.iter().zip(&exact) {
            assert!(*exact > 0.0 && (sum / exact - 1.0).abs() < 1e-6, "{sum} {exact}");
        }

        let table: Vec<f32> = (0..1000).map(|code| code as f32 * 0.5).collect();
        let codes: Vec<u16> = (0..999).map(|index| (noise(index) * 1100.0) as u16).collect();
        let samples: Vec<f32> = (0..999)
            .map(|index| match index % 50 {
                7 => f32::NAN,
                8 => f32::INFINITY,
                9 => -1.0,
                10 => f32::NEG_INFINITY,
                _ => noise(index),
            })
            .collect();
        for channels in [1, 3] {
            let (mut chosen, mut plain) = (vec![0.0; 3 * 999], vec![0.0; 3 * 999]);
            let counts = decode_codes(&codes, channels, (&table, 40), &mut chosen, 999);
            let expected = match channels {
                1 => decode_codes_body::<1>(&codes, &table, 40, &mut plain, 999),
                _ => decode_codes_body::<3>(&codes, &table, 40, &mut plain, 999),
            };
            assert_eq!((counts, &chosen), (expected, &plain));
            assert!(counts.saturated > 0 && counts.black_clipped > 0);
            let counts = decode_radiance(&samples, channels, &mut chosen, 999);
            let expected = match channels {
                1 => decode_radiance_body::<1>(&samples, &mut plain, 999),
                _ => decode_radiance_body::<3>(&samples, &mut plain, 999),
            };
            assert_eq!((counts, &chosen), (expected, &plain));
            assert!(counts.nan > 0 && counts.infinite > 0 && counts.negative > 0);
        }
    }

    #[test]
    fn a_pixel_of_three_channels_counts_once() {
        let table: Vec<f32> = (0..=100).map(|code| code as f32).collect();
        let codes = [100, 100, 5, 200, 0, 0, 50, 50, 50];
        let mut planes = vec![0.0; 9];
        let counts = decode_codes(&codes, 3, (&table, 2), &mut planes, 3);
        assert_eq!((counts.saturated, counts.black_clipped), (2, 1));
        assert_eq!(planes, [100.0, 100.0, 50.0, 100.0, 0.0, 50.0, 5.0, 0.0, 50.0]);
        let samples = [f32::NAN, f32::NAN, -1.0, 1.0, f32::INFINITY, f32::NEG_INFINITY, 1.0, 2.0, 3.0];
        let counts = decode_radiance(&samples, 3, &mut planes, 3);
        assert_eq!((counts.nan, counts.infinite, counts.negative), (1, 1, 2));
        assert_eq!(planes, [0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0]);
    }
}
