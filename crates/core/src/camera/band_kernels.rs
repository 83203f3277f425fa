//! The inner loops of [`super::FrameToPolar`], over one band of a frame's rows.
//!
//! Portable code on arrays of lanes, compiled for several instruction sets and chosen at run time. Products
//! and sums are written apart (no fused multiply-add), so every instruction set gives the same bits.

use super::PixelCounts;
use super::response::CodeLookup;
use glam::Vec4;
use multiversion::multiversion;

/// Weights per chunk; a chunk of fewer pixels is padded with weights of zero. It is four because a map pixel
/// is often only 3 to 10 pixels of the frame wide: longer chunks would be mostly padding.
pub(super) const LANES: usize = 4;

/// Most chunks per sum. A lane then adds 64 products in f32, and adding the lanes takes three more sums: in
/// all fewer than 70 roundings of 2^-24, which is 4e-6 of a sum of positive numbers. From there on sums are
/// f64.
pub(super) const CHUNKS_MAX: usize = 64;

/// Most chunks of a part for which there is a loop of fixed length.
const SHORT: usize = 8;

/// Length of a plane of radiance: every 16-bit number is the start of a chunk in it, so that no bounds check
/// is needed.
pub(super) const PLANE: usize = (1 << 16) + LANES;

/// Parts of map pixels that are sums of the same number of chunks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Group {
    /// Chunks per part.
    pub(super) chunks: u32,
    /// Number of parts.
    pub(super) parts: u32,
}

/// The matrix of one band: parts of map pixels in groups, the parts' chunks one after another.
#[derive(Clone, Copy, Debug)]
pub(super) struct BandMatrix<'a> {
    pub(super) groups: &'a [Group],
    /// Map pixel of every part.
    pub(super) cells: &'a [u32],
    /// First pixel in the band of every chunk.
    pub(super) starts: &'a [u16],
    /// Weights of every chunk.
    pub(super) weights: &'a [Vec4],
}

/// `sums[cell] += weights . radiance` for every part. Parts are grouped by length because otherwise the
/// processor cannot predict a loop's length, and a misprediction costs more than a part.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
pub(super) fn add_band(band: BandMatrix, radiance: &[f32; PLANE], sums: &mut [f64]) {
    add_band_body(band, radiance, sums);
}

#[inline(always)]
fn add_band_body(band: BandMatrix, radiance: &[f32; PLANE], sums: &mut [f64]) {
    let BandMatrix { groups, mut cells, mut starts, mut weights } = band;
    for group in groups {
        let (parts, chunks) = (group.parts as usize, group.chunks as usize);
        let cells = cells.split_off(..parts).unwrap_or_default();
        let starts = starts.split_off(..parts * chunks).unwrap_or_default();
        let weights = weights.split_off(..parts * chunks).unwrap_or_default();
        // Most parts are short; loops of a fixed length have no overhead.
        match chunks {
            1 => add_short::<1>(cells, starts, weights, radiance, sums),
            2 => add_short::<2>(cells, starts, weights, radiance, sums),
            3 => add_short::<3>(cells, starts, weights, radiance, sums),
            4 => add_short::<4>(cells, starts, weights, radiance, sums),
            5 => add_short::<5>(cells, starts, weights, radiance, sums),
            6 => add_short::<6>(cells, starts, weights, radiance, sums),
            7 => add_short::<7>(cells, starts, weights, radiance, sums),
            SHORT => add_short::<SHORT>(cells, starts, weights, radiance, sums),
            _ => {
                let parts = starts.chunks_exact(chunks).zip(weights.chunks_exact(chunks));
                for (&cell, (starts, weights)) in cells.iter().zip(parts) {
                    sums[cell as usize] += product(starts, weights, radiance);
                }
            }
        }
    }
}

#[inline(always)]
fn add_short<const CHUNKS: usize>(
    cells: &[u32],
    starts: &[u16],
    weights: &[Vec4],
    radiance: &[f32; PLANE],
    sums: &mut [f64],
) {
    let parts = starts.as_chunks::<CHUNKS>().0.iter().zip(weights.as_chunks::<CHUNKS>().0);
    for (&cell, (starts, weights)) in cells.iter().zip(parts) {
        sums[cell as usize] += product(starts, weights, radiance);
    }
}

