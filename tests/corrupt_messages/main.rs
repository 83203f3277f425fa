//! Damaged messages: whatever comes from the network, decoding it neither panics nor takes more memory than a
//! small multiple of its length.
//!
//! Every decoder gets mutations of valid messages and random bytes, with fixed seeds. Environment variable
//! `LIGHTCAST_FUZZ_INPUTS`: how many inputs in total; `make fuzz` runs ten million.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod counting;
mod mutation;

use counting::counted;
use lightcast::error::Result;
use lightcast::wire::{Delivery, Demand, Message, Subscription, binary, json, write_list};
use lightcast_core::light::{Light, LightList, MAX_LIGHTS};
use mutation::{XorShift, mutate, shown};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Default number of inputs in total, which takes some seconds.
const INPUTS: usize = 1_000_000;

/// Bytes that a decoder may request in addition to a multiple of its input: the text of an error, serde's
/// scratch memory.
const FEW_BYTES: usize = 1024;

/// The output of the decoders.
#[derive(Default)]
struct Taken {
    message: Message,
    subscription: Subscription,
}

/// A decoder under test.
struct Target {
    name: &'static str,
    /// Valid messages, all of which are accepted.
    sound: Vec<Vec<u8>>,
    /// Fragments of messages, which mutations insert.
    pieces: &'static [&'static str],
    /// Bytes that may be requested for every byte of the input.
    asked_per_byte: usize,
    decode: fn(&[u8], &mut Taken) -> Result<()>,
    /// Describes what is wrong with a decoded message, or with the error of a rejected one.
    fault: fn(&Result<()>, &Taken) -> Option<String>,
}

/// Whether an input is accepted; fails with the input where something is wrong.
fn decode(target: &Target, input: &[u8], taken: &mut Taken) -> bool {
    let limit = target.asked_per_byte * input.len() + FEW_BYTES;
    let (result, asked) = counted(|| catch_unwind(AssertUnwindSafe(|| (target.decode)(input, taken))));
    let fault = match result {
        Err(_) => "panicked".to_owned(),
        Ok(_) if asked > limit => format!("asked for {asked} bytes; {limit} are allowed"),
        Ok(result) => match (target.fault)(&result, taken) {
            Some(fault) => fault,
            None => return result.is_ok(),
        },
    };
    panic!("{}: {fault}\n{}", target.name, shown(input));
}

fn survive(target: &Target, seed: u64) {
    let inputs = match std::env::var("LIGHTCAST_FUZZ_INPUTS") {
        Ok(count) => count.parse().expect("LIGHTCAST_FUZZ_INPUTS is a number"),
        Err(_) => INPUTS,
    } / 4;
    let mut random = XorShift(seed);
    let (mut input, mut taken) = (Vec::new(), Taken::default());
    for sound in &target.sound {
        assert!(decode(target, sound, &mut taken), "{}: {}", target.name, shown(sound));
    }
    let (mut sound, mut bytes) = (0, 0);
    for number in 0..inputs {
        mutate(&mut input, &target.sound, target.pieces, &mut random);
        bytes += input.len();
        if number % 4 == 0 {
            taken = Taken::default(); // no storage to reuse
        }
        sound += usize::from(decode(target, &input, &mut taken));
    }
    let mean = bytes / inputs.max(1);
    eprintln!("{}: {inputs} inputs of {mean} bytes on average, {sound} of them sound", target.name);
    // Some mutations have no effect, but not all of them.
    assert!(0 < sound && sound < inputs, "{}: {sound} of {inputs}", target.name);
}

