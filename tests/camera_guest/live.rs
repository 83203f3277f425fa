//! The product's service on a real driver: starting it, watching it, ending it, and checking its invariants.

use crate::kernel::Layout;
use crate::loopback::wait;
use crate::messages;
use lightcast::config::Config;
use lightcast::error::Result;
use lightcast::rt::Shutdown;
use lightcast::service::{Ends, OpenedSource, Output, RecordOptions, Service, Summary};
use std::env;
use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

/// The names by which the product finds the drivers without udev.
pub const VIVID: &str = "platform:vivid-000";
pub const LOOPBACK: &str = "platform:v4l2loopback-000";

/// Limit for everything that is waited for, long enough for an emulator on a busy machine, unless the
/// kernel's command line, whose unknown words become environment variables, sets another.
pub fn limit() -> Duration {
    let seconds = env::var("patience_s").ok().and_then(|text| text.parse().ok());
    Duration::from_secs(seconds.unwrap_or(30))
}

/// Longest time to end a service with nothing left to wait for: less than the waits of two seconds and more
/// that it has to interrupt.
const PROMPT: Duration = Duration::from_millis(1500);

/// A configuration with these keys of `[source]`, for a fisheye lens whose circle is a quarter as wide as the
/// shorter side (the matrix of a wider one takes long in the emulator), and codes up to `mask`.
pub fn config(folder: &Path, source: &str, layout: Layout, mask: u16) -> Config {
    let Layout { width, height, .. } = layout;
    let focal_length_px = f64::from(width.min(height)) / (4.0 * std::f64::consts::PI);
    let calibration = serde_json::json!({
        "version": 1,
        "lens": {
            "model": "kannala-brandt", "width": width, "height": height, "fx": focal_length_px, "fy": focal_length_px,
            "cx": f64::from(width) / 2.0, "cy": f64::from(height) / 2.0, "k": [0.0, 0.0, 0.0, 0.0],
            "field_of_view_deg": 180.0,
        },
        "response": { "model": "linear", "black_level": 0, "white_level": mask, "gain": 1.0 / f64::from(mask) },
    });
    fs::write(folder.join("calibration.json"), calibration.to_string()).unwrap();
    let path = folder.join("config.toml");
    let text = format!(
        "[source]\n{source}\n[camera]\nprojection = \"fisheye\"\ncalibration = \"calibration.json\"\n\
         [map]\ncolumns = 48\nrows = 12\n[lights]\ncount = 8\n"
    );
    fs::write(&path, text).unwrap();
    Config::load(&path).unwrap()
}

/// Configuration lines of a camera with this format.
pub fn camera(device: &str, layout: Layout) -> String {
    let name = String::from_utf8(layout.four_cc.to_vec()).unwrap();
    format!(
        "kind = \"camera\"\ndevice = \"{device}\"\nformat = \"{}\"\nsize = [{}, {}]",
        name.trim_end(),
        layout.width,
        layout.height
    )
}

/// The output for lists; it can be shut, and then its writer waits.
#[derive(Clone, Default)]
pub struct Lines(Arc<Door>);

#[derive(Default)]
struct Door {
    state: Mutex<State>,
    opened: Condvar,
}

#[derive(Default)]
struct State {
    text: Vec<u8>,
    is_shut: bool,
}

impl Lines {
    /// Makes the writer wait until what is returned is dropped.
    pub fn shut(&self) -> Shut<'_> {
        self.0.state.lock().unwrap().is_shut = true;
        Shut(&self.0)
    }

    /// Everything that was written.
    pub fn text(&self) -> String {
        String::from_utf8(self.0.state.lock().unwrap().text.clone()).unwrap()
    }
}

/// A door that is shut.
pub struct Shut<'a>(&'a Door);

impl Drop for Shut<'_> {
    fn drop(&mut self) {
        self.0.state.lock().unwrap().is_shut = false;
        self.0.opened.notify_all();
    }
}

impl Write for Lines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let state = self.0.state.lock().unwrap();
        self.0.opened.wait_while(state, |state| state.is_shut).unwrap().text.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A service that runs.
pub struct Live {
    service: Service,
    summary: Summary,
    shutdown: Shutdown,
    lines: Lines,
    threads: usize,
}

/// The results of a service that has ended.
pub struct Ended {
    /// All lists, as they were written.
    pub text: String,
    /// Sequence number, capture time in nanoseconds and frames lost before, of every list.
    pub stamps: Vec<(u64, i64, u64)>,
    pub summary: Summary,
}

impl Live {
    pub fn start(config: &Config, recording: Option<RecordOptions>) -> Self {
        messages::listen();
        Self::start_with(config, OpenedSource::open(config).unwrap(), recording)
    }

    pub fn start_with(config: &Config, input: OpenedSource, recording: Option<RecordOptions>) -> Self {
        let (lines, shutdown, threads) = (Lines::default(), Shutdown::new(), threads());
        let output = Some(Output::new("memory", lines.clone()));
        let ends = Ends { recording, output, ..Ends::default() };
        let service = Service::start_with(config, input, ends, &shutdown).unwrap();
        Self { summary: service.summary(), service, shutdown, lines, threads }
    }