/// The dot product in four lanes. A long part is added up in four such sums, because in a single one each
/// addition would wait for the previous one.
#[inline(always)]
fn product(starts: &[u16], weights: &[Vec4], radiance: &[f32; PLANE]) -> f64 {
    if starts.len() <= SHORT {
        let mut lanes = term(starts[0], weights[0], radiance);
        for (&start, &weights) in starts.iter().zip(weights).skip(1) {
            lanes += term(start, weights, radiance);
        }
        return sum_of_lanes(lanes);
    }
    let (starts_of_four, starts) = starts.as_chunks::<4>();
    let (weights_of_four, weights) = weights.as_chunks::<4>();
    let mut sums = [Vec4::ZERO; 4];
    for (starts, weights) in starts_of_four.iter().zip(weights_of_four) {
        for (sum, (&start, &weights)) in sums.iter_mut().zip(starts.iter().zip(weights)) {
            *sum += term(start, weights, radiance);
        }
    }
    for (sum, (&start, &weights)) in sums.iter_mut().zip(starts.iter().zip(weights)) {
        *sum += term(start, weights, radiance);
    }
    sum_of_lanes((sums[0] + sums[1]) + (sums[2] + sums[3]))
}

#[inline(always)]
fn term(start: u16, weights: Vec4, radiance: &[f32; PLANE]) -> Vec4 {
    weights * Vec4::from_slice(&radiance[usize::from(start)..usize::from(start) + LANES])
}

#[inline(always)]
fn sum_of_lanes(lanes: Vec4) -> f64 {
    f64::from((lanes.x + lanes.z) + (lanes.y + lanes.w))
}

/// Converts raw codes of pixels with `channels` interleaved channels to radiance, one plane per channel
/// ([`PLANE`] apart).
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
pub(super) fn decode_codes(
    codes: &[u16],
    channels: usize,
    lookup: CodeLookup,
    planes: &mut [f32],
) -> PixelCounts {
    match channels {
        1 => decode_codes_body::<1>(codes, lookup, planes),
        _ => decode_codes_body::<3>(codes, lookup, planes),
    }
}

#[inline(always)]
fn decode_codes_body<const CHANNELS: usize>(
    codes: &[u16],
    CodeLookup { radiance: table, black_clip_code, saturation_code }: CodeLookup,
    planes: &mut [f32],
) -> PixelCounts {
    let pixels = codes.as_chunks::<CHANNELS>().0;
    // Counting is a separate loop: it has no look-up and is vectorised with 16-bit lanes, the size of the
    // codes. There are fewer than 2^16 pixels.
    let (mut saturated, mut black_clipped) = (0u16, 0u16);
    for pixel in pixels {
        saturated += u16::from(pixel.iter().fold(false, |any, &code| any | (code >= saturation_code)));
        black_clipped += u16::from(pixel.iter().fold(false, |any, &code| any | (code <= black_clip_code)));
    }
    for channel in 0..CHANNELS {
        let plane = &mut planes[channel * PLANE..][..pixels.len()];
        for (radiance, pixel) in plane.iter_mut().zip(pixels) {
            *radiance = table[usize::from(pixel[channel])];
        }
    }
    PixelCounts { saturated: saturated.into(), black_clipped: black_clipped.into(), ..PixelCounts::default() }
}

/// Converts raw codes of one pixel of every pair (`place` 0 or 1) to radiance: two colours alternate along a
/// row of a mosaic.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
pub(super) fn decode_codes_of_pairs(
    pairs: &[[u16; 2]],
    place: usize,
    lookup: CodeLookup,
    plane: &mut [f32],
) -> PixelCounts {
    match place {
        0 => decode_codes_of_pairs_body::<0>(pairs, lookup, plane),
        _ => decode_codes_of_pairs_body::<1>(pairs, lookup, plane),
    }
}

