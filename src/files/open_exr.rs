//! Reading OpenEXR pictures: half, float and uint channels, scan lines or tiles, full resolution.
//!
//! - The display window is the picture. Where the data window does not fill it the picture is black; what lies
//!   outside of it (overscan) is cut off.
//! - In a file with several parts the first with channels named exactly `R`, `G` and `B` is taken, else the
//!   first with `Y`, else the only layer that has R, G and B (`ViewLayer.Combined.R`). Alpha, other layers and
//!   everything else are left out.
//! - `chromaticities` other than those of Rec. 709 are converted to these. `inf`, which is what becomes of a sun
//!   in half floats, is read as the largest value.
//! - Only the full resolution of mip maps and rip maps is read.
//! - Files that `lightcast` recorded hold sensor codes as uint channels; the attributes of [`attribute`] say
//!   so.
//! - Refused: deep data, luminance/chroma (`Y`, `RY`, `BY`) and other subsampled channels, cube maps.
//!
//! Blocks are decoded one after another in the calling thread: the parallel form of `exr` 1.74 starts a
//! thread pool for every file, and a panic in that pool (damaged files cause some) ends the process.

mod attribute;
mod plan;
#[cfg(test)]
mod tests;
mod write;

pub use write::{encode_exr, encode_map_exr, write_exr, write_recorded_exr};

use super::codec::{Attributes, guarded, resize, with_codes, with_radiance};
use super::colour_space::convert;
use crate::error::{Error, Result};
use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::lines::LineRef;
use exr::meta::attribute::{Compression, SampleType};
use exr::meta::header::Header;
use exr::prelude::{MetaData, f16};
use lightcast_core::image::Frame;
use plan::{Plan, plan};
use std::io::{Cursor, Read, Seek};

/// Reads an OpenEXR file in memory as [`read`](super::read) reads one.
///
/// # Errors
/// Of kind [`BadFrame`](crate::error::Kind::BadFrame), as those of [`read`](super::read). `frame` is then
/// empty (0 x 0). No content causes a panic.
pub fn decode_exr(bytes: &[u8], frame: &mut Frame) -> Result<Attributes> {
    frame.saturation = f32::INFINITY;
    guarded(frame, |frame| read(Cursor::new(bytes), bytes.len() as u64, frame, None))
}

/// Reads the file behind `source`, which is `file_bytes` long, into `frame`; `size`: the only one that it may
/// have.
pub(super) fn read(
    mut source: impl Read + Seek,
    file_bytes: u64,
    frame: &mut Frame,
    size: Option<[usize; 2]>,
) -> Result<Attributes> {
    // The header is read twice: once on its own, so that everything is checked before `exr` acts on it.
    let meta = MetaData::read_from_buffered(&mut source, false).map_err(damaged)?;
    let plan = plan(&meta, file_bytes, size)?;
    source.rewind().map_err(|error| damaged(error.into()))?;
    let chunks = exr::block::read(source, false)
        .and_then(|reader| {
            reader.filter_chunks(false, |_, tile, block| {
                block.layer == plan.part && tile.is_largest_resolution_level()
            })
        })
        .map_err(damaged)?;
    let overflowed = if plan.is_codes {
        with_codes(frame, |codes| decode(&meta, &plan, chunks, codes))?
    } else {
        with_radiance(frame, |values| {
            let infinite = decode(&meta, &plan, chunks, values)?;
            if infinite > 0 {
                replace_infinite(values, &plan, &meta.headers[plan.part]);
            }
            if let Some(matrix) = &plan.to_rec_709 {
                convert(values, matrix);
            }
            Ok(infinite)
        })?
    };
    frame.bayer = plan.bayer;
    (frame.width, frame.height, frame.channels) = (plan.width, plan.height, plan.channels);
    Ok(Attributes { overflowed, ..plan.attributes })
}

/// Gives samples of infinity the largest value that they may have had.
fn replace_infinite(values: &mut [f32], plan: &Plan, header: &Header) {
    let largest = values.iter().copied().filter(|value| value.is_finite()).fold(0.0, f32::max);
    for (place, channel) in plan.places.iter().zip(&header.channels.list) {
        let Some(place) = *place else { continue };
        let is_half = channel.sample_type == SampleType::F16;
        let most = if is_half || largest == 0.0 { f16::MAX.to_f32() } else { largest };
        for value in
            values[place..].iter_mut().step_by(plan.channels).filter(|value| **value == f32::INFINITY)
        {
            *value = most;
        }
    }
}

fn damaged(error: exr::error::Error) -> Error {
    match error {
        exr::error::Error::NotSupported(what) => Error::bad_frame(format!(
            "holds what is not read here ({what}); convert it, for instance `oiiotool IN.exr --compression zip -o OUT.exr`"
        )),
        error => Error::bad_frame("cannot be decoded as OpenEXR; is it complete?").because(error),
    }
}

/// What samples of a file are converted to.
trait Sample: Copy + Default {
    fn from_float(value: f32) -> Self;
    /// `None`: not a valid code.
    fn from_whole(value: u32) -> Option<Self>;
}

impl Sample for f32 {
    fn from_float(value: f32) -> Self {
        value
    }

    fn from_whole(value: u32) -> Option<Self> {
        Some(value as f32)
    }
}

/// Codes are integers: [`attribute::read`] refuses other channel types for them.
impl Sample for u16 {
    fn from_float(_: f32) -> Self {
        0
    }

    fn from_whole(value: u32) -> Option<Self> {
        value.try_into().ok()
    }
}

