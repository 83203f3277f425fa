//! Lists as bytes: 14 per light. `docs/protocol.md` has the layout.

#[cfg(test)]
mod tests;

use super::limits::{MOST_IRRADIANCE, MOST_POWER};
use super::quantity::{Scale, decode_direction, encode_direction};
use super::{Delivery, Message};
use crate::error::{Error, Place, Result};
use lightcast_core::image::Stamp;
use lightcast_core::light::{Light, LightList, MAX_LIGHTS};
use std::f64::consts::PI;
use std::fmt::LowerExp;

/// `LCL` and the version.
const MAGIC: [u8; 4] = *b"LCL\x01";
/// Bytes of the header before the part that clients share: magic, sizes and the [`Delivery`].
const DELIVERY_BYTES: usize = 48;
/// Bytes of the whole header.
const HEADER_BYTES: usize = 120;
/// Bytes of a prefix's length and error.
const PREFIX_BYTES: usize = 8;
/// Bytes of a light.
const LIGHT_BYTES: usize = 14;
/// Flag: the capture times are known.
const HAS_CAPTURE_TIMES: u16 = 1;
/// Most prefix errors; lengths double from one to the next, so that few lists have as many as ten.
const MAX_PREFIX_ERRORS: usize = 64;

/// The part of a message that all clients of a list share: every byte from 48 on.
///
/// An error that was not measured is sent as 0. Numbers that cannot be sent are replaced: NaN, infinity and
/// negative numbers by 0, irradiances above 1e30 and powers above 1e36 by these limits, spreads above pi by
/// pi, invalid directions by +Y. [`decode`] accepts the result.
///
/// # Errors
/// A light whose id is above 65,535; two lights of one id; more than [`MAX_LIGHTS`] lights or 64 prefix
/// errors.
pub fn encode_list(list: &LightList, body: &mut Vec<u8>) -> Result<()> {
    body.clear();
    let (lights, prefix_errors) = (&list.lights, &list.prefix_errors);
    if lights.len() > MAX_LIGHTS || prefix_errors.len() > MAX_PREFIX_ERRORS {
        return Err(Error::failed(format!(
            "the list has {} lights and {} prefix errors; a message takes {MAX_LIGHTS} and {MAX_PREFIX_ERRORS}",
            lights.len(),
            prefix_errors.len()
        )));
    }
    let mut ids = Ids::default();
    let mut brightest = 0.0_f32;
    for (number, light) in lights.iter().enumerate() {
        let fault = match u16::try_from(light.id) {
            Err(_) => "above 65535, the highest in a message",
            Ok(id) if ids.is_taken(id) => "that of another light",
            Ok(_) => {
                brightest = light.irradiance.iter().fold(brightest, |most, &v| most.max(irradiance(v)));
                continue;
            }
        };
        let fault = format!("its id {} is {fault}", light.id);
        return Err(Error::failed(fault).at(format_args!("light {number}")));
    }

    let Stamp { sequence, capture_time_ns, lost_before, frame_rate_hz } = list.stamp;
    body.reserve(
        HEADER_BYTES - DELIVERY_BYTES + PREFIX_BYTES * prefix_errors.len() + LIGHT_BYTES * lights.len(),
    );
    body.extend_from_slice(&sequence.to_le_bytes());
    body.extend_from_slice(&capture_time_ns.to_le_bytes());
    body.extend_from_slice(&lost_before.to_le_bytes());
    body.extend_from_slice(&sound(frame_rate_hz).to_le_bytes());
    for power in list.power {
        body.extend_from_slice(&sound(power).min(MOST_POWER).to_le_bytes());
    }
    body.extend_from_slice(&list.filter_delay_frames.to_le_bytes());
    body.extend_from_slice(&sound_f32(list.error.unwrap_or(0.0)).to_le_bytes());
    body.extend_from_slice(&brightest.to_le_bytes());
    body.extend_from_slice(&(prefix_errors.len() as u16).to_le_bytes());
    body.extend_from_slice(&(lights.len() as u16).to_le_bytes());
    for &(count, error) in prefix_errors {
        body.extend_from_slice(&count.to_le_bytes());
        body.extend_from_slice(&sound_f32(error).to_le_bytes());
    }
    let (irradiances, spreads) = (Scale::new(f64::from(brightest)), Scale::new(PI));
    for light in lights {
        let [u, v] = encode_direction(light.direction);
        let [r, g, b] = light.irradiance.map(|value| irradiances.encode(irradiance(value)));
        let spread = spreads.encode(sound_f32(light.spread_rad));
        let mut bytes = [0; LIGHT_BYTES];
        for (place, word) in bytes.chunks_exact_mut(2).zip([light.id as u16, u, v, r, g, b, spread]) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        body.extend_from_slice(&bytes);
    }
    Ok(())
}

