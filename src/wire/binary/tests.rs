use super::super::{read_list, write_list_line};
use super::*;
use glam::DVec3;
use lightcast_core::light::prefix;
use lightcast_core::math::angle_between;

const GOLDEN: &[u8] = include_bytes!("../../../tests/golden/message.bin");
const GOLDEN_JSON: &[u8] = include_bytes!("../../../tests/golden/message.json");

/// Marsaglia's xorshift64.
struct XorShift(u64);

impl XorShift {
    fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// From 0 to 1.
    fn fraction(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

const DELIVERY: Delivery = Delivery {
    lost: u64::MAX,
    capture_monotonic_ns: Some(-1),
    capture_utc_ns: Some(i64::MAX),
    sent_monotonic_ns: i64::MIN,
    sent_utc_ns: 1,
};

fn bytes_of(list: &LightList, delivery: &Delivery) -> Vec<u8> {
    let (mut body, mut bytes) = (vec![1], vec![2]);
    encode_list(list, &mut body).unwrap();
    encode(&body, delivery, &mut bytes);
    bytes
}

fn there_and_back(list: &LightList) -> LightList {
    let bytes = bytes_of(list, &DELIVERY);
    assert_eq!(bytes.len(), 120 + 8 * list.prefix_errors.len() + 14 * list.lights.len());
    let mut message = Message::default();
    decode(&bytes, &mut message).unwrap();
    assert_eq!(message.delivery, DELIVERY);
    message.list
}

/// Lights in all directions with irradiances over 14 decades and spreads over 9.
fn random_list(random: &mut XorShift, lights: u32) -> LightList {
    let mut light = |id| {
        let y = 2.0 * random.fraction() - 1.0;
        let (sin, cos) = (std::f64::consts::TAU * random.fraction()).sin_cos();
        let across = (1.0 - y * y).sqrt();
        Light {
            id,
            direction: [cos * across, y, sin * across].map(|v| v as f32),
            irradiance: [(); 3].map(|()| 10.0_f64.powf(14.0 * random.fraction() - 7.0) as f32),
            spread_rad: (PI * 10.0_f64.powf(-9.0 * random.fraction())) as f32,
        }
    };
    let mut list = LightList::default();
    list.lights.extend((0..lights).map(|id| light(3 * id)));
    list.stamp =
        Stamp { sequence: u64::MAX, capture_time_ns: i64::MIN, lost_before: 7, frame_rate_hz: 1e3 / 1001.0 };
    (list.filter_delay_frames, list.error) = (u32::MAX, Some(0.1));
    list.power = list.sum_of_lights();
    list.prefix_errors = vec![(8, 0.3), (16, f32::MIN_POSITIVE), (lights, 0.1)];
    list
}

#[test]
fn lights_keep_the_precision_that_the_protocol_states_and_all_else_is_exact() {
    let mut random = XorShift(0x9e37_79b9_7f4a_7c15);
    let (mut turned_deg, mut irradiance, mut spread) = (0.0_f64, 0.0_f64, 0.0_f64);
    for _ in 0..10 {
        let list = random_list(&mut random, MAX_LIGHTS as u32);
        let got = there_and_back(&list);
        let most = list.lights.iter().flat_map(|light| light.irradiance).fold(0.0, f32::max);
        for (wanted, got) in list.lights.iter().zip(&got.lights) {
            let apart = |wanted: f32, got: f32| (f64::from(got) / f64::from(wanted) - 1.0).abs();
            assert_eq!(wanted.id, got.id);
            turned_deg = turned_deg.max(
                angle_between(
                    DVec3::from(wanted.direction.map(f64::from)),
                    DVec3::from(got.direction.map(f64::from)),
                )
                .to_degrees(),
            );
            for (wanted, got) in wanted.irradiance.into_iter().zip(got.irradiance) {
                assert!(f64::from(wanted) > 1e-19 * f64::from(most));
                irradiance = irradiance.max(apart(wanted, got));
            }
            spread = spread.max(apart(wanted.spread_rad, got.spread_rad));
        }
        let mut rest = got;
        rest.lights.clone_from(&list.lights);
        assert_eq!(rest, list);
    }
    eprintln!(
        "{} lights: turned by {turned_deg:.5} degrees, irradiance {:.4} %, spread {:.4} %, at most",
        10 * MAX_LIGHTS,
        100.0 * irradiance,
        100.0 * spread
    );
    assert!(turned_deg < 0.004 && irradiance < 3.4e-4 && spread < 3.4e-4);
}

#[test]
fn what_has_been_sent_once_is_sent_again_without_change() {
    let once = there_and_back(&random_list(&mut XorShift(3), 2000));
    assert_eq!(there_and_back(&once), once);
}

#[test]
fn prefixes_keep_their_power_bit_for_bit() {
    let list = random_list(&mut XorShift(11), 300);
    let mut sent = LightList::default();
    for count in [1, 8, 64, 299, 300] {
        sent.copy_from(&list);
        prefix(&list.lights, count, &mut sent.lights);
        let got = there_and_back(&sent);
        assert_eq!(got.power.map(f64::to_bits), list.power.map(f64::to_bits));
        for (sum, power) in got.sum_of_lights().into_iter().zip(list.power) {
            assert!((sum / power - 1.0).abs() < 3.4e-4, "{count}: {sum} {power}");
        }
    }
}

#[test]
fn the_golden_message_is_read_and_written_to_the_byte() {
    let (mut from_bytes, mut from_json) = (Message::default(), Message::default());
    decode(GOLDEN, &mut from_bytes).unwrap();
    crate::wire::json::decode(GOLDEN_JSON, &mut from_json).unwrap();
    assert_eq!(from_bytes, from_json);
    assert_eq!(from_bytes.list.lights.len(), 12);
    assert_eq!(bytes_of(&from_json.list, &from_json.delivery), GOLDEN);
    let (mut list, mut text) = (Vec::new(), Vec::new());
    write_list_line(&from_bytes.list, &mut list).unwrap();
    crate::wire::json::encode(&list, &from_bytes.delivery, &mut text);
    assert_eq!(text, GOLDEN_JSON.trim_ascii_end());
}

#[test]
fn capture_times_are_known_both_or_not_at_all() {
    let list = LightList::default();
    let mut message = Message::default();
    for (monotonic_ns, utc_ns) in [(None, None), (Some(5), None), (None, Some(5))] {
        let delivery = Delivery { capture_monotonic_ns: monotonic_ns, capture_utc_ns: utc_ns, ..DELIVERY };
        decode(&bytes_of(&list, &delivery), &mut message).unwrap();
        let got = message.delivery;
        assert_eq!((got.capture_monotonic_ns, got.capture_utc_ns), (None, None));
        assert_eq!((got.lost, got.sent_utc_ns), (DELIVERY.lost, DELIVERY.sent_utc_ns));
    }
}

#[test]
fn hostile_numbers_are_replaced_and_the_message_is_sound() {
    let hostile = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, f32::MAX, 1e-45, 0.0, -0.0, 1e30, 2.0];
    let mut list = LightList::default();
    list.stamp.frame_rate_hz = f64::NAN;
    list.power = [f64::NAN, f64::MAX, f64::NEG_INFINITY];
    list.error = Some(f32::INFINITY);
    list.prefix_errors = hostile.iter().map(|&error| (u32::MAX, error)).collect();
    for (number, &value) in hostile.iter().enumerate() {
        let direction = [value, hostile[(number + 3) % hostile.len()], hostile[(number + 5) % hostile.len()]];
        list.lights.push(Light {
            id: number as u32,
            direction,
            irradiance: [value, value, 0.0],
            spread_rad: value,
        });
    }
    let got = there_and_back(&list);
    assert_eq!((got.stamp.frame_rate_hz, got.power, got.error), (0.0, [0.0, 1e36, 0.0], Some(0.0)));
    let errors: Vec<f32> = got.prefix_errors.iter().map(|&(_, error)| error).collect();
    assert_eq!(errors, [0.0, 0.0, 0.0, 0.0, f32::MAX, 1e-45, 0.0, 0.0, 1e30, 2.0]);
    let irradiances: Vec<f32> = got.lights.iter().map(|light| light.irradiance[0]).collect();
    assert_eq!(irradiances, [0.0, 0.0, 0.0, 0.0, 1e30, 0.0, 0.0, 0.0, 1e30, 0.0]);
    let spreads: Vec<f32> = got.lights.iter().map(|light| light.spread_rad).collect();
    let pi = std::f32::consts::PI;
    assert_eq!(spreads[..9], [0.0, 0.0, 0.0, 0.0, pi, 0.0, 0.0, 0.0, pi]);
    // The result can be written, and read again.
    let mut line = Vec::new();
    write_list_line(&got, &mut line).unwrap();
    read_list(&line, &mut LightList::default()).unwrap();
}

#[test]
fn a_dark_list_has_codes_of_0() {
    let mut list = random_list(&mut XorShift(5), 20);
    for light in &mut list.lights {
        light.irradiance = [0.0, -0.0, f32::NAN];
    }
    let bytes = bytes_of(&list, &DELIVERY);
    for light in bytes[120 + 24..].chunks_exact(14) {
        assert_eq!(light[6..12], [0; 6]);
    }
    assert!(there_and_back(&list).lights.iter().all(|light| light.irradiance == [0.0; 3]));
}

#[test]
fn lists_that_no_message_takes_are_refused() {
    let mut body = Vec::new();
    let mut refused = |list: &LightList| encode_list(list, &mut body).unwrap_err().to_string();
    let mut list = random_list(&mut XorShift(5), 20);
    list.lights[7].id = 65_536;
    assert_eq!(refused(&list), "light 7: its id 65536 is above 65535, the highest in a message");
    list.lights[7].id = list.lights[3].id;
    assert_eq!(refused(&list), "light 7: its id 9 is that of another light");
    list.lights[7].id = 65_535;
    list.prefix_errors = vec![(1, 0.0); 65];
    assert_eq!(refused(&list), "the list has 20 lights and 65 prefix errors; a message takes 16384 and 64");
    list.prefix_errors.clear();
    there_and_back(&list);
    let list = random_list(&mut XorShift(5), MAX_LIGHTS as u32 + 1);
    assert!(refused(&list).starts_with("the list has 16385 lights"));
}

#[test]
fn storage_is_used_again() {
    let list = random_list(&mut XorShift(5), 300);
    let bytes = bytes_of(&list, &DELIVERY);
    let mut message = Message::default();
    decode(&bytes, &mut message).unwrap();
    let places = |list: &LightList| (list.lights.as_ptr(), list.prefix_errors.as_ptr());
    let first = places(&message.list);
    decode(&bytes, &mut message).unwrap();
    assert_eq!(places(&message.list), first);
}

#[test]
fn a_longer_header_is_skipped_and_unknown_flags_are_passed_over() {
    let mut bytes = GOLDEN.to_vec();
    bytes[4..6].copy_from_slice(&133_u16.to_le_bytes());
    bytes[7] |= 0x80;
    bytes.splice(120..120, [0xff; 13]);
    let (mut longer, mut golden) = (Message::default(), Message::default());
    decode(&bytes, &mut longer).unwrap();
    decode(GOLDEN, &mut golden).unwrap();
    assert_eq!(longer, golden);
}

#[test]
fn faults_are_told_with_their_byte_and_change_nothing() {
    let whole = "the message has 328 bytes; with";
    let faults: &[(usize, &[u8], &str)] = &[
        (0, b"l", "byte 0: the message does not begin with LCL: it is no light list"),
        (3, &[2], "byte 3: the message is of version 2; this program reads version 1"),
        (3, &[0], "byte 3: the message is of version 0; this program reads version 1"),
        (4, &[119], "byte 4: a header of 119 bytes; it has 120 at least"),
        (4, &[121], "byte 328: the message has 328 bytes; with 5 prefix errors and 12 lights it has 329"),
        (4, &[255, 255], whole),
        (116, &[65], "byte 116: 65 prefix errors; 64 at most are read"),
        (116, &[4], "byte 320: the message has 328 bytes; with 4 prefix errors and 12 lights it has 320"),
        (118, &[13], whole),
        (118, &[11], whole),
        (118, &[1, 0x40], "byte 118: 16385 lights; 16384 at most are read"),
        (72, &f64::NAN.to_le_bytes(), "byte 72: the frame rate is NaN; it is from 0 to"),
        (72, &(-25.0_f64).to_le_bytes(), "byte 72: the frame rate is -2.5e1"),
        (80, &f64::INFINITY.to_le_bytes(), "byte 80: the power is inf; it is from 0 to 1e36"),
        (96, &(-1.0_f64).to_le_bytes(), "byte 96: the power is -1e0"),
        (108, &f32::NAN.to_le_bytes(), "byte 108: the error is NaN"),
        (112, &1.1e30_f32.to_le_bytes(), "byte 112: the highest irradiance is 1.1e30; it is from 0 to 1e30"),
        (112, &f32::NAN.to_le_bytes(), "byte 112: the highest irradiance is NaN"),
        (124, &(-1.0_f32).to_le_bytes(), "byte 124: the error of a prefix is -1e0"),
        (156, &f32::INFINITY.to_le_bytes(), "byte 156: the error of a prefix is inf"),
        (160 + 14, &[0, 0], "byte 174: light 1 has the id 0 of another"),
    ];
    let mut message = Message::default();
    decode(&bytes_of(&random_list(&mut XorShift(5), 2), &DELIVERY), &mut message).unwrap();
    let before = message.clone();
    for &(byte, patch, expected) in faults {
        let mut bytes = GOLDEN.to_vec();
        bytes[byte..byte + patch.len()].copy_from_slice(patch);
        let error = decode(&bytes, &mut message).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}\nis not\n{expected}");
        assert_eq!(message, before);
    }
    for length in 0..GOLDEN.len() {
        let error = decode(&GOLDEN[..length], &mut message).unwrap_err().to_string();
        let expected = match length {
            0..3 => "byte 0: the message does not begin".to_owned(),
            3 => "byte 3: the message ends before its version".to_owned(),
            _ => format!("byte {length}: the message "),
        };
        assert!(error.starts_with(&expected), "{length}: {error}");
    }
    let mut long = GOLDEN.to_vec();
    long.push(0);
    assert!(decode(&long, &mut message).is_err());
}
