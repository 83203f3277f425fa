use crate::error::{Error, Result};
use crate::files::{replace_file, write_recorded_exr};
use crate::rt::stage::{Flow, Stage};
use crate::rt::{Counter, Metrics};
use lightcast_core::image::{Bayer, Frame, Pixels};
use serde::Serialize;
use std::fs;
use std::io::Write;
use std::path::PathBuf;

/// The description of a recording; part of the file `recording.json` beside its frames.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Recording {
    /// Version of the file.
    pub version: u32,
    /// What was recorded: a camera's stable name, or files.
    pub source: String,
    /// Exposure in seconds, where it is known.
    pub exposure_s: Option<f64>,
    /// The calibration, as in a calibration file, where there is one.
    pub calibration: Option<serde_json::Value>,
    /// The offset from a capture time to nanoseconds since 1970 (UTC), at the start of the recording.
    pub utc_from_capture_ns: Option<i64>,
}

/// The file beside the frames.
#[derive(Serialize)]
struct Sidecar {
    #[serde(flatten)]
    recording: Recording,
    /// Columns and rows.
    size: [usize; 2],
    channels: usize,
    bayer: Option<Bayer>,
    /// `codes`, `half` or `float` (radiance).
    samples: &'static str,
    frame_rate_hz: f64,
    /// Of the first and the last frame.
    sequence_numbers: Option<(u64, u64)>,
    frames_written: u64,
    /// Frames between the first and the last that are not in the recording: lost by the camera, or by a slow
    /// disk.
    frames_missing: u64,
    /// Whether the recording ended properly; false while it runs, and for ever if its program was killed. If
    /// the disk has no room left for this file, it keeps the counts of the first frame.
    is_complete: bool,
}

impl Sidecar {
    /// Counts a frame that was written.
    fn add(&mut self, frame: &Frame, is_half: bool) {
        let Frame { stamp, width, height, channels, bayer, pixels, .. } = frame;
        (self.size, self.channels, self.bayer) = ([*width, *height], *channels, *bayer);
        self.samples = match pixels {
            Pixels::Codes(_) => "codes",
            Pixels::Radiance(_) if is_half => "half",
            Pixels::Radiance(_) => "float",
        };
        self.frame_rate_hz = stamp.frame_rate_hz;
        let first = self.sequence_numbers.map_or(stamp.sequence, |(first, _)| first);
        self.sequence_numbers = Some((first, stamp.sequence));
        self.frames_written += 1;
        self.frames_missing = stamp.sequence - first + 1 - self.frames_written;
    }
}

/// Writes every frame into a file of its own, `frame.NNNNNN.exr` with the frame's sequence number, and their
/// common description into `recording.json`. Everything before a failure, such as a full disk, is complete.
pub struct Record {
    folder: PathBuf,
    sidecar: Sidecar,
    lens: Option<String>,
    /// Radiance by code, to write radiance, and a frame for it; `None`: frames are written as they come.
    radiance: Option<(Vec<f32>, Frame)>,
    /// Frames after which the recording ends.
    frames_max: u64,
    beyond_half: Counter,
}

/// Name of the file beside the frames.
pub const SIDECAR: &str = "recording.json";

/// Largest half float, and half of the smallest one, below which values become 0.
const HALF_MAX: f32 = 65_504.0;
const HALF_MIN: f32 = 2.980_232_2e-8;

