use super::CodeLimits;
use crate::error::{Error, Result};
use lightcast_core::image::{Frame, Pixels};

/// The pictures of a bracket, reduced to blocks as they arrive, so that only one picture need be in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BracketSamples {
    /// Columns, rows and channels of the pictures.
    shape: (usize, usize, usize),
    /// For every picture its blocks, row by row, with interleaved channels.
    pictures: Vec<Vec<Block>>,
    max_code: u16,
}

/// One channel of a square of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Block {
    mean: f32,
    spread: f32,
    min: u16,
    max: u16,
}

/// Codes of the samples that the fit uses, by picture; NaN where a picture has no usable code.
pub(super) struct Places {
    pictures: usize,
    codes: Vec<f64>,
    seen: (f64, f64),
}

/// Blocks have this many pixels a side, fewer in small pictures: there should be some ten thousand blocks.
const LARGEST_SIDE_PX: usize = 8;
const WANTED_BLOCKS_A_SIDE: usize = 128;
/// Codes are sorted into `BINS` bins, and from each bin a fixed number of samples is taken in each picture.
const BINS: usize = 256;
const PLACES_A_BIN: usize = 64;
/// The lowest part of the codes holds mostly the camera's noise and its noise reduction: in real pictures it
/// contradicts the rest by a factor of up to two.
const DARKEST_SHARE: f64 = 0.03;

impl BracketSamples {
    /// Adds a picture.
    ///
    /// # Errors
    /// `Usage`: a picture of radiance instead of codes, or of another size than the first.
    pub fn add(&mut self, frame: &Frame) -> Result<()> {
        let Pixels::Codes(codes) = &frame.pixels else {
            return Err(Error::usage(
                "holds radiance, which has no response to find; give the camera's codes (PNG or JPEG)",
            ));
        };
        let shape = (frame.width, frame.height, frame.channels);
        if self.pictures.is_empty() {
            self.shape = shape;
        }
        if shape != self.shape {
            let (width, height, channels) = self.shape;
            return Err(Error::usage(format!(
                "is {} x {} x {}, but the first picture is {width} x {height} x {channels}; a bracket's pictures must be \
                 alike",
                shape.0, shape.1, shape.2
            )));
        }
        let (width, height, channels) = shape;
        let side = (width.min(height) / WANTED_BLOCKS_A_SIDE).clamp(1, LARGEST_SIDE_PX);
        let (columns, rows) = (width / side, height / side);
        let mut blocks = Vec::with_capacity(columns * rows * channels);
        for block_row in 0..rows {
            for block in 0..columns * channels {
                let (column, channel) = (block / channels, block % channels);
                let samples = (block_row * side..(block_row + 1) * side).flat_map(|row| {
                    let start = (row * width + column * side) * channels + channel;
                    codes[start..start + (side - 1) * channels + 1].iter().step_by(channels).copied()
                });
                blocks.push(Block::of(samples, side * side));
            }
        }
        self.max_code = codes.iter().fold(self.max_code, |max, &code| max.max(code));
        self.pictures.push(blocks);
        Ok(())
    }

    /// Number of pictures added so far.
    pub fn pictures(&self) -> usize {
        self.pictures.len()
    }

    /// Black and saturation code.
    pub(super) fn limits(&self, limits: &CodeLimits) -> Result<(u16, u16)> {
        let all_ones = (8..16).step_by(2).map(|bits| (1u16 << bits) - 1).find(|&top| top >= self.max_code);
        let black = limits.black_code.unwrap_or(0);
        let saturation = limits.saturation_code.unwrap_or(all_ones.unwrap_or(u16::MAX));
        if saturation.saturating_sub(black) < 15 {
            return Err(Error::usage(format!(
                "black at code {black} and saturation at code {saturation} leave no codes between them; check them"
            )));
        }
        Ok((black, saturation))
    }

    /// Mean code of a picture.
    pub(super) fn mean(&self, picture: usize) -> f64 {
        let blocks = &self.pictures[picture];
        blocks.iter().map(|block| f64::from(block.mean)).sum::<f64>() / blocks.len().max(1) as f64
    }

