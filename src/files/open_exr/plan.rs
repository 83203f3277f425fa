//! What is read of an OpenEXR file, by its header alone.

use super::{attribute, damaged};
use crate::error::{Error, Result};
use crate::files::codec::{Attributes, check_size};
use crate::files::colour_space::Primaries;
use exr::meta::attribute::{ChannelList, Chromaticities, Compression, EnvironmentMap};
use exr::meta::header::Header;
use exr::prelude::MetaData;
use glam::{DMat3, DVec2};
use lightcast_core::image::{Bayer, LatLongCentres};

/// Most bytes of one block (a tile, or up to 256 scan lines), which is decoded at once; the widest scan-line
/// block of three float channels takes 50 MB.
const MAX_BLOCK_BYTES: usize = 1 << 30;

/// What to take from a file, decided from its header alone.
pub(super) struct Plan {
    pub part: usize,
    /// Of the display window.
    pub width: usize,
    pub height: usize,
    /// Columns and rows of the data window.
    pub data: (usize, usize),
    /// Where the data window begins in the display window.
    pub offset: (i64, i64),
    pub channels: usize,
    /// For every channel of the part, its index in a pixel of the frame.
    pub places: Vec<Option<usize>>,
    /// Width and height of a full block.
    pub block: (usize, usize),
    /// Whether the samples are sensor codes.
    pub is_codes: bool,
    pub bayer: Option<Bayer>,
    /// To Rec. 709, where the file has other primaries.
    pub to_rec_709: Option<DMat3>,
    pub attributes: Attributes,
}

impl Plan {
    /// Whether the data window fills the picture.
    pub fn fills(&self) -> bool {
        let ends = |offset: i64, data: usize, side: usize| offset <= 0 && offset + data as i64 >= side as i64;
        ends(self.offset.0, self.data.0, self.width) && ends(self.offset.1, self.data.1, self.height)
    }
}

/// Decides what to take; refuses what is not read, and what has not the `size` that is wanted, before
/// anything is allocated for it.
pub(super) fn plan(meta: &MetaData, file_bytes: u64, size: Option<[usize; 2]>) -> Result<Plan> {
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
    check_size(width, height, size)?;
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
    check_size(width, height, None)?;
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
