//! Every fault that can be injected into the drivers, under the running service: it is reported and counted,
//! the filter is informed of the gap, and lists continue. Invariants of every run are checked at its end
//! ([`Live::end`]).

use crate::frames::{codes, lamp};
use crate::kernel::{Layout, Node};
use crate::live::{LOOPBACK, Live, VIVID, camera, config};
use crate::loopback::{Loopback, wait};
use crate::messages;
use crate::vivid::{self, Fault};
use lightcast::files::read;
use lightcast::service::{OpenedSource, RecordOptions};
use lightcast::source::LiveCamera as _;
use lightcast::source::v4l2::{V4l2Camera, V4l2Options};
use lightcast_core::image::{Frame, Pixels};
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The pictures are small, since faults do not depend on them. With two bytes per pixel one fills whole
/// pages, as the loopback requires.
const SIZE: [u32; 2] = [160, 128];

const RATE_HZ: f64 = 60.0;

const DROPPED: &str = "frames dropped by the kernel";
const FAULTY: &str = "faulty frames";
const SHORT: &str = "short frames";
const OUT_OF_ORDER: &str = "frames out of order";
const MISSED: &str = "frames missed while the camera was away";
const RESTARTS: &str = "restarts of the camera";

fn layout(four_cc: &[u8; 4]) -> Layout {
    Layout::two_bytes(four_cc, SIZE[0], SIZE[1])
}

/// A service that makes lights of vivid's own picture. The folder has its files.
fn watching(source: &str) -> (Live, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let live = Live::start(&config(folder.path(), source, layout(b"Y12 "), 0x0fff), None);
    (live, folder)
}

