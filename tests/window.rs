//! The window, opened and closed as by a user, on a separate virtual display.
#![cfg(all(feature = "render", target_os = "linux"))]
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

#[path = "clients/server.rs"]
mod server;

use lightcast::files::write_exr;
use lightcast_core::image::{Frame, Pixels};
use server::{Guard, Server};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

fn say_skipped(why: &str) {
    // Not eprintln!, which the test harness swallows when a test passes.
    let _ = writeln!(std::io::stderr(), "skipped: window: {why}");
}

/// A display and its number; `None` where there is no Xvfb, after reporting it.
fn display() -> Option<(Guard, String)> {
    // Xvfb itself finds a free number, and writes it to the given descriptor.
    let command = Command::new("Xvfb")
        .args(["-displayfd", "1", "-screen", "0", "320x240x24", "-nolisten", "tcp"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn();
    let Ok(mut child) = command else {
        say_skipped("there is no Xvfb");
        return None;
    };
    let mut number = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut number).unwrap();
    let guard = Guard(child);
    if number.trim().is_empty() {
        say_skipped("Xvfb does not start");
        return None;
    }
    Some((guard, format!(":{}", number.trim())))
}

fn lightcast() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lightcast"));
    command.env_remove("RUST_LOG").env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn lists() -> String {
    let list = |sequence: u64| {
        let time_ns = sequence * 40_000_000;
        let blue = 1.0 + sequence as f64;
        format!(
            "{{\"version\":1,\"sequence\":{sequence},\"capture_time_ns\":{time_ns},\"lost_before\":0,\"frame_rate_hz\":25.0,\
             \"filter_delay_frames\":0,\"unit\":\"relative\",\"power\":[3.0,3.0,{blue}],\"error\":0.1,\
             \"prefix_errors\":[],\"lights\":[{{\"id\":0,\"direction\":[0.6,0.8,0.0],\
             \"irradiance\":[3.0,3.0,{blue}],\"spread_rad\":0.1}}]}}\n"
        )
    };
    (0..20).map(list).collect()
}

fn send_term(child: &Child) {
    let status = Command::new("sh").args(["-c", &format!("kill -TERM {}", child.id())]).status();
    assert!(status.unwrap().success());
}

/// Opens a window on `input`, waits for its first frame, and closes it by a signal; returns its messages.
fn opened_and_closed(display: &str, input: &Path, options: &[&str]) -> Option<String> {
    let mut command = lightcast();
    command.arg("render").arg(input).args(["--size", "64x48", "--shadow-map-size", "32"]).args(options);
    let mut window = Guard(command.env("DISPLAY", display).spawn().unwrap());
    let mut reader = BufReader::new(window.0.stderr.take().unwrap());
    let mut messages = String::new();
    while !messages.contains("first frame") {
        if reader.read_line(&mut messages).unwrap() == 0 {
            // It ended by itself: an adapter that is missing, or cannot draw on windows, is not a fault of
            // the program.
            assert!(messages.contains("there is no graphics adapter"), "{messages}");
            say_skipped(messages.lines().last().unwrap_or_default());
            return None;
        }
    }
    send_term(&window.0);
    reader.read_to_string(&mut messages).unwrap();
    assert_eq!(window.0.wait().unwrap().code(), Some(0), "{messages}");
    Some(messages)
}

/// Number of lists that a window has shown, from its summary.
fn shown(messages: &str) -> u64 {
    let window =
        messages.lines().find(|line| line.starts_with("window ")).unwrap_or_else(|| panic!("{messages}"));
    window.split_whitespace().nth(1).unwrap().parse().unwrap()
}

#[test]
fn lists_are_shown_in_a_window_until_a_signal_closes_it() {
    let Some((_xvfb, display)) = display() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("lists.jsonl");
    fs::write(&file, lists()).unwrap();
    let Some(messages) = opened_and_closed(&display, &file, &[]) else { return };
    assert!(shown(&messages) > 0, "{messages}");
    let day = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/replay.toml");
    let Some(messages) = opened_and_closed(&display, &day, &["--budget", "50"]) else { return };
    assert!(shown(&messages) > 0, "{messages}");
    let sky = folder.path().join("sky.exr");
    let pixels = Pixels::Radiance([0.5f32, 0.75, 1.0].repeat(16 * 8));
    let frame = Frame { width: 16, height: 8, channels: 3, pixels, ..Frame::default() };
    write_exr(&sky, &frame, None, false).unwrap();
    if opened_and_closed(&display, &sky, &[]).is_none() {
        return;
    }
    let server = Server::start();
    let Some(messages) = opened_and_closed(&display, Path::new(&server.url), &[]) else { return };
    assert!(messages.contains("connected to ws://"), "{messages}");
    assert!(shown(&messages) > 0, "{messages}");
}

#[test]
fn without_a_display_the_message_names_the_option_that_needs_none() {
    let run = lightcast().args(["render", "sky.hdr"]).output().unwrap();
    let messages = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(2), "{messages}");
    assert!(messages.contains("--output"), "{messages}");
}

#[test]
fn a_display_that_does_not_answer_is_none() {
    // Display 9999 would be a socket on which nobody listens.
    let run = lightcast().args(["render", "sky.hdr"]).env("DISPLAY", ":9999").output().unwrap();
    let messages = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(2), "{messages}");
    assert!(messages.contains("--output"), "{messages}");
}

#[test]
fn a_budget_is_for_a_window() {
    let run =
        lightcast().args(["render", "sky.hdr", "--output", "a.png", "--budget", "16"]).output().unwrap();
    assert_eq!(run.status.code(), Some(2));
}
