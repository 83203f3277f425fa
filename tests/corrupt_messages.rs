//! Damaged messages: whatever comes from the network, taking it apart neither panics nor takes more memory than a small
//! multiple of its length.
//!
//! Every decoder gets mutations of sound messages and made-up bytes, with fixed seeds. Environment variable
//! `LIGHTCAST_FUZZ_INPUTS`: how many inputs in total; `make fuzz` runs ten million.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use lightcast::error::Result;
use lightcast::light::{Light, LightList, MAX_LIGHTS};
use lightcast::wire::{Delivery, Demand, Message, Subscription, binary, json};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Inputs in total where nothing is said: some seconds.
const INPUTS: usize = 200_000;

/// Bytes that a decoder may ask for beside a multiple of its input: what an error says, serde's scratch.
const FEW_BYTES: usize = 4096;

thread_local! {
    /// Bytes that this thread has asked for.
    static ASKED: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

fn count(bytes: usize) {
    // A thread that ends has no thread-local values any more.
    let _ = ASKED.try_with(|asked| asked.set(asked.get() + bytes));
}

#[expect(unsafe_code, reason = "an allocator cannot be written otherwise; it only forwards to the system's")]
// SAFETY: every call goes to the system allocator with the caller's own arguments; counting touches a
// const-initialised thread-local `Cell` without destructor, which neither allocates nor unwinds.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: as the caller's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: as the caller's.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size);
        // SAFETY: as the caller's.
        unsafe { System.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as the caller's.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Marsaglia's xorshift64.
struct XorShift(u64);

impl XorShift {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }
}

/// Where decoders put what they take.
#[derive(Default)]
struct Taken {
    message: Message,
    subscription: Subscription,
}

/// A decoder under test.
struct Target {
    name: &'static str,
    /// Sound messages, all of which are taken.
    sound: Vec<Vec<u8>>,
    /// What messages are made of: a mutation puts one of these in.
    pieces: &'static [&'static str],
    /// Bytes that may be asked for, for every byte of the input.
    asked_per_byte: usize,
    decode: fn(&[u8], &mut Taken) -> Result<()>,
    /// What is wrong with what was taken, or with the error of what was not.
    fault: fn(&Result<()>, &Taken) -> Option<String>,
}

/// Changes some bytes, puts pieces in, takes ranges out or doubles them, or cuts; every eighth time all is made up.
fn mutate(input: &mut Vec<u8>, target: &Target, random: &mut XorShift) {
    input.clear();
    if random.below(8) == 0 {
        let length = random.below(200);
        for _ in 0..length {
            match random.below(4) {
                0 if !target.pieces.is_empty() => {
                    input.extend_from_slice(target.pieces[random.below(target.pieces.len())].as_bytes());
                }
                1 => input.push(random.next() as u8),
                _ => input.push(b' ' + random.below(95) as u8),
            }
        }
        return;
    }
    input.extend_from_slice(&target.sound[random.below(target.sound.len())]);
    for _ in 0..1 + random.below(4) * random.below(2) {
        // The heads of binary messages are where lengths are: half of the time they are hit.
        let range = if random.below(2) == 0 { input.len() } else { input.len().min(160) };
        if range == 0 {
            return;
        }
        let at = random.below(range);
        let end = input.len().min(at + 1 + random.below(24));
        match random.below(10) {
            0 => input[at] ^= 1 << random.below(8),
            1 => input[at] = 0xff,
            2 => input[at] = 0,
            3 => input[at] = random.next() as u8,
            4 if !target.pieces.is_empty() => {
                let piece = target.pieces[random.below(target.pieces.len())].as_bytes();
                let end = if random.below(2) == 0 { at } else { end };
                input.splice(at..end, piece.iter().copied());
            }
            4 | 5 => input[at] = b'0' + random.below(10) as u8,
            6 => drop(input.drain(at..end)),
            7 => {
                let range = input[at..end].to_vec();
                input.splice(at..at, range);
            }
            8 => input.truncate(at),
            _ => {
                let word = input[at..end].len().min(4);
                let value = [0, 1, 0x7f80_0000, 0x7fc0_0000, 0x8000_0000, u32::MAX][random.below(6)];
                input[at..at + word].copy_from_slice(&u32::to_le_bytes(value)[..word]);
            }
        }
    }
}

/// The input as it can be put into a test.
fn shown(input: &[u8]) -> String {
    let mut text = format!("{} bytes: b\"{}\"", input.len(), input.escape_ascii());
    let most = 20_000;
    if text.len() > most {
        text.truncate(most);
        write!(text, "... (cut)").unwrap();
    }
    text
}

/// Whether an input is taken; fails with the input where something is wrong.
fn decode(target: &Target, input: &[u8], taken: &mut Taken) -> bool {
    let limit = target.asked_per_byte * input.len() + FEW_BYTES;
    let before = ASKED.get();
    let result = catch_unwind(AssertUnwindSafe(|| (target.decode)(input, taken)));
    let asked = ASKED.get() - before;
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
        mutate(&mut input, target, &mut random);
        bytes += input.len();
        if number % 4 == 0 {
            taken = Taken::default(); // no storage to use again
        }
        sound += usize::from(decode(target, &input, &mut taken));
    }
    let mean = bytes / inputs.max(1);
    eprintln!("{}: {inputs} inputs of {mean} bytes on average, {sound} of them sound", target.name);
    // Some mutations hit nothing that matters, none of them all.
    assert!(0 < sound && sound < inputs, "{}: {sound} of {inputs}", target.name);
}

/// What is wrong with a message that was taken.
fn fault_in(message: &Message) -> Option<String> {
    let list = &message.list;
    let lights_sound = list.lights.iter().all(|light| {
        let length = light.direction.iter().map(|v| v * v).sum::<f32>().sqrt();
        (length - 1.0).abs() < 2e-3
            && light.irradiance.iter().all(|v| (0.0..=1e30).contains(v))
            && (0.0..=std::f32::consts::PI).contains(&light.spread_rad)
    });
    let errors_sound = list.prefix_errors.iter().all(|&(_, error)| error >= 0.0 && error.is_finite());
    let power_sound = list.power.iter().all(|v| (0.0..=1e36).contains(v));
    let mut ids: Vec<u32> = list.lights.iter().map(|light| light.id).collect();
    ids.sort_unstable();
    ids.dedup();
    let faults = [
        (!lights_sound, "a light is not sound"),
        (!errors_sound || !(list.error >= 0.0 && list.error.is_finite()), "an error is not sound"),
        (!power_sound || !list.stamp.frame_rate_hz.is_finite(), "power or rate is not sound"),
        (list.lights.len() > MAX_LIGHTS || ids.len() < list.lights.len(), "lights are too many or double"),
    ];
    faults.iter().find(|(is_so, _)| *is_so).map(|(_, fault)| (*fault).to_owned())
}

/// Lists with some, one and no light.
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
        // A light has 14 bytes there and 32 here.
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
        let mut text = Vec::new();
        json::encode(&serde_json::to_vec(&list).unwrap(), &delivery(number as u64), &mut text);
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
        // Lists grow by doubling: a pair of 8 bytes is written in 6 at least, a light of 32 in 64.
        asked_per_byte: 6,
        decode: |bytes, taken| json::decode(bytes, &mut taken.message),
        fault: |result, taken| result.as_ref().ok().and_then(|()| fault_in(&taken.message)),
    };
    survive(&target, 0xd1b5_4a32_d192_ed03);
}

/// A subscription that was taken is written and taken again, and chooses no more lights than there are.
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
        // Keys and values are decoded one by one, and an error says one of them again.
        asked_per_byte: 8,
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
