//! A scripted live camera through the whole service: a recording, of a camera that disappears and returns,
//! replays to the same lists; when a recording fails, only the recording ends.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use lightcast::config::Config;
use lightcast::error::{Error, Result};
use lightcast::rt::Shutdown;
use lightcast::service::{Ends, OpenedSource, Output, RecordOptions, Service};
use lightcast::source::{BadBuffer, Captured, FrameFormat, LiveCamera, Mark};
use lightcast_core::image::{Frame, LatLongCentres, Pixels};
use std::collections::VecDeque;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

const SIDE: usize = 64;
const RATE_HZ: f64 = 50.0;

/// The next action of the camera.
#[derive(Clone, Copy)]
enum Event {
    /// A frame with this count of the kernel.
    Frame(u32),
    Faulty(u32),
    Lost,
    End,
}

struct Scripted {
    events: VecDeque<Event>,
    /// Number of the next frame, from which its content and time follow.
    number: u64,
    shutdown: Shutdown,
}

/// A lamp that moves and fades in front of a gradient, in codes of 12 bits.
fn picture(number: u64, frame: &mut Frame) {
    let lamp = (20 + (number % 24) as usize, 30);
    let code = |index: usize| {
        let (row, column) = (index / SIDE, index % SIDE);
        if row.abs_diff(lamp.0) < 2 && column.abs_diff(lamp.1) < 2 {
            4000 - number as u16
        } else {
            300 + row as u16
        }
    };
    (frame.width, frame.height, frame.channels, frame.bayer) = (SIDE, SIDE, 1, None);
    frame.pixels = Pixels::Codes((0..SIDE * SIDE).map(code).collect());
}

impl LiveCamera for Scripted {
    fn start(&mut self) -> Result<()> {
        Ok(())
    }

    fn capture(&mut self, _: Duration, frame: &mut Frame) -> Result<Captured> {
        let mark = |sequence, number: u64| Mark {
            sequence,
            // The nanoseconds are odd numbers, because a replay has to keep them exactly.
            time_ns: 7_000_000_123 + 20_000_001 * number as i64,
            age_ns: 0,
        };
        match self.events.pop_front().unwrap_or(Event::End) {
            Event::Frame(sequence) => {
                picture(self.number, frame);
                self.number += 1;
                Ok(Captured::Frame(mark(sequence, self.number - 1)))
            }
            Event::Faulty(sequence) => {
                self.number += 1;
                Ok(Captured::Bad(mark(sequence, self.number - 1), BadBuffer::Faulty))
            }
            Event::Lost => {
                // The time of five frames.
                self.number += 5;
                Err(Error::lost_device("scripted"))
            }
            Event::End => {
                self.shutdown.request();
                Ok(Captured::Nothing)
            }
        }
    }

    fn stop(&mut self) {}
}

fn input(events: &[Event], shutdown: &Shutdown) -> OpenedSource {
    let format = FrameFormat {
        width: SIDE,
        height: SIDE,
        channels: 1,
        bayer: None,
        is_codes: true,
        latlong_centres: LatLongCentres::Half,
        frame_rate_hz: RATE_HZ,
    };
    let events = events.iter().copied().collect();
    OpenedSource::camera(
        format,
        "scripted".to_owned(),
        Scripted { events, number: 0, shutdown: shutdown.clone() },
    )
}

/// A configuration that plays `folder/recording`.
fn config(folder: &Path) -> Config {
    let calibration = r#"{ "version": 1,
        "lens": { "model": "kannala-brandt", "width": 64, "height": 64, "fx": 20.0, "fy": 20.0, "cx": 32.0,
                  "cy": 32.0, "k": [0.0, 0.0, 0.0, 0.0], "field_of_view_deg": 180.0 },
        "response": { "model": "logarithmic", "a": 300.0, "b": 200.0, "black_clip_code": 10,
                      "saturation_code": 4095 } }"#;
    fs::write(folder.join("calibration.json"), calibration).unwrap();
    let text = "[source]\nkind = \"sequence\"\npath = \"recording/\"\npace = \"fast\"\n\
                [camera]\nprojection = \"fisheye\"\ncalibration = \"calibration.json\"\n\
                [map]\ncolumns = 90\nrows = 23\n[lights]\ncount = 16\n";
    let path = folder.join("replay.toml");
    fs::write(&path, text).unwrap();
    Config::load(&path).unwrap()
}