    /// Codes of the blocks that are usable in both of two pictures.
    pub(super) fn shared(
        &self,
        one: usize,
        two: usize,
        black: u16,
        saturation: u16,
    ) -> impl Iterator<Item = (f64, f64)> {
        let pairs = self.pictures[one].iter().zip(&self.pictures[two]);
        pairs.filter_map(move |(one, two)| Some((one.code(black, saturation)?, two.code(black, saturation)?)))
    }

    /// Samples that are usable in two or more pictures, chosen so that all codes of all pictures occur.
    pub(super) fn places(&self, black: u16, saturation: u16) -> Places {
        let blocks = self.pictures.first().map_or(0, Vec::len);
        let mut is_chosen = vec![false; blocks];
        let tells = |block: usize| {
            self.pictures.iter().filter(|picture| picture[block].code(black, saturation).is_some()).count()
                >= 2
        };
        for picture in &self.pictures {
            let mut taken = [0; BINS];
            for block in scattered(blocks) {
                let Some(code) = picture[block].code(black, saturation) else { continue };
                let bin = (code - f64::from(black)) / f64::from(saturation - black) * BINS as f64;
                let taken = &mut taken[(bin as usize).min(BINS - 1)];
                if *taken < PLACES_A_BIN && tells(block) {
                    *taken += 1;
                    is_chosen[block] = true;
                }
            }
        }
        let mut places = Places {
            pictures: self.pictures.len(),
            codes: Vec::new(),
            seen: (f64::INFINITY, f64::NEG_INFINITY),
        };
        for block in (0..blocks).filter(|&block| is_chosen[block]) {
            for picture in &self.pictures {
                let code = picture[block].code(black, saturation);
                if let Some(code) = code {
                    places.seen = (places.seen.0.min(code), places.seen.1.max(code));
                }
                places.codes.push(code.unwrap_or(f64::NAN));
            }
        }
        places
    }
}

impl Block {
    fn of(samples: impl Iterator<Item = u16>, count: usize) -> Self {
        let (mut sum, mut squares, mut min, mut max) = (0.0, 0.0, u16::MAX, 0);
        for code in samples {
            sum += f64::from(code);
            squares += f64::from(code) * f64::from(code);
            (min, max) = (min.min(code), max.max(code));
        }
        let mean = sum / count as f64;
        let variance = (squares / count as f64 - mean * mean).max(0.0);
        Self { mean: mean as f32, spread: variance.sqrt() as f32, min, max }
    }

    /// Its mean code, if no pixel is clipped or nearly clipped and the block is uniform: across an edge, or
    /// where noise is clipped at black, the mean of the codes is not the code of the mean.
    fn code(&self, black: u16, saturation: u16) -> Option<f64> {
        let (mean, spread) = (f64::from(self.mean), f64::from(self.spread));
        let (low, range) = (f64::from(black), f64::from(saturation - black));
        let is_clipped = self.min <= black || f64::from(self.max) >= low + range * (1.0 - 1.0 / 128.0);
        let is_even = spread <= 1.0f64.max(range / 256.0) + 0.03 * (mean - low);
        (!is_clipped && is_even && mean > low + DARKEST_SHARE * range).then_some(mean)
    }
}

impl Places {
    pub(super) fn len(&self) -> usize {
        self.codes.len() / self.pictures
    }

    /// For every sample the codes by picture; NaN where a picture has no usable code.
    pub(super) fn iter(&self) -> impl Iterator<Item = &[f64]> {
        self.codes.chunks_exact(self.pictures)
    }

    pub(super) fn codes_seen(&self) -> (f64, f64) {
        self.seen
    }
}

/// 0 to len - 1, each once, in a scattered order that is always the same.
fn scattered(len: usize) -> impl Iterator<Item = usize> {
    let gcd = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    // With a step near the golden section of the length, consecutive numbers lie far apart.
    let golden = (len as f64 * 0.618_034) as usize;
    let step = (golden.max(1)..).find(|&step| gcd(step, len.max(1)) == 1).unwrap_or(1);
    (0..len).map(move |at| (at as u128 * step as u128 % len as u128) as usize)
}