/// Assembles a message from the result of [`encode_list`] and the rest.
pub fn encode(body: &[u8], delivery: &Delivery, message: &mut Vec<u8>) {
    message.clear();
    message.reserve(DELIVERY_BYTES + body.len());
    message.extend_from_slice(&head(delivery));
    message.extend_from_slice(body);
}

/// What stands before the result of [`encode_list`] in a message. The capture times are sent if both are
/// known.
pub fn head(delivery: &Delivery) -> [u8; DELIVERY_BYTES] {
    let Delivery { lost, capture_monotonic_ns, capture_utc_ns, sent_monotonic_ns, sent_utc_ns } = *delivery;
    let (flags, capture) = match (capture_monotonic_ns, capture_utc_ns) {
        (Some(monotonic_ns), Some(utc_ns)) => (HAS_CAPTURE_TIMES, [monotonic_ns, utc_ns]),
        _ => (0, [0; 2]),
    };
    let mut head = [0; DELIVERY_BYTES];
    head[..4].copy_from_slice(&MAGIC);
    head[4..6].copy_from_slice(&(HEADER_BYTES as u16).to_le_bytes());
    head[6..8].copy_from_slice(&flags.to_le_bytes());
    head[8..16].copy_from_slice(&lost.to_le_bytes());
    let times_ns = [capture[0], capture[1], sent_monotonic_ns, sent_utc_ns];
    for (bytes, time_ns) in head[16..].chunks_exact_mut(8).zip(times_ns) {
        bytes.copy_from_slice(&time_ns.to_le_bytes());
    }
    head
}

/// Decodes a message into the storage of `message`. Unknown flags are ignored, as are the bytes of a longer
/// header after byte 120.
///
/// # Errors
/// Says which byte is wrong; `message` is then unchanged. Everything is checked before anything is stored.
pub fn decode(bytes: &[u8], message: &mut Message) -> Result<()> {
    let header = Header::read(bytes)?;
    let (prefixes, lights) = bytes[header.length..].split_at(PREFIX_BYTES * header.prefixes);
    for (number, prefix) in prefixes.chunks_exact(PREFIX_BYTES).enumerate() {
        let error = f32::from_le_bytes(at(prefix, 4));
        check(error, f32::MAX, header.length + PREFIX_BYTES * number + 4, "the error of a prefix")?;
    }
    let mut ids = Ids::default();
    for (number, light) in lights.chunks_exact(LIGHT_BYTES).enumerate() {
        let id = u16::from_le_bytes(at(light, 0));
        if ids.is_taken(id) {
            let byte = header.length + prefixes.len() + LIGHT_BYTES * number;
            let fault = format!("light {number} has the id {id} of another");
            return Err(Error::failed(fault).at(Place::Byte(byte)));
        }
    }

    let list = &mut message.list;
    (list.stamp, list.filter_delay_frames) = (header.stamp, header.filter_delay_frames);
    list.chosen_lights = None;
    (list.power, list.error) = (header.power, Some(header.error));
    list.prefix_errors.clear();
    list.prefix_errors.extend(
        prefixes
            .chunks_exact(PREFIX_BYTES)
            .map(|prefix| (u32::from_le_bytes(at(prefix, 0)), f32::from_le_bytes(at(prefix, 4)))),
    );
    let (irradiances, spreads) = (Scale::new(f64::from(header.brightest)), Scale::new(PI));
    list.lights.clear();
    list.lights.extend(lights.chunks_exact(LIGHT_BYTES).map(|light| {
        let word = |number: usize| u16::from_le_bytes(at(light, 2 * number));
        Light {
            id: u32::from(word(0)),
            direction: decode_direction([word(1), word(2)]),
            irradiance: [word(3), word(4), word(5)].map(|code| irradiances.decode(code)),
            spread_rad: spreads.decode(word(6)),
        }
    }));
    message.delivery = header.delivery;
    Ok(())
}

/// The checked part of a message before its prefix errors.
struct Header {
    /// Bytes before the prefix errors.
    length: usize,
    delivery: Delivery,
    stamp: Stamp,
    power: [f64; 3],
    filter_delay_frames: u32,
    error: f32,
    brightest: f32,
    prefixes: usize,
}

