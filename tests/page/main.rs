//! The page and the JavaScript client in a browser, as their users see them. Screenshots are written to
//! `target/page`.
#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod browser;
mod program;

use browser::Browser;
use program::Program;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

const WIDE: (u32, u32) = (1280, 800);
const NARROW: (u32, u32) = (360, 740);
const LIVE: &str = "document.body.dataset.state === 'live'";

fn pictures() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("page")
}

#[test]
fn the_page_in_a_browser() {
    let browser = match Browser::start() {
        Ok(browser) => browser,
        Err(why) => {
            // Not eprintln!, which the test harness swallows when a test passes.
            let _ = writeln!(std::io::stderr(), "skipped: page: {why}");
            return;
        }
    };
    let program = Program::start("127.0.0.1:0", None);
    let url = format!("http://{}/", program.address);
    browser.resize(WIDE.0, WIDE.1, false);
    browser.open(&url);
    lights_arrive_and_move(&browser);
    the_numbers_of_the_server_are_shown(&browser);
    it_fits_and_is_drawn(&browser);
    the_slider_changes_the_number_of_lights(&browser);
    the_client_reads_messages(&browser);
    assert_eq!(browser.errors(), [""; 0]);
    let address = program.address.clone();
    drop(program);
    a_lost_connection_comes_back(&browser, &address);
    a_token_is_asked_for(&browser);
    drop(browser);
}

fn lights_arrive_and_move(browser: &Browser) {
    browser.until(LIVE);
    browser.until("document.body.dataset.lights === '64'");
    let sequence = browser.value("Number(document.body.dataset.sequence)").as_f64().unwrap();
    browser.until(&format!("Number(document.body.dataset.sequence) > {}", sequence + 20.0));
    let direction = browser.value("document.body.dataset.brightest");
    browser.until(&format!("document.body.dataset.brightest !== {direction}"));
    browser.until("document.getElementById('arriving').textContent === '64'");
}

fn the_numbers_of_the_server_are_shown(browser: &Browser) {
    let map = "Number(document.body.dataset.mapSequence)";
    browser.until(&format!("{map} > 0"));
    let first = browser.value(map).as_f64().unwrap();
    browser.until(&format!("{map} > {first}"));
    browser.until("document.getElementById('map-note').textContent.includes('rim at 90°')");
    for stage in ["source", "calibrate", "light", "filter", "board"] {
        let row = format!(
            "[...document.querySelectorAll('#stage-rows tr')].some((row) => row.children[0].textContent === '{stage}' \
             && Number(row.children[1].textContent) > 0 && Number(row.children[3].textContent.replace(/,/g, '')) > 0)"
        );
        browser.until(&row);
    }
    // A replay at its own rate has capture times; on one machine a list is less than a few seconds old.
    browser.until("parseFloat(document.getElementById('age').textContent) < 5000");
    browser.until("parseFloat(document.getElementById('rate').textContent) > 1");
    browser.until("document.getElementById('delay').textContent === '160 ms'");
}

/// Checks that nothing is wider than the screen, and that both pictures show more than their backgrounds.
fn it_fits_and_is_drawn(browser: &Browser) {
    for ((width, height), name, is_phone) in [(WIDE, "wide", false), (NARROW, "narrow", true)] {
        browser.resize(width, height, is_phone);
        browser.until(&format!("innerWidth === {width} && document.documentElement.scrollWidth === {width}"));
        let beyond = "[...document.querySelectorAll('body *')].filter((e) => { \
            const box = e.getBoundingClientRect(); return box.left < 0 || box.right > innerWidth; }).map((e) => e.id || e.tagName)";
        assert_eq!(browser.value(beyond), json!([]), "{name}");
        if is_phone {
            // The whole page in one picture.
            let whole = browser.value("document.documentElement.scrollHeight").as_u64().unwrap();
            browser.resize(width, u32::try_from(whole).unwrap(), true);
        }
        for element in ["disc", "view"] {
            let start = Instant::now();
            loop {
                let picture = browser.picture(&pictures().join(format!("{name}.png")));
                if colours_in(browser, &picture, element, width) > 200 {
                    break;
                }
                assert!(start.elapsed().as_secs() < 60, "{name}: nothing is drawn in {element}");
            }
        }
    }
    browser.resize(WIDE.0, WIDE.1, false);
}

