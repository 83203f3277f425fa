//! Messages as JSON: a list as [`write_list`](super::write_list) writes it with one more key at the end,
//! `"stream":{...}`, a [`Delivery`]. A program that knows only lists and not streams reads it as a list.

use super::list::read_list_with;
use super::{Delivery, MESSAGE_MAX_BYTES, Message};
use crate::error::{Error, Result};

/// Room for the data that goes with a list: five numbers of at most 20 characters, and their names.
const DELIVERY_BYTES: usize = 256;

/// Assembles a message from the JSON object of its list and the rest, into `message`.
///
/// `list` is one JSON object with at least one key, with or without a newline.
pub fn encode(list: &[u8], delivery: &Delivery, message: &mut Vec<u8>) {
    message.clear();
    message.reserve(list.len() + DELIVERY_BYTES);
    message.extend_from_slice(&list[..open_length(list)]);
    message.extend_from_slice(&tail(delivery));
}

/// How much of the JSON object of a list stands in a message, before its [`tail`].
pub fn open_length(list: &[u8]) -> usize {
    list.trim_ascii_end().strip_suffix(b"}").unwrap_or(list).len()
}

/// The end of a message, after [`open_length`] bytes of the object of its list.
pub fn tail(delivery: &Delivery) -> Vec<u8> {
    let mut tail = Vec::with_capacity(DELIVERY_BYTES);
    tail.extend_from_slice(b",\"stream\":");
    serde_json::to_writer(&mut tail, delivery).expect("numbers go into JSON, and memory takes them");
    tail.push(b'}');
    tail
}