impl Header {
    fn read(bytes: &[u8]) -> Result<Self> {
        let magic = &bytes[..bytes.len().min(MAGIC.len())];
        if !magic.starts_with(&MAGIC[..3]) {
            return Err(
                Error::failed("the message does not begin with LCL: it is no light list").at(Place::Byte(0))
            );
        }
        if magic != MAGIC {
            let version = magic.last().filter(|_| magic.len() == MAGIC.len());
            let fault = match version {
                Some(version) => {
                    format!("the message is of version {version}; this program reads version 1")
                }
                None => "the message ends before its version".to_owned(),
            };
            return Err(Error::failed(fault).at(Place::Byte(3)));
        }
        if bytes.len() < HEADER_BYTES {
            let length = bytes.len();
            let fault = format!("the message ends in its header of {HEADER_BYTES} bytes");
            return Err(Error::failed(fault).at(Place::Byte(length)));
        }
        let length = usize::from(u16::from_le_bytes(at(bytes, 4)));
        if length < HEADER_BYTES {
            let fault = format!("a header of {length} bytes; it has {HEADER_BYTES} at least");
            return Err(Error::failed(fault).at(Place::Byte(4)));
        }
        let prefixes = usize::from(u16::from_le_bytes(at(bytes, 116)));
        let lights = usize::from(u16::from_le_bytes(at(bytes, 118)));
        if prefixes > MAX_PREFIX_ERRORS {
            let fault = format!("{prefixes} prefix errors; {MAX_PREFIX_ERRORS} at most are read");
            return Err(Error::failed(fault).at(Place::Byte(116)));
        }
        if lights > MAX_LIGHTS {
            let fault = format!("{lights} lights; {MAX_LIGHTS} at most are read");
            return Err(Error::failed(fault).at(Place::Byte(118)));
        }
        let whole = length + PREFIX_BYTES * prefixes + LIGHT_BYTES * lights;
        if bytes.len() != whole {
            let fault = format!(
                "the message has {} bytes; with {prefixes} prefix errors and {lights} lights it has {whole}",
                bytes.len()
            );
            return Err(Error::failed(fault).at(Place::Byte(whole.min(bytes.len()))));
        }

        let number = |byte| f64::from_le_bytes(at(bytes, byte));
        let time_ns = |byte| i64::from_le_bytes(at(bytes, byte));
        let power = [80, 88, 96].map(number);
        for (channel, power) in power.into_iter().enumerate() {
            check(power, MOST_POWER, 80 + 8 * channel, "the power")?;
        }
        let frame_rate_hz = check(number(72), f64::MAX, 72, "the frame rate")?;
        let error = check(f32::from_le_bytes(at(bytes, 108)), f32::MAX, 108, "the error")?;
        let brightest =
            check(f32::from_le_bytes(at(bytes, 112)), MOST_IRRADIANCE, 112, "the highest irradiance")?;
        let has_capture_times = u16::from_le_bytes(at(bytes, 6)) & HAS_CAPTURE_TIMES != 0;
        Ok(Self {
            length,
            delivery: Delivery {
                lost: u64::from_le_bytes(at(bytes, 8)),
                capture_monotonic_ns: has_capture_times.then(|| time_ns(16)),
                capture_utc_ns: has_capture_times.then(|| time_ns(24)),
                sent_monotonic_ns: time_ns(32),
                sent_utc_ns: time_ns(40),
            },
            stamp: Stamp {
                sequence: u64::from_le_bytes(at(bytes, 48)),
                capture_time_ns: time_ns(56),
                lost_before: u64::from_le_bytes(at(bytes, 64)),
                frame_rate_hz,
            },
            power,
            filter_delay_frames: u32::from_le_bytes(at(bytes, 104)),
            error,
            brightest,
            prefixes,
        })
    }
}

/// The bytes from `byte` on; the caller has checked that they are there.
fn at<const N: usize>(bytes: &[u8], byte: usize) -> [u8; N] {
    let mut copy = [0; N];
    copy.copy_from_slice(&bytes[byte..byte + N]);
    copy
}

/// `value` if it is from 0 to `most`; NaN is refused.
fn check<T: Copy + Default + LowerExp + PartialOrd>(value: T, most: T, byte: usize, what: &str) -> Result<T> {
    if (T::default()..=most).contains(&value) {
        return Ok(value);
    }
    Err(Error::failed(format!("{what} is {value:e}; it is from 0 to {most:e}")).at(Place::Byte(byte)))
}

/// `value`, or 0 where that is negative or not finite.
fn sound(value: f64) -> f64 {
    if value > 0.0 && value.is_finite() { value } else { 0.0 }
}

/// [`sound`] for an `f32`.
fn sound_f32(value: f32) -> f32 {
    if value > 0.0 && value.is_finite() { value } else { 0.0 }
}

/// An irradiance as it can be sent.
fn irradiance(value: f32) -> f32 {
    sound_f32(value).min(MOST_IRRADIANCE)
}

/// The ids that lights have, a bit for each.
struct Ids([u64; 1024]);

impl Default for Ids {
    fn default() -> Self {
        Self([0; 1024])
    }
}

impl Ids {
    /// Takes an id; returns whether it was taken already.
    fn is_taken(&mut self, id: u16) -> bool {
        let (word, bit) = (&mut self.0[usize::from(id) / 64], 1 << (id % 64));
        let was_taken = *word & bit != 0;
        *word |= bit;
        was_taken
    }
}
