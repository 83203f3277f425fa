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
#[cfg(test)]
mod tests;
mod write;

pub use write::{encode_exr, encode_map_exr, write_exr, write_recorded_exr};

use super::codec::{Attributes, check_size, guarded, resize, with_codes, with_radiance};
use super::colour_space::{Primaries, convert};
use crate::error::{Error, Result};
use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::lines::LineRef;
use exr::meta::attribute::{ChannelList, Chromaticities, Compression, EnvironmentMap, SampleType};
use exr::meta::header::Header;
use exr::prelude::{MetaData, f16};
use glam::{DMat3, DVec2};
use lightcast_core::image::{Bayer, Frame, LatLongCentres};
use std::io::{Cursor, Read, Seek};

/// Most bytes of one block (a tile, or up to 256 scan lines), which is decoded at once; the widest scan-line
/// block of three float channels takes 50 MB.
const MAX_BLOCK_BYTES: usize = 1 << 30;

/// What to take from a file, decided from its header alone.
struct Plan {
    part: usize,
    /// Of the display window.
    width: usize,
    height: usize,
    /// Columns and rows of the data window.
    data: (usize, usize),
    /// Where the data window begins in the display window.
    offset: (i64, i64),
    channels: usize,
    /// For every channel of the part, its index in a pixel of the frame.
    places: Vec<Option<usize>>,
    /// Width and height of a full block.
    block: (usize, usize),
    /// Whether the samples are sensor codes.
    is_codes: bool,
    bayer: Option<Bayer>,
    /// To Rec. 709, where the file has other primaries.
    to_rec_709: Option<DMat3>,
    attributes: Attributes,
}

impl Plan {
    /// Whether the data window fills the picture.
    fn fills(&self) -> bool {
        let ends = |offset: i64, data: usize, side: usize| offset <= 0 && offset + data as i64 >= side as i64;
        ends(self.offset.0, self.data.0, self.width) && ends(self.offset.1, self.data.1, self.height)
    }
}

/// Reads an OpenEXR file in memory as [`read`](super::read) reads one.
///
/// # Errors
/// Of kind [`BadFrame`](crate::error::Kind::BadFrame), as those of [`read`](super::read). `frame` is then
/// empty (0 x 0). No content causes a panic.
pub fn decode_exr(bytes: &[u8], frame: &mut Frame) -> Result<Attributes> {
    frame.saturation = f32::INFINITY;
    guarded(frame, |frame| read(Cursor::new(bytes), bytes.len() as u64, frame))
}

/// Reads the file behind `source`, which is `file_bytes` long, into `frame`.
pub(super) fn read(mut source: impl Read + Seek, file_bytes: u64, frame: &mut Frame) -> Result<Attributes> {
    // The header is read twice: once on its own, so that everything is checked before `exr` acts on it.
    let meta = MetaData::read_from_buffered(&mut source, false).map_err(damaged)?;
    let mut plan = plan(&meta, file_bytes)?;
    source.rewind().map_err(|error| damaged(error.into()))?;
    let chunks = exr::block::read(source, false)
        .and_then(|reader| {
            reader.filter_chunks(false, |_, tile, block| {
                block.layer == plan.part && tile.is_largest_resolution_level()
            })
        })
        .map_err(damaged)?;
    if plan.is_codes {
        with_codes(frame, |codes| decode(&meta, &plan, chunks, codes))?;
    } else {
        plan.attributes.overflowed = with_radiance(frame, |values| {
            let infinite = decode(&meta, &plan, chunks, values)?;
            if infinite > 0 {
                replace_infinite(values, &plan, &meta.headers[plan.part]);
            }
            if let Some(matrix) = &plan.to_rec_709 {
                convert(values, matrix);
            }
            Ok(infinite)
        })?;
    }
    frame.bayer = plan.bayer;
    (frame.width, frame.height, frame.channels) = (plan.width, plan.height, plan.channels);
    Ok(plan.attributes)
}