/// Describes what is wrong with an accepted message.
fn fault_in(message: &Message) -> Option<String> {
    let list = &message.list;
    let lights_sound = list.lights.iter().all(|light| {
        let length = light.direction.iter().map(|v| v * v).sum::<f32>().sqrt();
        (length - 1.0).abs() < 2e-3
            && light.irradiance.iter().all(|v| (0.0..=1e30).contains(v))
            && (0.0..=std::f32::consts::PI).contains(&light.spread_rad)
    });
    let is_error = |error: f32| error >= 0.0 && error.is_finite();
    let errors_sound =
        list.prefix_errors.iter().all(|&(_, error)| is_error(error)) && list.error.is_none_or(is_error);
    let power_sound = list.power.iter().all(|v| (0.0..=1e36).contains(v));
    let mut ids: Vec<u32> = list.lights.iter().map(|light| light.id).collect();
    ids.sort_unstable();
    ids.dedup();
    let all = [
        (lights_sound, "a light is not sound"),
        (errors_sound, "an error is not sound"),
        (power_sound, "the power is not sound"),
        (list.stamp.frame_rate_hz.is_finite(), "the frame rate is not sound"),
        (list.lights.len() <= MAX_LIGHTS && ids.len() == list.lights.len(), "lights are too many or double"),
    ];
    all.iter().find(|(is_sound, _)| !is_sound).map(|(_, fault)| (*fault).to_owned())
}

/// Lists with several lights, one light and none.
fn lists() -> Vec<LightList> {
    let mut random = XorShift(17);
    [12, 1, 0]
        .map(|lights| {
            let mut list = LightList::default();
            list.stamp.sequence = random.next();
            list.stamp.frame_rate_hz = 25.0;
            list.lights = (0..lights)
                .map(|id| Light {
                    id,
                    direction: [[0.6, -0.8, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]][random.below(3)],
                    irradiance: [0.0, 0.1, 3e5].map(|v| v * random.below(1000) as f32),
                    spread_rad: 0.01 * random.below(300) as f32,
                })
                .collect();
            list.power = list.sum_of_lights();
            list.prefix_errors = (0..lights.min(3)).map(|number| (1 << number, 0.5)).collect();
            list
        })
        .into()
}

fn delivery(lost: u64) -> Delivery {
    let capture_utc_ns = (lost > 0).then_some(1_764_205_200_123_456_789);
    Delivery {
        lost,
        capture_monotonic_ns: capture_utc_ns,
        capture_utc_ns,
        sent_monotonic_ns: 5,
        sent_utc_ns: 6,
    }
}

#[test]
fn mutated_binary_messages_never_panic() {
    let sound = lists().into_iter().enumerate().map(|(number, list)| {
        let (mut body, mut bytes) = (Vec::new(), Vec::new());
        binary::encode_list(&list, &mut body).unwrap();
        binary::encode(&body, &delivery(number as u64), &mut bytes);
        bytes
    });
    let target = Target {
        name: "binary",
        sound: sound.collect(),
        pieces: &["LCL\u{1}x\0", "LCL\u{1}", "\0\0"],
        // A light has 14 bytes in the message and 32 in memory.
        asked_per_byte: 3,
        decode: |bytes, taken| binary::decode(bytes, &mut taken.message),
        fault: |result, taken| match result {
            Ok(()) => fault_in(&taken.message),
            Err(error) => (!error.to_string().starts_with("byte ")).then(|| format!("no byte in: {error}")),
        },
    };
    survive(&target, 0x9e37_79b9_7f4a_7c15);
}

#[test]
fn mutated_json_messages_never_panic() {
    let sound = lists().into_iter().enumerate().map(|(number, list)| {
        let (mut plain, mut text) = (Vec::new(), Vec::new());
        write_list(&list, &mut plain).unwrap();
        json::encode(&plain, &delivery(number as u64), &mut text);
        text
    });
    let target = Target {
        name: "json",
        sound: sound.collect(),
        pieces: &[
            "{",
            "}",
            "[",
            "]",
            ",",
            ":",
            "\"",
            "null",
            "true",
            "-",
            ".",
            "e",
            "1e999",
            "-0.0",
            "1e-999",
            "\\u0000",
            "\\ud800",
            "18446744073709551616",
            "\"lights\":[",
            "\"stream\":{",
            "\"version\":1,",
            "\"power\":",
            "[[[[[[[[",
            "{\"a\":{\"a\":{\"a\":",
            "\"prefix_errors\":[[1,0.5],",
            "[0,0],[0,0],[0,0],[0,0],",
        ],
        // Lists grow by doubling: a pair of 8 bytes takes at least 6 bytes of text, a light of 32 bytes at
        // least 64.
        asked_per_byte: 6,
        decode: |bytes, taken| json::decode(bytes, &mut taken.message),
        fault: |result, taken| result.as_ref().ok().and_then(|()| fault_in(&taken.message)),
    };
    survive(&target, 0xd1b5_4a32_d192_ed03);
}