/// Number of colours in the part of a screenshot that shows an element.
fn colours_in(browser: &Browser, picture: &image::RgbImage, element: &str, width: u32) -> usize {
    let expression = format!(
        "(({{x, y, width, height}}) => [x, y, width, height])(document.getElementById('{element}').getBoundingClientRect())"
    );
    let place: [f64; 4] = serde_json::from_value(browser.value(&expression)).unwrap();
    let scale = f64::from(picture.width()) / f64::from(width);
    let [x, y, width, height] = place.map(|part| (part * scale) as u32);
    let part = image::imageops::crop_imm(picture, x, y, width, height).to_image();
    part.pixels().collect::<std::collections::HashSet<_>>().len()
}

fn the_slider_changes_the_number_of_lights(browser: &Browser) {
    let mut errors = Vec::new();
    for (keys, lights) in [("\u{e010}", 64), ("\u{e011}", 1), ("\u{e014}\u{e014}\u{e014}\u{e014}\u{e014}", 8)]
    {
        browser.press("count", keys);
        browser.until(&format!("document.body.dataset.lights === '{lights}'"));
        browser.until(&format!("document.getElementById('arriving').textContent === '{lights}'"));
        errors.push(least_error(browser));
    }
    assert!(errors[0] < errors[2] && errors[2] < errors[1], "{errors:?}");
    assert_eq!(browser.value("document.getElementById('count-asked').textContent"), "8 of 64");
    browser.press("count", "\u{e010}");
    browser.until("document.body.dataset.lights === '64'");
}

/// The smallest of the errors shown over some time: where the sequence restarts, the light jumps, and so does
/// the error.
fn least_error(browser: &Browser) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..30 {
        let error = browser.value("parseFloat(document.getElementById('error').textContent)");
        least = least.min(error.as_f64().unwrap());
        browser::pause();
    }
    least
}

/// Damaged versions of the message that pins the protocol, and the client's error for each.
fn malformed(golden: &[u8]) -> Vec<(Vec<u8>, &'static str)> {
    let patches: [(usize, &[u8], &str); 10] = [
        (0, b"l", "byte 0: does not begin with LCL"),
        (3, &[2], "byte 3: is of version 2"),
        (116, &[65], "byte 116: 65 prefix errors"),
        (118, &16_385_u16.to_le_bytes(), "byte 118: 16385 lights"),
        (72, &(-25.0_f64).to_le_bytes(), "frame_rate_hz: is no number from 0 on"),
        (80, &f64::NAN.to_le_bytes(), "power: is not three numbers"),
        (108, &(-0.5_f32).to_le_bytes(), "error: is no number from 0 on"),
        (112, &f32::NAN.to_le_bytes(), "byte 112: the brightest is not from 0"),
        (124, &(-0.5_f32).to_le_bytes(), "prefix_errors: is not pairs of a count and an error from 0 on"),
        (174, &[0, 0], "light 1: a light before it has the id 0"),
    ];
    let patched = |(byte, patch, fault): (usize, &[u8], _)| {
        let mut bytes = golden.to_vec();
        bytes[byte..byte + patch.len()].copy_from_slice(patch);
        (bytes, fault)
    };
    patches.map(patched).into()
}

