//! A raw camera of 1024 x 1024 codes at 60 frames per second through the whole live service, recorded beside
//! it:
//!
//!     cargo bench --bench soak -- SECONDS [RECORD_FOLDER]
//!
//! Prints every ten seconds, and at the end, what was dropped and where, the resident memory, and the share
//! of one processor that the process took. The camera is calculated (a driver's buffers hold the pictures of
//! a moving lamp before a noisy gradient, made once); its frames are copied out of them like those of a real
//! one. With a folder the frames are recorded too; files older than two seconds are removed, so that ten
//! minutes (150 GB) fit anywhere: the long-term speed of a disk is not measured.

use lightcast::calibrate::Calibration;
use lightcast::config::Config;
use lightcast::error::Result;
use lightcast::rt::Shutdown;
use lightcast::service::{Ends, OpenedSource, Output, RecordOptions, Service, Summary};
use lightcast::source::{Captured, FrameFormat, LiveCamera, Mark};
use lightcast_core::camera::{Response, ResponseModel};
use lightcast_core::image::{Frame, LatLongCentres, Pixels};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const SIDE: usize = 1024;
const RATE_HZ: u64 = 60;
/// Pictures that the camera cycles through.
const PICTURES: usize = 16;
/// Pictures that its driver keeps for a slow reader; older ones are lost, as in the kernel's queue.
const BUFFERS: u64 = 4;

struct Calculated {
    pictures: Vec<Vec<u16>>,
    start: Option<Instant>,
    next: u64,
    end: u64,
    shutdown: Shutdown,
}

/// 12-bit codes: a lamp on a circle, and a gradient with noise of a few codes.
fn picture(number: usize) -> Vec<u16> {
    let angle = number as f64 / PICTURES as f64 * std::f64::consts::TAU;
    let lamp = (512.0 + 200.0 * angle.sin(), 512.0 + 200.0 * angle.cos());
    let code = |index: usize| {
        let (row, column) = (index / SIDE, index % SIDE);
        let noise = (index as u32 ^ (number as u32) << 20).wrapping_mul(2_654_435_769) >> 29;
        let distance = (row as f64 - lamp.0).hypot(column as f64 - lamp.1);
        if distance < 8.0 { 3900 } else { 400 + (row / 2) as u16 + noise as u16 }
    };
    (0..SIDE * SIDE).map(code).collect()
}

impl Calculated {
    /// Time of a frame after the first.
    fn time(frame: u64) -> Duration {
        Duration::from_nanos(frame * 1_000_000_000 / RATE_HZ)
    }
}

impl LiveCamera for Calculated {
    fn start(&mut self) -> Result<()> {
        self.start = Some(Instant::now());
        Ok(())
    }

    fn capture(&mut self, patience: Duration, frame: &mut Frame) -> Result<Captured> {
        let Some(start) = self.start else { return Ok(Captured::Nothing) };
        if self.next >= self.end {
            self.shutdown.request();
            return Ok(Captured::Nothing);
        }
        let elapsed = start.elapsed();
        let wait = Self::time(self.next).saturating_sub(elapsed);
        if !wait.is_zero() {
            self.shutdown.wait(wait.min(patience));
        }
        // Frames that have been captured by now; the driver has the last few.
        let newest = start.elapsed().as_nanos() as u64 * RATE_HZ / 1_000_000_000;
        if newest < self.next {
            return Ok(Captured::Nothing);
        }
        let number = self.next.max((newest + 1).saturating_sub(BUFFERS));
        self.next = number + 1;
        (frame.width, frame.height, frame.channels, frame.bayer) = (SIDE, SIDE, 1, None);
        let picture = &self.pictures[number as usize % PICTURES];
        match &mut frame.pixels {
            Pixels::Codes(codes) => codes.clone_from(picture),
            pixels => *pixels = Pixels::Codes(picture.clone()),
        }
        let time_ns = Self::time(number).as_nanos() as i64;
        Ok(Captured::Frame(Mark { sequence: number as u32, time_ns, age_ns: 0 }))
    }

    fn stop(&mut self) {}
}

/// Resident memory in bytes and processor time in seconds of this process.
fn usage() -> (f64, f64) {
    let read = |name: &str| fs::read_to_string(format!("/proc/self/{name}")).unwrap_or_default();
    let pages: f64 =
        read("statm").split_whitespace().nth(1).and_then(|pages| pages.parse().ok()).unwrap_or(0.0);
    // Fields 14 and 15 behind the program's name in brackets; ticks of 10 ms, pages of 4096 bytes on Linux.
    let text = read("stat");
    let ticks: f64 = text.rsplit(')').next().map_or(0.0, |rest| {
        rest.split_whitespace().skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum()
    });
    (pages * 4096.0, ticks * 0.01)
}