/// Checks that an accepted subscription can be written and read again, and selects no more lights than there
/// are.
fn subscription_fault(result: &Result<()>, taken: &Taken) -> Option<String> {
    result.as_ref().ok()?;
    let subscription = taken.subscription;
    let text = serde_json::to_vec(&Demand::Subscribe(subscription)).unwrap();
    let again = Subscription::from_message(&text);
    if again.as_ref().ok() != Some(&subscription) {
        return Some(format!("{subscription:?} became {again:?}"));
    }
    (subscription.light_count(&LightList::default()) > 0).then(|| "lights of an empty list".to_owned())
}

#[test]
fn mutated_queries_never_panic() {
    let sound = ["", "lights=64", "rate_hz=12.5&error=0.02", "queue=7&lights=64&error=0.02&rate_hz=10"];
    let target = Target {
        name: "query",
        sound: sound.map(|query| query.as_bytes().to_vec()).into(),
        pieces: &[
            "&", "=", "%", "%00", "%ff", "+", "lights=", "rate_hz=", "error=", "queue=", "1e999", "nan",
            "inf", "-0",
        ],
        // The bytes are converted to text, keys and values are decoded one by one, and an error quotes one of
        // them.
        asked_per_byte: 12,
        decode: |bytes, taken| {
            taken.subscription = Subscription::from_query(&String::from_utf8_lossy(bytes))?;
            Ok(())
        },
        fault: subscription_fault,
    };
    survive(&target, 0x94d0_49bb_1331_11eb);
}

#[test]
fn mutated_subscriptions_never_panic() {
    let sound = [
        "{\"subscribe\":{}}",
        "{\"subscribe\":{\"lights\":64,\"rate_hz\":10}}",
        "{\"subscribe\":{\"lights\":null,\"error\":0.02,\"queue\":64}}",
    ];
    let target = Target {
        name: "subscription",
        sound: sound.map(|text| text.as_bytes().to_vec()).into(),
        pieces: &[
            "{",
            "}",
            "[",
            "]",
            ",",
            ":",
            "\"",
            "null",
            "1e999",
            "-0.0",
            "1e39",
            "\\u0000",
            "\"subscribe\":",
            "\"lights\":",
            "\"rate_hz\":",
            "\"error\":",
            "\"queue\":",
            "18446744073709551616",
            "[[[[[[[[",
        ],
        asked_per_byte: 8,
        decode: |bytes, taken| {
            taken.subscription = Subscription::from_message(bytes)?;
            Ok(())
        },
        fault: subscription_fault,
    };
    survive(&target, 0x2545_f491_4f6c_dd1d);
}

/// The inputs with the largest growth: values that are short as text, under known and unknown keys.
#[test]
fn long_messages_take_a_small_multiple_of_their_length() {
    let stamp = r#""version":1,"sequence":1,"capture_time_ns":0,"lost_before":0,"frame_rate_hz":25.0"#;
    let light = r#"{"id":1,"direction":[0,1,0],"irradiance":[1,1,1],"spread_rad":0},"#;
    for (key, value, end) in [
        ("other", "0,", "0]"),
        ("other", "\"\\u0000\",", "0]"),
        ("other", "{\"\":0},", "0]"),
        ("prefix_errors", "[0,0],", "[0,0]]"),
        ("lights", light, "0]"),
        ("power", "0,", "0]"),
        ("stream", "0,", "0]"),
    ] {
        let values = value.repeat((1 << 20) / value.len());
        let text = format!("{{{stamp},\"{key}\":[{values}{end}}}");
        let mut message = Message::default();
        let (outcome, asked) = counted(|| json::decode(text.as_bytes(), &mut message));
        assert!(outcome.is_err());
        eprintln!("{key} {value}: {asked} bytes for {}", text.len());
        assert!(asked < 6 * text.len(), "{key} {value}: {asked} bytes for {}", text.len());
    }
}