/// Checks that the message that pins the protocol decodes to its JSON, that truncated and invalid messages
/// are refused, and that lists are also received as JSON.
fn the_client_reads_messages(browser: &Browser) {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let bytes = std::fs::read(golden.join("message.bin")).unwrap();
    let text = std::fs::read_to_string(golden.join("message.json")).unwrap();
    let malformed = malformed(&bytes);
    let script = "const [bytes, text, malformed, done] = arguments; (async () => { \
        const { LightcastClient, decodeBinary, decodeJson } = await import('/lightcast.js'); \
        const { buffer } = new Uint8Array(bytes); \
        let faults = 0; \
        for (let length = 0; length < bytes.length; length++) { \
            try { decodeBinary(buffer.slice(0, length)); } catch { faults++; } } \
        const told = malformed.map((bytes) => { \
            try { decodeBinary(new Uint8Array(bytes).buffer); return ''; } catch ({ message }) { return message; } }); \
        const url = new URL('/ws', location.href); url.protocol = 'ws:'; \
        const client = new LightcastClient(url, { format: 'json', subscription: { lights: 3 } }); \
        const list = await new Promise((come) => { \
            client.addEventListener('list', ({ detail }) => come(detail)); client.connect(); }); \
        const answer = await new Promise((come) => { \
            client.addEventListener('answer', ({ detail }) => come(detail)); client.subscribe({ lights: 2 }); }); \
        client.close(); \
        return { binary: decodeBinary(buffer), json: decodeJson(text), faults, told, list, answer, \
            state: client.state.state }; \
        })().then(done, (error) => done(String(error)))";
    let inputs: Vec<_> = malformed.iter().map(|(bytes, _)| bytes).collect();
    let found = browser.run(script, &json!([bytes, text, inputs]));
    assert!(found.is_object(), "{found}");
    let expected: Value = serde_json::from_str(&text).unwrap();
    same(&found["json"], &expected, "json");
    same(&found["binary"], &expected, "binary");
    assert_eq!(found["faults"], bytes.len());
    for (told, (_, fault)) in found["told"].as_array().unwrap().iter().zip(&malformed) {
        assert!(told.as_str().unwrap().contains(fault), "{told} is not {fault}");
    }
    assert_eq!(found["list"]["lights"].as_array().unwrap().len(), 3);
    assert_eq!(found["answer"]["subscribed"]["lights"], 2);
    assert_eq!(found["state"], "closed");
}

/// Asserts the same keys and values, with numbers equal to the precision of JavaScript and f32.
fn same(found: &Value, expected: &Value, place: &str) {
    match (found, expected) {
        (Value::Object(a), Value::Object(b)) => {
            assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>(), "{place}");
            for (key, value) in b {
                same(&a[key], value, &format!("{place}.{key}"));
            }
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{place}");
            for (index, (a, b)) in a.iter().zip(b).enumerate() {
                same(a, b, &format!("{place}[{index}]"));
            }
        }
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            assert!((a - b).abs() <= 2e-7 * b.abs(), "{place}: {a} is not {b}");
        }
        _ => assert_eq!(found, expected, "{place}"),
    }
}

fn a_lost_connection_comes_back(browser: &Browser, address: &str) {
    browser.until("document.body.dataset.state === 'closed'");
    browser.until("document.getElementById('state-text').textContent.startsWith('disconnected')");
    let before = browser.value("document.body.dataset.sequence");
    let _program = Program::start(address, None);
    browser.until(LIVE);
    browser.until(&format!("document.body.dataset.sequence !== {before}"));
    browser.until("document.body.dataset.lights === '64'");
}

fn a_token_is_asked_for(browser: &Browser) {
    let token = "a-token_that.is~long";
    let program = Program::start("127.0.0.1:0", Some(token));
    browser.open(&format!("http://{}/", program.address));
    browser.until("document.body.dataset.state === 'token'");
    browser.press("token", "another-token-than-that\n");
    browser.until("document.getElementById('token-fault').textContent.includes('not take this token')");
    browser.clear("token");
    browser.press("token", &format!("{token}\n"));
    browser.until(LIVE);
    browser.until("Number(document.body.dataset.mapSequence) > 0");
    // It is kept for the tab, and can be given in the address, from which it is removed.
    browser.reload();
    browser.until(LIVE);
    browser.value("sessionStorage.clear()");
    browser.open("about:blank");
    browser.open(&format!("http://{}/#token={token}", program.address));
    browser.until(LIVE);
    assert_eq!(browser.value("location.hash"), "");
}