fn config(folder: &Path) -> Result<Config> {
    let response =
        ResponseModel::Logarithmic { a: 400.0, b: 200.0, black_clip_code: 10, saturation_code: 4095 };
    let lens = r#"{ "version": 1, "lens": { "model": "kannala-brandt", "width": 1024, "height": 1024, "fx": 320.0,
        "fy": 320.0, "cx": 512.0, "cy": 512.0, "k": [0.0, 0.0, 0.0, 0.0], "field_of_view_deg": 180.0 } }"#;
    let mut calibration = Calibration::parse(lens, None)?;
    calibration.response = Response::new(response)?;
    let text = "[source]\nkind = \"sequence\"\npath = \"none/\"\nlinks = \"live\"\n\
                [camera]\nprojection = \"fisheye\"\ncalibration = \"calibration.json\"\n[lights]\ncount = 300\n";
    let written = fs::write(folder.join("calibration.json"), calibration.to_json())
        .and_then(|()| fs::write(folder.join("soak.toml"), text));
    written.map_err(|error| lightcast::error::Error::failed("no folder for the soak").because(error))?;
    Config::load(&folder.join("soak.toml"))
}

/// Removes recorded files, except those of the last two seconds.
fn forget(folder: &Path, newest: u64, forgotten: &mut u64) {
    while *forgotten + 2 * RATE_HZ < newest {
        // A frame that was dropped has no file.
        let _ = fs::remove_file(folder.join(format!("frame.{forgotten:06}.exr")));
        *forgotten += 1;
    }
}

fn line(seconds: f64, summary: &Summary, start: (f64, f64)) -> String {
    let now = usage();
    let count =
        |name: &str| summary.stage(name).map_or((0, 0), |stage| (stage.frames.get(), stage.drops.get()));
    let kernel = summary.stage("source").map_or(0, |source| {
        source
            .counters()
            .iter()
            .find(|(name, _)| *name == "frames dropped by the kernel")
            .map_or(0, |found| found.1)
    });
    let slow: u64 = ["calibrate", "light", "filter", "publish"].iter().map(|name| count(name).1).sum();
    let record = count("record");
    format!(
        "{seconds:7.1} s  {} frames  {} lists  dropped: {kernel} by the camera's queue, {slow} by slow stages, {} of {} \
         by the recorder  {:.1} MB resident  {:.1} % of one processor",
        count("source").0,
        count("publish").0,
        record.1,
        record.0 + record.1,
        now.0 / 1e6,
        100.0 * (now.1 - start.1) / seconds
    )
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let seconds: u64 = arguments.first().and_then(|text| text.parse().ok()).unwrap_or(20);
    let recording = arguments.get(1).map(PathBuf::from);
    let folder = tempfile::tempdir()
        .map_err(|error| lightcast::error::Error::failed("no folder for the soak").because(error))?;
    let config = config(folder.path())?;
    let shutdown = Shutdown::new();
    let camera = Calculated {
        pictures: (0..PICTURES).map(picture).collect(),
        start: None,
        next: 0,
        end: seconds * RATE_HZ,
        shutdown: shutdown.clone(),
    };
    let format = FrameFormat {
        width: SIDE,
        height: SIDE,
        channels: 1,
        bayer: None,
        is_codes: true,
        latlong_centres: LatLongCentres::Half,
        frame_rate_hz: RATE_HZ as f64,
    };
    let source = OpenedSource::camera(format, "calculated".to_owned(), camera);
    let options = recording.clone().map(|folder| RecordOptions { folder, ..RecordOptions::default() });
    let output = Some(Output::new("nowhere", std::io::sink()));
    let ends = Ends { recording: options, output, ..Ends::default() };
    let service = Service::start_with(&config, source, ends, &shutdown)?;
    let summary = service.summary();
    let (started, start) = (Instant::now(), usage());
    let (mut forgotten, mut told) = (0, 0);
    let outcome = service.join(Duration::from_millis(100), || {
        let elapsed_s = started.elapsed().as_secs_f64();
        if let Some(folder) = &recording {
            forget(folder, summary.stage("source").map_or(0, |source| source.frames.get()), &mut forgotten);
        }
        if elapsed_s as u64 / 10 > told {
            told = elapsed_s as u64 / 10;
            println!("{}", line(elapsed_s, &summary, start));
        }
    });
    println!("{}", line(started.elapsed().as_secs_f64(), &summary, start));
    print!("{summary}");
    outcome
}
