//! The program itself, as a user starts it.

use crate::kernel::{Layout, Node};
use crate::live::{VIVID, camera, config, limit};
use crate::loopback::wait;
use crate::vivid;
use std::fs;
use std::io::Read;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Its path in the guest.
const LIGHTCAST: &str = "/lightcast";

fn lightcast(arguments: &[&str]) -> Command {
    let mut command = Command::new(LIGHTCAST);
    command.args(arguments).stdin(Stdio::null());
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn program_lists_devices_for_people_and_for_programs() {
    vivid::fresh();
    let Output { status, stdout, stderr } = lightcast(&["devices", "--json"]).output().unwrap();
    assert!(status.success() && stderr.is_empty(), "{}", text(&stderr));
    let list: serde_json::Value = serde_json::from_slice(&stdout).unwrap();
    let device = list.as_array().unwrap().iter().find(|device| device["name"] == VIVID).unwrap();
    assert_eq!((&device["card"], &device["unsupported"]), (&"vivid".into(), &serde_json::Value::Null));
    let formats = device["formats"].as_array().unwrap();
    assert!(
        formats.iter().any(|format| format["name"] == "RG12" && format["is_supported"] == true),
        "{device}"
    );
    let controls = device["controls"].as_array().unwrap();
    let brightness = controls.iter().find(|control| control["name"] == "brightness").unwrap();
    assert_eq!((&brightness["default"], &brightness["maximum"]), (&128.into(), &255.into()));

    let output = lightcast(&["devices"]).output().unwrap();
    let lines = text(&output.stdout);
    for expected in [
        "platform:vivid-000",
        "  /dev/video0, vivid, driver vivid",
        "    RG12     16x16 to 16384x8640 at 60 Hz",
        "    brightness = 128 (0 to 255; default 128)",
    ] {
        let expected = expected.replace("/dev/video0", &vivid::capture_path().unwrap().display().to_string());
        assert!(lines.lines().any(|line| line == expected), "no line '{expected}' in:\n{lines}");
    }
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn program_records_so_many_frames() {
    vivid::fresh();
    let folder = tempfile::tempdir().unwrap();
    let layout = Layout::two_bytes(b"Y12 ", 160, 120);
    config(folder.path(), &camera(VIVID, layout), layout, 0x0fff);
    let path = |name: &str| folder.path().join(name).display().to_string();
    let arguments = ["record", "--config", &path("config.toml"), "--output", &path("new"), "--frames", "5"];
    let output = lightcast(&arguments).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let sidecar: serde_json::Value =
        serde_json::from_slice(&fs::read(path("new/recording.json")).unwrap()).unwrap();
    assert_eq!((&sidecar["frames_written"], &sidecar["is_complete"]), (&5.into(), &true.into()));
    assert_eq!((&sidecar["source"], &sidecar["frame_rate_hz"]), (&VIVID.into(), &60.0.into()));
    let again = lightcast(&arguments).output().unwrap();
    assert_eq!(again.status.code(), Some(2), "a recording is not written over");
}

/// The program runs, its camera is unplugged and plugged in again, and a signal ends it.
#[test]
#[ignore = "needs the guest: make test-camera"]
fn program_runs_on_after_a_loss_and_ends_on_a_signal() {
    vivid::fresh();
    let folder = tempfile::tempdir().unwrap();
    let layout = Layout::two_bytes(b"Y12 ", 160, 120);
    config(folder.path(), &camera(VIVID, layout), layout, 0x0fff);
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (configuration, lists) = (path("config.toml"), path("lists.jsonl"));
    let mut program = lightcast(&["run", "--config", &configuration, "--output", &lists])
        .stdout(Stdio::null())
        .stderr(fs::File::create(path("messages")).unwrap())
        .spawn()
        .unwrap();
    let count = || fs::read_to_string(&lists).unwrap_or_default().lines().count();
    let messages = || fs::read_to_string(path("messages")).unwrap();
    let until = |what: &str, is_so: &dyn Fn() -> bool| {
        let start = Instant::now();
        while !is_so() {
            assert!(start.elapsed() < limit(), "not {what}:\n{}", messages());
            wait(Duration::from_millis(20));
        }
    };
    until("some lists", &|| count() > 8);
    let holder = Node::open(&vivid::capture_path().unwrap()).unwrap();
    vivid::unplug();
    until("missed", &|| messages().matches("is not there").count() > 1);
    vivid::plug();
    let before = count();
    until("lists again", &|| count() > before + 8);
    drop(holder);
    let start = Instant::now();
    assert!(Command::new("kill").arg(program.id().to_string()).status().unwrap().success());
    let status = program.wait().unwrap();
    assert!(start.elapsed() < Duration::from_secs(3), "it took {:?} to end", start.elapsed());
    assert!(status.success(), "{status}");
    let messages = messages();
    assert!(!messages.contains("panicked"), "{messages}");
    assert!(messages.contains("1 restarts of the camera"), "{messages}");
    let mut text = String::new();
    fs::File::open(&lists).unwrap().read_to_string(&mut text).unwrap();
    for line in text.lines() {
        let list: serde_json::Value = serde_json::from_str(line).unwrap();
        assert_eq!(list["lights"].as_array().unwrap().len(), 8);
    }
}