impl Record {
    /// Up to `frames_max` frames into `folder`, which is made. `table` gives the radiance by code (none is
    /// needed for frames of radiance): then radiance is written as half floats; values beyond these are
    /// written as the largest, 65504, and counted, as are those too small for them, which become 0.
    ///
    /// # Errors
    /// `Usage`: the folder is not empty. `Failed`: it cannot be made.
    pub fn new(
        folder: PathBuf,
        recording: Recording,
        table: Option<Vec<f32>>,
        frames_max: u64,
        metrics: &Metrics,
    ) -> Result<Self> {
        let fault = |error: Error| error.at(&folder);
        fs::create_dir_all(&folder)
            .map_err(|error| fault(Error::failed("the folder cannot be made").because(error)))?;
        let mut entries = fs::read_dir(&folder)
            .map_err(|error| fault(Error::failed("the folder cannot be read").because(error)))?;
        if entries.next().is_some() {
            return Err(fault(Error::usage("is not empty; name a new folder for the recording")));
        }
        let lens = recording.calibration.as_ref().and_then(|calibration| calibration.get("lens"));
        Ok(Self {
            lens: lens.map(ToString::to_string),
            folder,
            sidecar: Sidecar {
                recording,
                size: [0, 0],
                channels: 0,
                bayer: None,
                samples: "codes",
                frame_rate_hz: 0.0,
                sequence_numbers: None,
                frames_written: 0,
                frames_missing: 0,
                is_complete: false,
            },
            radiance: table.map(|table| (table, Frame::default())),
            frames_max,
            beyond_half: metrics.counter("pixels beyond half floats"),
        })
    }

    fn write_sidecar(&self) -> Result<()> {
        replace_file(&self.folder.join(SIDECAR), |writer| {
            serde_json::to_writer_pretty(&mut *writer, &self.sidecar)
                .map_err(std::io::Error::from)
                .and_then(|()| writer.write_all(b"\n"))
                .map_err(|error| Error::failed("cannot be written").because(error))
        })
    }
}

impl Stage for Record {
    type Input = Frame;
    type Output = ();

    fn step(&mut self, frame: &Frame, (): &mut ()) -> Result<Flow> {
        // The last frame counts as processed; the one after it ends the stage.
        if self.sidecar.frames_written == self.frames_max {
            return Ok(Flow::End);
        }
        let path = self.folder.join(format!("frame.{:06}.exr", frame.stamp.sequence));
        let is_half = self.radiance.is_some();
        let (written, beyond_half) = match &mut self.radiance {
            None => (frame, 0),
            Some((table, radiance)) => {
                let beyond_half = radiance_within_half(frame, table, radiance);
                (&*radiance, beyond_half)
            }
        };
        write_recorded_exr(&path, written, is_half, self.sidecar.recording.exposure_s, self.lens.as_deref())?;
        self.beyond_half.add(beyond_half);
        self.sidecar.add(written, is_half);
        if self.sidecar.frames_written == 1 {
            self.write_sidecar()?;
        }
        Ok(Flow::Send)
    }

    /// The file beside the frames says how many there are, and whether the recording ended in order.
    fn finish(&mut self, is_complete: bool) -> Result<()> {
        self.sidecar.is_complete = is_complete;
        self.write_sidecar()
    }
}

/// Radiance of a frame, by `table` where it has codes, clamped to the largest half float; returns how many
/// pixels are outside the range of half floats. NaN stays NaN.
pub fn radiance_within_half(frame: &Frame, table: &[f32], to: &mut Frame) -> u64 {
    let Frame { stamp, width, height, channels, bayer, .. } = *frame;
    let mut values = match std::mem::replace(&mut to.pixels, Pixels::Radiance(Vec::new())) {
        Pixels::Radiance(values) => values,
        Pixels::Codes(_) => Vec::new(),
    };
    let mut beyond = 0;
    let mut cut = |radiance: f32| {
        beyond += u64::from(radiance > HALF_MAX || radiance > 0.0 && radiance < HALF_MIN);
        if radiance > HALF_MAX { HALF_MAX } else { radiance }
    };
    values.clear();
    match &frame.pixels {
        Pixels::Codes(codes) => {
            let brightest = table.last().copied().unwrap_or(0.0);
            values.extend(
                codes.iter().map(|&code| cut(table.get(usize::from(code)).copied().unwrap_or(brightest))),
            );
        }
        Pixels::Radiance(radiance) => values.extend(radiance.iter().map(|&radiance| cut(radiance))),
    }
    *to =
        Frame { stamp, width, height, channels, bayer, pixels: Pixels::Radiance(values), ..Frame::default() };
    beyond
}

#[cfg(test)]
mod tests;