#[inline(always)]
fn decode_codes_of_pairs_body<const PLACE: usize>(
    pairs: &[[u16; 2]],
    CodeLookup { radiance: table, black_clip_code, saturation_code }: CodeLookup,
    plane: &mut [f32],
) -> PixelCounts {
    let (mut saturated, mut black_clipped) = (0u16, 0u16);
    for pair in pairs {
        saturated += u16::from(pair[PLACE] >= saturation_code);
        black_clipped += u16::from(pair[PLACE] <= black_clip_code);
    }
    for (radiance, pair) in plane[..pairs.len()].iter_mut().zip(pairs) {
        *radiance = table[usize::from(pair[PLACE])];
    }
    PixelCounts { saturated: saturated.into(), black_clipped: black_clipped.into(), ..PixelCounts::default() }
}

/// Copies radiance of pixels with `channels` interleaved channels to planes; values that are NaN, infinite or
/// negative become 0.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
pub(super) fn decode_radiance(
    samples: &[f32],
    channels: usize,
    saturation: f32,
    planes: &mut [f32],
) -> PixelCounts {
    match channels {
        1 => decode_radiance_body::<1>(samples, saturation, planes),
        _ => decode_radiance_body::<3>(samples, saturation, planes),
    }
}

#[inline(always)]
fn decode_radiance_body<const CHANNELS: usize>(
    samples: &[f32],
    saturation: f32,
    planes: &mut [f32],
) -> PixelCounts {
    let pixels = samples.as_chunks::<CHANNELS>().0;
    let (mut saturated, mut nan, mut infinite, mut negative) = (0u32, 0u32, 0u32, 0u32);
    for pixel in pixels {
        let is_saturated = |value: f32| value >= saturation && value < f32::INFINITY;
        saturated += u32::from(pixel.iter().fold(false, |any, &value| any | is_saturated(value)));
        nan += u32::from(pixel.iter().fold(false, |any, value| any | value.is_nan()));
        infinite += u32::from(pixel.iter().fold(false, |any, &value| any | (value == f32::INFINITY)));
        // Minus infinity is below zero.
        negative += u32::from(pixel.iter().fold(false, |any, &value| any | (value < 0.0)));
    }
    for channel in 0..CHANNELS {
        let plane = &mut planes[channel * PLANE..][..pixels.len()];
        for (radiance, pixel) in plane.iter_mut().zip(pixels) {
            let value = pixel[channel];
            *radiance = if value > 0.0 && value < f32::INFINITY { value } else { 0.0 };
        }
    }
    PixelCounts {
        saturated: saturated.into(),
        nan: nan.into(),
        infinite: infinite.into(),
        negative: negative.into(),
        ..PixelCounts::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::noise;

    #[test]
    fn chosen_instruction_set_gives_the_bits_of_the_plain_code() {
        let groups = [1, 2, 3, 7, 64].map(|chunks| Group { chunks, parts: 100 });
        let cells: Vec<u32> = (0..500).map(|part| part * 7 % 90).collect();
        let chunks = groups.iter().map(|group| (group.chunks * group.parts) as usize).sum();
        let starts: Vec<u16> = (0..chunks).map(|chunk| (chunk * 131 % (1 << 16)) as u16).collect();
        let weights: Vec<Vec4> = (0..chunks)
            .map(|chunk| Vec4::from_array(std::array::from_fn(|lane| noise(4 * chunk + lane))))
            .collect();
        let plane: Vec<f32> = (0..PLANE).map(|index| noise(index + 77) * 1e3).collect();
        let radiance: &[f32; PLANE] = plane.as_slice().try_into().unwrap();
        let band = BandMatrix { groups: &groups, cells: &cells, starts: &starts, weights: &weights };
        let (mut chosen, mut plain) = (vec![0.0; 90], vec![0.0; 90]);
        add_band(band, radiance, &mut chosen);
        add_band_body(band, radiance, &mut plain);
        assert_eq!(chosen, plain);
        // Both give the intended sum. Every part is checked by itself, so that larger parts cannot hide an
        // error.
        let mut first = 0;
        for (part, &cell) in cells.iter().enumerate() {
            let group = groups[part / 100];
            let own = first..first + group.chunks as usize;
            first = own.end;
            let exact: f64 = own
                .clone()
                .flat_map(|chunk| (0..LANES).map(move |lane| (chunk, lane)))
                .map(|(chunk, lane)| {
                    f64::from(weights[chunk][lane]) * f64::from(radiance[usize::from(starts[chunk]) + lane])
                })
                .sum();
            let sum = product(&starts[own.clone()], &weights[own], radiance);
            assert!(exact > 0.0 && (sum / exact - 1.0).abs() < 4e-6, "{sum} {exact}");
            plain[cell as usize] -= sum;
        }
        assert_eq!(first, chunks);
        for (left, sum) in plain.iter().zip(&chosen) {
            assert!(left.abs() <= 1e-12 * sum, "{left} {sum}");
        }

        let table = std::array::from_fn(|code| code.min(999) as f32 * 0.5);
        let lookup = CodeLookup { radiance: &table, black_clip_code: 40, saturation_code: 999 };
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
            let (mut chosen, mut plain) = (vec![0.0; 3 * PLANE], vec![0.0; 3 * PLANE]);
            let counts = decode_codes(&codes, channels, lookup, &mut chosen);
            let expected = match channels {
                1 => decode_codes_body::<1>(&codes, lookup, &mut plain),
                _ => decode_codes_body::<3>(&codes, lookup, &mut plain),
            };
            assert_eq!((counts, &chosen), (expected, &plain));
            assert!(counts.saturated > 0 && counts.black_clipped > 0);
            let counts = decode_radiance(&samples, channels, 0.9, &mut chosen);
            let expected = match channels {
                1 => decode_radiance_body::<1>(&samples, 0.9, &mut plain),
                _ => decode_radiance_body::<3>(&samples, 0.9, &mut plain),
            };
            assert_eq!((counts, &chosen), (expected, &plain));
            assert!(counts.nan > 0 && counts.infinite > 0 && counts.negative > 0 && counts.saturated > 0);
        }

        let (pairs, _) = codes.as_chunks::<2>();
        for place in 0..2 {
            // The result is that of a frame of one channel with every second code.
            let own: Vec<u16> = pairs.iter().map(|pair| pair[place]).collect();
            let (mut chosen, mut plain, mut expected) =
                (vec![0.0; PLANE], vec![0.0; PLANE], vec![0.0; PLANE]);
            let counts = decode_codes_of_pairs(pairs, place, lookup, &mut chosen);
            let of_plain = match place {
                0 => decode_codes_of_pairs_body::<0>(pairs, lookup, &mut plain),
                _ => decode_codes_of_pairs_body::<1>(pairs, lookup, &mut plain),
            };
            let of_expected = decode_codes_body::<1>(&own, lookup, &mut expected);
            assert_eq!((counts, of_plain), (of_expected, of_expected));
            assert_eq!((&chosen, &plain), (&expected, &expected));
            assert!(counts.saturated > 0 && counts.black_clipped > 0);
        }
    }

    #[test]
    fn a_pixel_of_three_channels_counts_once() {
        let table = std::array::from_fn(|code| code.min(100) as f32);
        let lookup = CodeLookup { radiance: &table, black_clip_code: 2, saturation_code: 100 };
        let codes = [100, 100, 5, 200, 0, 0, 50, 50, 50];
        let mut planes = vec![0.0; 3 * PLANE];
        let seen = |planes: &[f32]| {
            [0, 1, 2].map(|channel| <[f32; 3]>::try_from(&planes[channel * PLANE..][..3]).unwrap())
        };
        let counts = decode_codes(&codes, 3, lookup, &mut planes);
        assert_eq!((counts.saturated, counts.black_clipped), (2, 1));
        assert_eq!(seen(&planes), [[100.0, 100.0, 50.0], [100.0, 0.0, 50.0], [5.0, 0.0, 50.0]]);
        let samples = [f32::NAN, f32::NAN, -1.0, 1.0, f32::INFINITY, f32::NEG_INFINITY, 1.0, 2.0, 3.0];
        let counts = decode_radiance(&samples, 3, 3.0, &mut planes);
        assert_eq!((counts.nan, counts.infinite, counts.negative, counts.saturated), (1, 1, 2, 1));
        let counts = decode_radiance(&samples, 3, f32::INFINITY, &mut planes);
        assert_eq!(counts.saturated, 0, "none is known");
        assert_eq!(seen(&planes), [[0.0, 1.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 3.0]]);
    }
}