    pub fn lines(&self) -> &Lines {
        &self.lines
    }

    pub fn summary(&self) -> &Summary {
        &self.summary
    }

    /// Number of frames that the camera delivered.
    pub fn frames(&self) -> u64 {
        self.summary.stage("source").unwrap().frames.get()
    }

    /// A counter of the source.
    pub fn count(&self, name: &str) -> u64 {
        count(&self.summary, name)
    }

    /// Waits until `is_so`.
    #[track_caller]
    pub fn until(&self, what: &str, is_so: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        while !is_so(self) {
            assert!(start.elapsed() < limit(), "not {what}:\n{}{}", self.summary, messages::said());
            wait(Duration::from_millis(2));
        }
    }

    /// Waits for `count` more frames.
    #[track_caller]
    pub fn run_on(&self, count: u64) {
        let goal = self.frames() + count;
        self.until("as many frames", |live| live.frames() >= goal);
    }

    /// Ends the service, which has no error and little remaining work.
    #[track_caller]
    pub fn end(self) -> Ended {
        let (ended, outcome) = self.finish(PROMPT);
        outcome.unwrap();
        ended
    }

    /// Ends the service, and checks the invariants of every run: it ends within `most`, without a panic, and
    /// leaves no thread; lists have increasing numbers and times; no frame was refused as bad; losses were
    /// counted once and reported to the filter.
    #[track_caller]
    pub fn finish(self, most: Duration) -> (Ended, Result<()>) {
        let Self { service, summary, shutdown, lines, threads: before } = self;
        let start = Instant::now();
        shutdown.request();
        let outcome = service.join(Duration::from_millis(1), || ());
        let time = start.elapsed();
        assert!(time < most, "it took {time:?} to end");
        assert_eq!(messages::panics(), 0, "panics");
        // A joined thread disappears from the kernel slightly later.
        while threads() > before {
            assert!(start.elapsed() < limit(), "{} threads, {before} before", threads());
            wait(Duration::from_millis(2));
        }

        let refused: u64 = summary.stages().iter().map(|stage| stage.bad_frames.get()).sum();
        assert_eq!(refused, 0, "frames were refused:\n{summary}");
        let text = lines.text();
        let stamps: Vec<_> = text.lines().map(stamp).collect();
        for pair in stamps.windows(2) {
            assert_eq!(pair[1].0, pair[0].0 + 1 + pair[1].2, "{stamps:?}");
            assert!(pair[1].1 > pair[0].1, "{stamps:?}");
        }
        let names = [
            "frames dropped by the kernel",
            "faulty frames",
            "short frames",
            "undecodable frames",
            "frames missed while the camera was away",
        ];
        let by_camera: u64 = names.iter().map(|name| count(&summary, name)).sum();
        let by_readers: u64 = ["calibrate", "light", "filter", "publish"]
            .iter()
            .map(|stage| summary.stage(stage).unwrap().drops.get())
            .sum();
        let told: u64 = stamps.iter().map(|stamp| stamp.2).sum();
        assert_eq!(told, by_camera + by_readers, "{stamps:?}\n{summary}{}", messages::said());
        (Ended { text, stamps, summary }, outcome)
    }
}

impl Ended {
    /// A counter of the source.
    pub fn count(&self, name: &str) -> u64 {
        count(&self.summary, name)
    }

    /// Frames that were lost in the longest gap that a list reports.
    pub fn longest_gap(&self) -> u64 {
        self.stamps.iter().map(|stamp| stamp.2).max().unwrap_or(0)
    }

    /// Checks that the camera was started again once, and why. A guest that gets no time from its host for
    /// two seconds may have one more restart, with a message that says so.
    #[track_caller]
    pub fn has_one_restart(&self, why: &str) {
        let lines = messages::count(&format!("{why}; starting it again"));
        assert_eq!(lines, 1, "'{why}' in:\n{}", messages::said());
        self.restarts_but_silences_are(1);
    }

    /// Checks that the camera was never started again.
    #[track_caller]
    pub fn has_no_restarts(&self) {
        self.restarts_but_silences_are(0);
    }

    #[track_caller]
    fn restarts_but_silences_are(&self, count: usize) {
        let silences = messages::count("gave nothing for");
        assert_eq!(self.count("restarts of the camera") as usize, count + silences, "{}", messages::said());
    }
}

fn count(summary: &Summary, name: &str) -> u64 {
    let counters = summary.stage("source").unwrap().counters();
    counters.iter().find(|(known, _)| *known == name).unwrap_or_else(|| panic!("no counter '{name}'")).1
}

fn stamp(line: &str) -> (u64, i64, u64) {
    let list: serde_json::Value = serde_json::from_str(line).unwrap();
    (
        list["sequence"].as_u64().unwrap(),
        list["capture_time_ns"].as_i64().unwrap(),
        list["lost_before"].as_u64().unwrap(),
    )
}

fn threads() -> usize {
    fs::read_dir("/proc/self/task").unwrap().count()
}