#[derive(Clone, Default)]
struct Lines(Arc<Mutex<Vec<u8>>>);

impl Write for Lines {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap().write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Runs the service; returns its lists as text, and its summary.
fn run(
    config: &Config,
    input: Option<OpenedSource>,
    recording: Option<RecordOptions>,
    shutdown: &Shutdown,
) -> (String, String, Result<()>) {
    let lines = Lines::default();
    let ends = Ends { recording, output: Some(Output::new("memory", lines.clone())), ..Ends::default() };
    let input = input.unwrap_or_else(|| OpenedSource::open(config).unwrap());
    let service = Service::start_with(config, input, ends, shutdown).unwrap();
    let summary = service.summary();
    let outcome = service.join(Duration::from_millis(1), || ());
    let text = String::from_utf8(lines.0.lock().unwrap().clone()).unwrap();
    (text, summary.to_string(), outcome)
}

fn recording(folder: &Path) -> RecordOptions {
    RecordOptions { folder: folder.join("recording"), queue: 200, ..RecordOptions::default() }
}

#[test]
fn a_recording_without_drops_replays_to_the_lists_of_the_live_run_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let config = config(folder.path());
    let shutdown = Shutdown::new();
    let mut events: Vec<Event> = (100..140).map(Event::Frame).collect();
    // Frames that the camera loses are also missing in the recording.
    events.extend([Event::Faulty(140), Event::Frame(143), Event::Lost]);
    events.extend((0..20).map(Event::Frame));
    let (live, summary, outcome) =
        run(&config, Some(input(&events, &shutdown)), Some(recording(folder.path())), &shutdown);
    outcome.unwrap();
    assert_eq!(live.lines().count(), 61);
    let source = "source: 2 frames dropped by the kernel, 1 faulty frames, 0 short frames, 0 undecodable frames, \
                  0 incomplete rounds of exposures, 0 frames out of order, 5 frames missed while the camera was away, 1 restarts of the camera";
    assert!(summary.contains(source), "{summary}");
    let (replayed, _, outcome) = run(&config, None, None, &Shutdown::new());
    outcome.unwrap();
    assert!(live == replayed, "lists differ");
    let sidecar: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("recording/recording.json")).unwrap()).unwrap();
    assert_eq!(sidecar["frames_written"], 61);
    assert_eq!(sidecar["frames_missing"], 8, "2 dropped, 1 faulty, 5 away");
    assert_eq!(sidecar["calibration"]["lens"]["fx"], 20.0);
}

#[test]
fn a_recording_that_fails_ends_alone_and_is_told_in_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let config = config(folder.path());
    let shutdown = Shutdown::new();
    let events: Vec<Event> = (0..30).map(Event::Frame).collect();
    // A folder has the name of the third frame, which therefore cannot be written.
    let options = recording(folder.path());
    let blocked = options.folder.join("frame.000002.exr");
    let input = input(&events, &shutdown);
    let lines = Lines::default();
    let (writer, folder_in_the_way) = (lines.clone(), blocked.clone());
    let open = move || -> Result<Box<dyn Write + Send>> {
        fs::create_dir(&folder_in_the_way).unwrap();
        Ok(Box::new(writer))
    };
    let output = Output { name: "memory".to_owned(), open: Box::new(open) };
    let ends = Ends { recording: Some(options.clone()), output: Some(output), ..Ends::default() };
    let service = Service::start_with(&config, input, ends, &shutdown).unwrap();
    let error = service.join(Duration::from_millis(1), || ()).unwrap_err();
    assert!(error.to_string().contains("frame.000002.exr: cannot be written"), "{error}");
    assert_eq!(String::from_utf8(lines.0.lock().unwrap().clone()).unwrap().lines().count(), 30);
    let sidecar: serde_json::Value =
        serde_json::from_slice(&fs::read(options.folder.join("recording.json")).unwrap()).unwrap();
    assert_eq!((&sidecar["frames_written"], &sidecar["is_complete"]), (&2.into(), &false.into()));
    fs::remove_dir(&blocked).unwrap();
    let (replayed, _, outcome) = run(&config, None, None, &Shutdown::new());
    outcome.unwrap();
    assert_eq!(replayed.lines().count(), 2, "all before it is readable");
}