/// The same with a newly loaded vivid, after some frames.
fn running() -> (Live, TempDir) {
    vivid::fresh();
    let (live, folder) = watching(&camera(VIVID, layout(b"Y12 ")));
    live.run_on(8);
    (live, folder)
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn faulty_buffer_is_counted_and_skipped() {
    let (live, _folder) = running();
    vivid::inject(Fault::BufferError);
    live.until("counted", |live| live.count(FAULTY) > 0);
    live.run_on(8);
    let ended = live.end();
    assert_eq!(ended.count(FAULTY), 1);
    ended.has_no_restarts();
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn frames_that_the_kernel_drops_are_counted() {
    let (live, _folder) = running();
    let (before, dropped_before) = (live.frames(), live.count(DROPPED));
    vivid::inject(Fault::DroppedPercent(50));
    live.run_on(60);
    vivid::inject(Fault::DroppedPercent(0));
    live.run_on(8);
    let (came, dropped) = (live.frames() - before, live.count(DROPPED) - dropped_before);
    // Half of the frames were dropped during 60 of the 68 captured ones; the bound allows for chance (five
    // standard deviations).
    assert!(dropped >= 30, "{dropped} of {}", came + dropped);
    let ended = live.end();
    ended.has_no_restarts();
    // The driver's clock gives the number of frames; it occasionally gives a number twice.
    let ((first, first_ns, _), (last, last_ns, _)) = (ended.stamps[0], *ended.stamps.last().unwrap());
    let frames = (last_ns - first_ns) as f64 * 1e-9 * RATE_HZ;
    assert!(((last - first) as f64 - frames).abs() < 4.0, "{first} to {last} in the time of {frames}");
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn silent_camera_is_started_again() {
    let (live, _folder) = running();
    vivid::inject(Fault::DroppedPercent(100));
    live.until("given up", |live| live.count(RESTARTS) > 0);
    vivid::inject(Fault::DroppedPercent(0));
    live.run_on(8);
    let ended = live.end();
    assert!(messages::count("gave nothing for 2 s; starting it again") > 0, "{}", messages::said());
    assert!(ended.count(MISSED) >= 110, "two seconds of 60 Hz, less what had come: {}", ended.count(MISSED));
    assert!(ended.longest_gap() >= 110, "the filter is told: {:?}", ended.stamps);
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn refused_buffers_are_asked_for_again() {
    vivid::fresh();
    vivid::inject(Fault::RequestBuffers);
    let (live, _folder) = watching(&camera(VIVID, layout(b"Y12 ")));
    live.run_on(8);
    live.end().has_no_restarts();
    let refused = "does not start to stream: Invalid argument (os error 22); trying again (attempt 1)";
    assert_eq!(messages::count(refused), 1, "{}", messages::said());
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn stream_that_does_not_start_is_started_again() {
    let (live, _folder) = running();
    vivid::inject(Fault::StreamOn);
    vivid::inject(Fault::Fatal);
    live.until("lost", |live| live.count(RESTARTS) > 0);
    live.run_on(8);
    live.end().has_one_restart("gives no more frames: Input/output error (os error 5)");
    let refused = "does not start to stream: Invalid argument (os error 22); trying again";
    assert_eq!(messages::count(refused), 1, "{}", messages::said());
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn buffer_that_is_not_taken_back_restarts_the_stream() {
    let (live, _folder) = running();
    vivid::inject(Fault::Queue);
    live.until("lost", |live| live.count(RESTARTS) > 0);
    live.run_on(8);
    live.end().has_one_restart("takes no buffer back: Invalid argument (os error 22)");
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn fatal_error_restarts_the_stream() {
    let (live, _folder) = running();
    vivid::inject(Fault::Fatal);
    live.until("lost", |live| live.count(RESTARTS) > 0);
    live.run_on(8);
    live.end().has_one_restart("gives no more frames: Input/output error (os error 5)");
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn disconnected_camera_is_found_when_it_is_back() {
    let (live, _folder) = running();
    // The driver restores the device when its last open handle is closed.
    let holder = Node::open(&vivid::capture_path().unwrap()).unwrap();
    vivid::inject(Fault::Disconnect);
    live.until("missed", |_| messages::count(": is not there") > 1);
    let frames = live.frames();
    drop(holder);
    live.run_on(8);
    let ended = live.end();
    ended.has_one_restart("gives no more frames: No such device (os error 19)");
    assert!(ended.count(MISSED) > 0 && ended.longest_gap() >= ended.count(MISSED), "{:?}", ended.stamps);
    assert!(ended.stamps.last().unwrap().0 > frames, "lists go on");
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn unplugged_camera_is_found_under_another_number() {
    let (live, _folder) = running();
    let path = vivid::capture_path().unwrap();
    // The number of the old node is in use as long as the node is open.
    let holder = Node::open(&path).unwrap();
    vivid::unplug();
    live.until("missed", |_| messages::count(": is not there") > 1);
    vivid::plug();
    assert_ne!(vivid::capture_path().unwrap(), path);
    live.run_on(8);
    let ended = live.end();
    ended.has_one_restart("gives no more frames: No such device (os error 19)");
    assert!(ended.count(MISSED) > 0 && ended.longest_gap() >= ended.count(MISSED), "{:?}", ended.stamps);
    drop(holder);
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn camera_that_is_back_with_other_settings_is_set_up_as_before() {
    vivid::fresh();
    // For example, another program set it up; the configuration does not specify format and size.
    let set_up = V4l2Options {
        device: VIVID.to_owned(),
        format: Some("Y12".to_owned()),
        size: Some(SIZE),
        ..V4l2Options::default()
    };
    V4l2Camera::open(set_up).unwrap();
    let (live, _folder) = watching(&format!("kind = \"camera\"\ndevice = \"{VIVID}\"\nformat = \"Y12\""));
    live.run_on(8);
    vivid::fresh();
    live.run_on(8);
    live.end().has_one_restart("No such device (os error 19)");
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn end_does_not_wait_for_a_camera_that_is_away() {
    let (live, _folder) = running();
    vivid::unplug();
    // The fourth attempt comes after 0.7 s, the sixth after 3.1 s, the seventh 3.2 s later.
    live.until("tried often", |_| messages::count("trying again (attempt 4)") > 0);
    wait(Duration::from_secs(3));
    let ended = live.end();
    assert_eq!(ended.count(RESTARTS), 1);
    vivid::plug();
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn camera_in_use_is_tried_until_it_is_free() {
    vivid::fresh();
    let folder = tempfile::tempdir().unwrap();
    let config = config(folder.path(), &camera(VIVID, layout(b"Y12 ")), layout(b"Y12 "), 0x0fff);
    messages::listen();
    let input = OpenedSource::open(&config).unwrap();
    let options = V4l2Options {
        device: VIVID.to_owned(),
        format: Some("Y12".to_owned()),
        size: Some(SIZE),
        ..V4l2Options::default()
    };
    let mut other = V4l2Camera::open(options).unwrap();
    other.start().unwrap();
    let live = Live::start_with(&config, input, None);
    live.until("refused", |_| messages::count("trying again (attempt 2)") > 0);
    assert!(messages::count("another program") > 0, "{}", messages::said());
    assert!(messages::count("os error 16") > 0, "EBUSY: {}", messages::said());
    other.stop();
    live.run_on(8);
    live.end().has_no_restarts();
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn numbers_that_wrap_around_are_no_gap() {
    vivid::fresh();
    vivid::inject(Fault::WrapSequence);
    let (live, _folder) = watching(&camera(VIVID, layout(b"Y12 ")));
    let start = Instant::now();
    live.until("wrapped", |live| live.frames() > 0 && start.elapsed() > Duration::from_secs(3));
    live.run_on(8);
    let ended = live.end();
    ended.has_no_restarts();
    assert_eq!(ended.count(OUT_OF_ORDER), 0, "numbers ran back");
    let ((first, first_ns, _), (last, last_ns, _)) = (ended.stamps[0], *ended.stamps.last().unwrap());
    let frames = (last_ns - first_ns) as f64 * 1e-9 * RATE_HZ;
    assert!(frames > 140.0, "vivid wraps after 128 frames, these are {frames}");
    assert!(((last - first) as f64 - frames).abs() < 4.0, "{first} to {last} in the time of {frames}");
}

/// A loopback with its first picture, and a service with `links` that makes lights of it.
fn fed(links: &str, recording: Option<RecordOptions>, folder: &Path) -> (Loopback, Live) {
    let mut writer = Loopback::open(layout(b"Y16 "));
    writer.write(lamp(layout(b"Y16 "), 0, 0xffff));
    let source = format!("{}\nlinks = \"{links}\"", camera(LOOPBACK, layout(b"Y16 ")));
    let live = Live::start(&config(folder, &source, layout(b"Y16 "), 0xffff), recording);
    live.run_on(1);
    (writer, live)
}

/// Writes pictures `first` to `last`, each when the one before was captured.
fn feed(writer: &mut Loopback, live: &Live, first: u32, last: u32) {
    for number in first..=last {
        let before = live.frames();
        writer.write(lamp(layout(b"Y16 "), number, 0xffff));
        live.until("captured", |live| live.frames() > before);
    }
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn short_buffers_are_counted_and_skipped() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("recording");
    let options = RecordOptions { folder: recording.clone(), queue: 50, ..RecordOptions::default() };
    let (mut writer, live) = fed("replay", Some(options), folder.path());
    feed(&mut writer, &live, 1, 3);
    let cut = lamp(layout(b"Y16 "), 4, 0xffff);
    for (count, length) in [(1, 1000), (2, cut.len() - 1)] {
        writer.write(&cut[..length]);
        live.until("counted", |live| live.count(SHORT) == count);
    }
    feed(&mut writer, &live, 6, 9);
    let ended = live.end();
    assert_eq!((ended.count(SHORT), ended.count(DROPPED)), (2, 0));
    ended.has_no_restarts();
    let losses: Vec<_> = ended.stamps.iter().map(|stamp| (stamp.0, stamp.2)).collect();
    assert_eq!(losses, [(0, 0), (1, 0), (2, 0), (3, 0), (6, 2), (7, 0), (8, 0), (9, 0)]);
    // The recording has the pictures with the numbers with which they were written.
    let mut frame = Frame::default();
    for (number, _) in losses {
        read(&recording.join(format!("frame.{number:06}.exr")), &mut frame).unwrap();
        let written = lamp(layout(b"Y16 "), u32::try_from(number).unwrap(), 0xffff);
        assert!(frame.pixels == Pixels::Codes(codes(written, layout(b"Y16 "))), "frame {number}");
    }
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn slow_reader_loses_lists_and_no_frames() {
    let folder = tempfile::tempdir().unwrap();
    let (mut writer, live) = fed("live", None, folder.path());
    let written = |live: &Live| live.summary().stage("publish").unwrap().frames.get();
    live.until("a list", |live| written(live) > 0);
    let shut = live.lines().shut();
    // More lists than the queue of a file holds, each made before the next picture is shown.
    let made = |live: &Live| live.summary().lists_made();
    let mut show = |live: &Live, number: u32| {
        let before = made(live);
        feed(&mut writer, live, number, number);
        live.until("made a list", |live| made(live) > before);
    };
    (1..=140).for_each(|number| show(&live, number));
    assert_eq!(live.count(DROPPED), 0, "{}", live.summary());
    // One list was in transit before the door was shut.
    assert!(written(&live) <= 2, "{}", live.summary());
    drop(shut);
    live.until("written", |live| written(live) > 100);
    (141..=144).for_each(|number| show(&live, number));
    let ended = live.end();
    assert_eq!(ended.summary.stage("source").unwrap().frames.get(), 145);
    assert_eq!(ended.count(DROPPED), 0);
    let drops: u64 = ended.summary.stages().iter().map(|stage| stage.drops.get()).sum();
    assert!(drops >= 5, "{}", ended.summary);
    assert_eq!(ended.stamps.len() as u64 + drops, 145);
    assert_eq!(ended.stamps.last().unwrap().0, 144, "the newest comes through");
    assert!(ended.longest_gap() > 0);
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn slow_disk_loses_recorded_frames_and_no_live_ones() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("recording");
    let options = RecordOptions { folder: recording.clone(), queue: 1, ..RecordOptions::default() };
    // Only the writer waits, and only for the capture: writing a file takes longer.
    let (mut writer, live) = fed("live", Some(options), folder.path());
    feed(&mut writer, &live, 1, 40);
    let ended = live.end();
    let stage = |name: &str| ended.summary.stage(name).unwrap();
    assert_eq!((stage("source").frames.get(), ended.count(DROPPED)), (41, 0));
    let record = stage("record");
    assert_eq!(record.frames.get() + record.drops.get(), 41);
    assert!(record.drops.get() > 0, "none was dropped:\n{}", ended.summary);
    let sidecar: serde_json::Value =
        serde_json::from_slice(&fs::read(recording.join("recording.json")).unwrap()).unwrap();
    assert_eq!(sidecar["frames_written"], record.frames.get());
    assert_eq!(sidecar["is_complete"], true);
}