/// Decodes all blocks; returns how many samples are infinite.
fn decode<T: Sample>(
    meta: &MetaData,
    plan: &Plan,
    chunks: impl ExactSizeIterator<Item = exr::error::Result<Chunk>>,
    values: &mut Vec<T>,
) -> Result<u64> {
    let header = &meta.headers[plan.part];
    let block_columns = plan.data.0.div_ceil(plan.block.0);
    let mut missing = vec![true; block_columns * plan.data.1.div_ceil(plan.block.1)];
    let mut infinite = 0_u64;
    let samples = plan.width * plan.height * plan.channels;
    for (number, chunk) in chunks.enumerate() {
        let chunk = chunk.map_err(damaged)?;
        check_dwa_counters(&chunk, header)?;
        let block = UncompressedBlock::decompress_chunk(chunk, meta, false).map_err(damaged)?;
        if number == 0 {
            // Nothing is allocated before one block has confirmed the header.
            if !plan.fills() {
                // Pixels of an earlier picture go; new memory is black, and costs nothing where it stays so.
                values.clear();
            }
            resize(values, samples);
        }
        // The offset table may point to any block: each must occur exactly once, or old pixels would remain.
        let (x, y) = (block.index.pixel_position.0, block.index.pixel_position.1);
        let expected = block.index.layer == plan.part && (block.index.level.0, block.index.level.1) == (0, 0);
        let slot = missing.get_mut(y / plan.block.1 * block_columns + x / plan.block.0);
        match slot {
            Some(slot) if expected && *slot => *slot = false,
            _ => return Err(Error::bad_frame(format!("is damaged: unexpected block at pixel ({x}, {y})"))),
        }
        for line in block.lines(&header.channels) {
            let Some(place) = plan.places[line.location.channel] else { continue };
            let Some((row, column, cut)) = placed(&line, plan) else { continue };
            let start = (row * plan.width + column) * plan.channels;
            let count = line.location.sample_count - cut;
            let to = values[start + place..]
                .iter_mut()
                .step_by(plan.channels)
                .take(plan.width - column)
                .take(count);
            match header.channels.list[line.location.channel].sample_type {
                SampleType::F16 => {
                    for (to, &bytes) in to.zip(&line.value.as_chunks().0[cut..]) {
                        let value = f16::from_ne_bytes(bytes).to_f32();
                        infinite += u64::from(value == f32::INFINITY);
                        *to = T::from_float(value);
                    }
                }
                SampleType::F32 => {
                    for (to, &bytes) in to.zip(&line.value.as_chunks().0[cut..]) {
                        let value = f32::from_ne_bytes(bytes);
                        infinite += u64::from(value == f32::INFINITY);
                        *to = T::from_float(value);
                    }
                }
                SampleType::U32 => {
                    for (to, &bytes) in to.zip(&line.value.as_chunks().0[cut..]) {
                        let value = u32::from_ne_bytes(bytes);
                        *to = T::from_whole(value).ok_or_else(|| {
                            Error::bad_frame(format!("holds the sensor code {value}; codes have 16 bits"))
                        })?;
                    }
                }
            }
        }
    }
    match missing.iter().filter(|missing| **missing).count() {
        0 => Ok(infinite),
        count => {
            Err(Error::bad_frame(format!("is damaged: {count} of {} blocks are missing", missing.len())))
        }
    }
}

/// Row and column of the picture where a line of a block begins, and how many of its samples lie left of it;
/// `None` for a line outside of the picture.
fn placed(line: &LineRef<'_>, plan: &Plan) -> Option<(usize, usize, usize)> {
    let at = |position: usize, offset: i64| i64::try_from(position).ok().map(|position| position + offset);
    let (x, y) = (at(line.location.position.0, plan.offset.0)?, at(line.location.position.1, plan.offset.1)?);
    let row = usize::try_from(y).ok().filter(|row| *row < plan.height)?;
    let cut = usize::try_from(-x).unwrap_or(0);
    let column = usize::try_from(x).unwrap_or(0);
    (cut < line.location.sample_count && column < plan.width).then_some((row, column, cut))
}

/// Refuses DWA blocks whose counters claim more than their pixels can need.
///
/// `exr` 1.74 allocates what the counters say; an absurd value would abort the process, which cannot be
/// caught. The counters are u64, little endian: version, then the sizes of unknown (unpacked), unknown, AC,
/// DC, RLE, RLE (inflated) and RLE (raw) data in bytes, then the counts of AC and DC values of two bytes.
/// Lossless data grows to at most twice its size as RLE tokens, and every pixel has at most one coefficient.
fn check_dwa_counters(chunk: &Chunk, header: &Header) -> Result<()> {
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    let data = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        _ => return Err(Error::bad_frame("holds deep data; flatten it")),
    };
    let place = header.get_block_data_indices(&chunk.compressed_block).map_err(damaged)?;
    let window = header.get_absolute_block_pixel_coordinates(place).map_err(damaged)?;
    let bytes = window.size.0 * window.size.1 * header.channels.bytes_per_pixel;
    if data.len() == bytes {
        return Ok(()); // stored as it is, no counters
    }
    // Blocks below 64 pixels still have whole 8 x 8 transforms, hence the floor.
    let most = 2 * bytes as u64 + (1 << 16);
    let mut counters = data.as_chunks::<8>().0.iter().map(|bytes| u64::from_le_bytes(*bytes)).take(10);
    if counters.any(|counter| counter > most) {
        return Err(Error::bad_frame("is damaged: a DWA block claims more data than its pixels can need"));
    }
    Ok(())
}