/// Decodes a message.
///
/// # Errors
/// Those of [`read_list`](super::read_list); a `stream` that is missing or wrong; more than
/// [`MESSAGE_MAX_BYTES`].
pub fn decode(bytes: &[u8], message: &mut Message) -> Result<()> {
    if bytes.len() > MESSAGE_MAX_BYTES {
        return Err(Error::failed(format!("has more than {MESSAGE_MAX_BYTES} bytes: no list has")));
    }
    match read_list_with(bytes, &mut message.list)? {
        Some(delivery) => message.delivery = delivery,
        None => return Err(Error::failed("has no key `stream`: it is a list, but no message")),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{read_list, write_list_line};
    use super::*;
    use lightcast_core::image::Stamp;
    use lightcast_core::light::{Light, LightList};

    const DELIVERY: Delivery = Delivery {
        lost: u64::MAX,
        capture_monotonic_ns: Some(i64::MIN),
        capture_utc_ns: None,
        sent_monotonic_ns: i64::MAX,
        sent_utc_ns: 1_764_205_200_123_456_789,
    };

    fn line_of(list: &LightList) -> Vec<u8> {
        let mut line = Vec::new();
        write_list_line(list, &mut line).unwrap();
        line
    }

    /// The line of the list, and that of the list that a client gets.
    fn there_and_back(list: &LightList) -> [String; 2] {
        let (line, mut text, mut message) = (line_of(list), Vec::new(), Message::default());
        encode(&line, &DELIVERY, &mut text);
        decode(&text, &mut message).unwrap();
        assert_eq!(message.delivery, DELIVERY);
        [line, line_of(&message.list)].map(|line| String::from_utf8(line).unwrap())
    }

    fn one_light() -> LightList {
        let light =
            Light { id: 3, direction: [0.0, 1.0, 0.0], irradiance: [1.0, 2.0, 3.0], spread_rad: 0.04 };
        LightList { lights: vec![light], ..LightList::default() }
    }

    #[test]
    fn a_message_is_the_list_with_one_key_more() {
        let list = one_light();
        let (line, mut text) = (line_of(&list), b"what was there".to_vec());
        encode(&line, &DELIVERY, &mut text);
        assert_eq!(
            String::from_utf8(text.clone()).unwrap(),
            String::from_utf8(line[..line.len() - 2].to_vec()).unwrap()
                + ",\"stream\":{\"lost\":18446744073709551615,\"capture_monotonic_ns\":-9223372036854775808,\
                   \"capture_utc_ns\":null,\"sent_monotonic_ns\":9223372036854775807,\
                   \"sent_utc_ns\":1764205200123456789}}"
        );
        // A program that knows only lists and not streams.
        let mut read = LightList::default();
        read_list(&text, &mut read).unwrap();
        assert_eq!(read, list);
    }

    #[test]
    fn lists_come_back_byte_for_byte() {
        let mut list = LightList::default();
        let [line, back] = there_and_back(&list);
        assert_eq!(line, back);

        // Every float from 0 to 1e30 is one that a list may have: steps through all exponents, and special
        // cases.
        let mut floats: Vec<f32> = (0..1e30_f32.to_bits()).step_by(150_001).map(f32::from_bits).collect();
        floats.extend([1e30, f32::MIN_POSITIVE, 0.1, 1.0 / 3.0, 16_777_216.0, 1e-45, 9.999_999e22, -0.0]);
        list.lights = floats
            .chunks(3)
            .enumerate()
            .map(|(number, values)| Light {
                id: u32::MAX - number as u32,
                direction: [0.6_f32.next_up(), -0.8_f32.next_down(), values[0].min(1e-5)],
                irradiance: [values[0], *values.last().unwrap(), values[values.len() / 2]],
                spread_rad: values[0].min(std::f32::consts::PI),
            })
            .collect();
        list.stamp = Stamp {
            sequence: u64::MAX,
            capture_time_ns: i64::MIN,
            lost_before: u64::MAX,
            frame_rate_hz: 30e3 / 1001.0,
        };
        (list.filter_delay_frames, list.chosen_lights, list.error) =
            (u32::MAX, Some(u32::MAX), Some(f32::MAX));
        for power in [0.1 + 0.2, 5e-324, 1e36, 9_007_199_254_740_993.0, 2.225_073_858_507_201e-308] {
            list.power = [power, f64::from(f32::MAX.sqrt()), -0.0];
            list.prefix_errors = vec![(0, 0.0), (u32::MAX, 1e-45), (1, power as f32)];
            let [line, back] = there_and_back(&list);
            assert_eq!(line, back);
        }
    }

    #[test]
    fn faults_are_told() {
        let mut text = Vec::new();
        let measured = LightList { error: Some(0.0), ..one_light() };
        encode(&line_of(&measured), &DELIVERY, &mut text);
        let sound = String::from_utf8(text).unwrap();
        let stream = sound.find(",\"stream\"").unwrap();
        for (message, expected) in [
            (format!("{}}}", &sound[..stream]), "has no key `stream`: it is a list, but no message"),
            (format!("{},\"stream\":null}}", &sound[..stream]), "has no key `stream`"),
            (
                sound.replace("\"lost\":18446744073709551615", "\"lost\":-1"),
                "`-1` given where a whole number",
            ),
            (sound.replace("\"lost\":18446744073709551615,", ""), "missing field `lost`"),
            (
                sound.replace("\"version\":1", "\"version\":2"),
                "is of version 2; this program reads version 1",
            ),
            (sound.replace("[0.0,1.0,0.0]", "[0.0,2.0,0.0]"), "light 0 (id 3): its direction is no unit"),
            (sound.replace("\"error\":0.0", "\"error\":-1"), "its error, or that of a prefix, is not"),
            (sound[..sound.len() - 1].to_owned(), "is no light list, one JSON object: EOF"),
            (sound.clone() + "{}", "trailing characters"),
            (sound.clone() + &" ".repeat(MESSAGE_MAX_BYTES), "has more than 8388608 bytes: no list has"),
            (String::new(), "is no light list, one JSON object: EOF"),
        ] {
            let error = decode(message.as_bytes(), &mut Message::default()).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}\nis not\n{expected}");
        }
        decode((sound + " \n").as_bytes(), &mut Message::default()).unwrap();
    }
}