/// The largest half float.
const HALF_MAX: f32 = 65_504.0;

/// Gives samples of infinity the largest value that they may have had.
fn replace_infinite(values: &mut [f32], plan: &Plan, header: &Header) {
    let largest = values.iter().copied().filter(|value| value.is_finite()).fold(0.0, f32::max);
    for (place, channel) in plan.places.iter().zip(&header.channels.list) {
        let Some(place) = *place else { continue };
        let is_half = channel.sample_type == SampleType::F16;
        let most = if is_half || largest == 0.0 { HALF_MAX } else { largest };
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

fn plan(meta: &MetaData, file_bytes: u64) -> Result<Plan> {
    // A chunk may name any part, so all parts are checked, not only the one that is read.
    let mut chunks = 0_u64;
    for header in &meta.headers {
        check_part(header)?;
        chunks = chunks.saturating_add(header.chunk_count as u64);
    }
    // Every block takes eight bytes in the offset table and at least eight bytes of data.
    if chunks.saturating_mul(16) > file_bytes {
        return Err(Error::bad_frame(format!(
            "is truncated or damaged: {file_bytes} bytes cannot hold the {chunks} blocks that its header promises"
        )));
    }

    let (part, names) = choose(meta)?;
    let header = &meta.headers[part];
    if let Compression::HTJ2K32 | Compression::HTJ2K256 = header.compression {
        return Err(damaged(exr::error::Error::NotSupported("HTJ2K compression".into())));
    }
    let display = header.shared_attributes.display_window;
    let data = header.own_attributes.layer_position;
    let (width, height) = (display.size.0, display.size.1);
    check_size(width, height)?;
    let offset = |data: i32, display: i32| i64::from(data) - i64::from(display);
    let offset = (offset(data.0, display.position.0), offset(data.1, display.position.1));
    let is_outside =
        |offset: i64, data: usize, side: usize| offset >= side as i64 || offset + data as i64 <= 0;
    if is_outside(offset.0, header.layer_size.0, width) || is_outside(offset.1, header.layer_size.1, height) {
        return Err(Error::bad_frame(
            "has a data window that lies outside of its display window: it shows nothing",
        ));
    }
    let to_rec_709 = match &header.shared_attributes.chromaticities {
        Some(Chromaticities { red, green, blue, white }) if names.len() == 3 => {
            let xy = |xy: &exr::math::Vec2<f32>| DVec2::new(xy.0.into(), xy.1.into());
            Primaries { red: xy(red), green: xy(green), blue: xy(blue), white: xy(white) }
                .to_rec_709("chromaticities")?
        }
        _ => None,
    };
    let latlong_centres = match header.own_attributes.environment_map {
        None => LatLongCentres::Half,
        Some(EnvironmentMap::LatitudeLongitude) => LatLongCentres::Ends,
        Some(EnvironmentMap::Cube) => {
            return Err(Error::bad_frame("holds a cube map (envmap attribute); convert it to lat-long"));
        }
    };
    let rate = header.own_attributes.frames_per_second;
    let frame_rate_hz = rate.map(|(count, seconds)| f64::from(count) / f64::from(seconds));
    let block = header.max_block_pixel_size();
    let recorded = attribute::read(header, &names)?;
    Ok(Plan {
        part,
        width,
        height,
        data: (header.layer_size.0, header.layer_size.1),
        offset,
        channels: names.len(),
        places: header
            .channels
            .list
            .iter()
            .map(|channel| names.iter().position(|name| channel.name.eq(name.as_str())))
            .collect(),
        block: (block.0, block.1),
        attributes: Attributes {
            // Files contain 0/1 and 1/0 where the program that wrote them did not know a rate.
            frame_rate_hz: recorded
                .frame_rate_hz
                .or(frame_rate_hz.filter(|rate| rate.is_finite() && *rate > 0.0)),
            latlong_centres,
            overflowed: 0,
            capture_time_ns: recorded.capture_time_ns,
        },
        to_rec_709,
        is_codes: recorded.is_codes,
        bayer: recorded.bayer,
    })
}

fn check_part(header: &Header) -> Result<()> {
    if header.deep {
        return Err(Error::bad_frame("holds deep data; flatten it"));
    }
    let (width, height) = (header.layer_size.0, header.layer_size.1);
    check_size(width, height)?;
    if header.channels.list.iter().any(|channel| (channel.sampling.0, channel.sampling.1) != (1, 1)) {
        return Err(Error::bad_frame(format!(
            "has subsampled channels ({}), as luminance/chroma files do; save it as RGB",
            names(&header.channels)
        )));
    }
    // A tile may be larger than a small picture, but not by orders of magnitude, because its claimed size
    // determines how much memory is allocated.
    let block = header.max_block_pixel_size();
    let block_pixels = block.0.checked_mul(block.1);
    let bytes = block_pixels.and_then(|pixels| pixels.checked_mul(header.channels.bytes_per_pixel));
    let most_pixels = (4 * width * height).max(1 << 20);
    if block_pixels.is_none_or(|pixels| pixels > most_pixels)
        || bytes.is_none_or(|bytes| bytes > MAX_BLOCK_BYTES)
    {
        return Err(Error::bad_frame(format!(
            "is damaged or unreasonable: blocks of {} x {} pixels for a picture of {width} x {height}",
            block.0, block.1
        )));
    }
    Ok(())
}

/// The part to read and the names of its channels in the order of the frame.
fn choose(meta: &MetaData) -> Result<(usize, Vec<String>)> {
    let has = |header: &Header, name: &str| header.channels.list.iter().any(|channel| channel.name.eq(name));
    for wanted in [&["R", "G", "B"][..], &["Y"][..]] {
        let found = meta.headers.iter().position(|header| wanted.iter().all(|name| has(header, name)));
        if let Some(part) = found {
            if wanted.len() == 1 && (has(&meta.headers[part], "RY") || has(&meta.headers[part], "BY")) {
                return Err(Error::bad_frame(
                    "holds luminance and chroma (channels Y, RY, BY); save it as RGB",
                ));
            }
            return Ok((part, wanted.iter().map(|name| (*name).to_owned()).collect()));
        }
    }
    // Programs that write layers name them all, also where there is one only.
    let layers: Vec<(usize, String)> = meta
        .headers
        .iter()
        .enumerate()
        .flat_map(|(part, header)| {
            header.channels.list.iter().map(move |channel| (part, channel.name.to_string()))
        })
        .filter_map(|(part, name)| Some((part, name.strip_suffix(".R")?.to_owned())))
        .filter(|(part, layer)| {
            ["G", "B"].iter().all(|colour| has(&meta.headers[*part], &format!("{layer}.{colour}")))
        })
        .collect();
    if let [(part, layer)] = &layers[..] {
        return Ok((*part, ["R", "G", "B"].map(|colour| format!("{layer}.{colour}")).to_vec()));
    }
    if !layers.is_empty() {
        let layers: Vec<&str> = layers.iter().map(|(_, layer)| layer.as_str()).collect();
        return Err(Error::bad_frame(format!(
            "has several layers ({}) and none of plain R, G and B; save the one that is meant alone",
            layers.join(", ")
        )));
    }
    let all: Vec<String> = meta.headers.iter().map(|header| names(&header.channels)).collect();
    Err(Error::bad_frame(format!("has the channels {}; R, G and B, or Y, are needed", all.join("; "))))
}

fn names(channels: &ChannelList) -> String {
    let names: Vec<String> = channels.list.iter().map(|channel| channel.name.to_string()).collect();
    names.join(", ")
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
            resize(values, samples);
            if !plan.fills() {
                values.fill(T::default());
            }
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
