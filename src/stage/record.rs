use crate::error::{Error, Result};
use crate::image::{Bayer, Frame, Pixels, replace_file, write_recorded_exr};
use crate::rt::link::{Closed, Sender};
use crate::rt::stage::{Flow, Outlet, Stage};
use crate::rt::{Counter, Metrics};
use serde::Serialize;
use std::fs;
use std::io::Write;
use std::path::PathBuf;

/// Outlet of a source: its frames go on to the next stage, and copies of them to a recorder that never makes the
/// source wait. What the recorder has no room for is counted and missing in the recording.
pub struct Tee {
    /// The next stage; `None` where there is nothing but the recorder.
    frames: Option<Sender<Frame>>,
    /// The buffer in use where there is no next stage.
    own: Frame,
    recorder: Option<Recorder>,
}

/// The way to a recorder.
pub struct Recorder {
    /// A bounded link.
    pub frames: Sender<Frame>,
    /// Frames that it had no room for.
    pub dropped: Counter,
    /// Whether the source can wait until there is room: files can, a camera cannot.
    pub waits: bool,
}

impl Recorder {
    fn offer(&mut self, frame: &Frame) -> Result<(), Closed> {
        if self.waits {
            let mut copy = self.frames.take()?;
            copy.copy_from(frame);
            return self.frames.send(copy);
        }
        let Some(mut copy) = self.frames.try_take()? else {
            self.dropped.add(1);
            return Ok(());
        };
        copy.copy_from(frame);
        if !self.frames.try_send(copy)? {
            self.dropped.add(1);
        }
        Ok(())
    }
}

impl Tee {
    /// Frames to `frames`, copies to `recorder`.
    pub fn new(frames: Option<Sender<Frame>>, recorder: Option<Recorder>) -> Self {
        Self { frames, own: Frame::default(), recorder }
    }
}

impl Outlet for Tee {
    type Item = Frame;

    fn take(&mut self) -> Result<Frame, Closed> {
        match &mut self.frames {
            Some(frames) => frames.take(),
            None => Ok(std::mem::take(&mut self.own)),
        }
    }

    fn send(&mut self, frame: Frame) -> Result<(), Closed> {
        // A recording that has ended, by a full disk say, does not end the capture, unless nobody else wants it.
        if let Some(recorder) = &mut self.recorder
            && recorder.offer(&frame).is_err()
        {
            self.recorder = None;
        }
        match &mut self.frames {
            Some(frames) => frames.send(frame),
            None if self.recorder.is_none() => Err(Closed),
            None => {
                self.own = frame;
                Ok(())
            }
        }
    }
}

/// What is known of a recording beside its frames; part of the file `recording.json` beside them.
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
    /// What to add to a capture time to get nanoseconds since 1970 (UTC), at the start of the recording.
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
    /// Frames between the first and the last that are not in the recording: lost by the camera, or by a slow disk.
    frames_missing: u64,
    /// Whether the recording was ended in order; false while it runs, and for good when its program was killed.
    is_complete: bool,
}

impl Sidecar {
    /// Counts a frame that was written.
    fn add(&mut self, frame: &Frame, is_half: bool) {
        let Frame { stamp, width, height, channels, bayer, pixels } = frame;
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

/// Writes every frame into a file of its own, `frame.NNNNNN.exr` with the frame's sequence number, and what is known
/// of all of them into `recording.json`. Everything before a failure, such as a full disk, is whole.
pub struct Record {
    folder: PathBuf,
    sidecar: Sidecar,
    lens: Option<String>,
    /// Radiance by code, to write radiance, and a frame for it; `None`: as it comes.
    radiance: Option<(Vec<f32>, Frame)>,
    /// Frames after which the recording ends.
    frames_max: u64,
    beyond_half: Counter,
}

/// Name of the file beside the frames.
pub const SIDECAR: &str = "recording.json";

/// Largest half float, and half of the smallest one: what is below becomes 0.
const HALF_MAX: f32 = 65_504.0;
const HALF_MIN: f32 = 2.980_232_2e-8;

impl Record {
    /// Up to `frames_max` frames into `folder`, which is made. `table` gives the radiance by code (none is needed for
    /// frames of radiance): then radiance is written as half floats; values beyond these are written as the largest,
    /// 65504, and counted, as are those too small for them, which become 0.
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
        let fault = |error: Error| error.at(folder.display());
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

    /// Ends the recording: the file beside the frames says how many there are, and whether it ended in order.
    ///
    /// # Errors
    /// `Failed`: the file cannot be written.
    pub fn finish(&mut self, is_complete: bool) -> Result<()> {
        self.sidecar.is_complete = is_complete;
        self.write_sidecar()
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
        // The last frame counts as one that was worked off; the one behind it ends the stage.
        if self.sidecar.frames_written == self.frames_max {
            return Ok(Flow::End);
        }
        let path = self.folder.join(format!("frame.{:06}.exr", frame.stamp.sequence));
        let is_half = self.radiance.is_some();
        let written = match &mut self.radiance {
            None => frame,
            Some((table, radiance)) => {
                self.beyond_half.add(decode(frame, table, radiance));
                radiance
            }
        };
        write_recorded_exr(&path, written, is_half, self.sidecar.recording.exposure_s, self.lens.as_deref())?;
        self.sidecar.add(written, is_half);
        if self.sidecar.frames_written == 1 {
            self.write_sidecar()?;
        }
        Ok(Flow::Send)
    }
}

/// Radiance of a frame, by `table` where it has codes, cut at the largest half float; returns how many pixels have no half
/// float of their size. What is no number stays so.
fn decode(frame: &Frame, table: &[f32], to: &mut Frame) -> u64 {
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
    *to = Frame { stamp, width, height, channels, bayer, pixels: Pixels::Radiance(values) };
    beyond
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Stamp, read};
    use crate::rt::Shutdown;
    use crate::rt::link::bounded;

    fn frame(sequence: u64) -> Frame {
        let stamp = Stamp {
            sequence,
            capture_time_ns: 5_000_000_000 + 40_000_000 * sequence as i64,
            lost_before: 0,
            frame_rate_hz: 25.0,
        };
        let codes = (0..12).map(|pixel| 100 * pixel + sequence as u16).collect();
        Frame { stamp, width: 4, height: 3, channels: 1, bayer: None, pixels: Pixels::Codes(codes) }
    }

    fn recording() -> Recording {
        Recording {
            version: 1,
            source: "test".to_owned(),
            exposure_s: Some(0.01),
            calibration: Some(serde_json::json!({ "lens": { "fx": 1.0 } })),
            utc_from_capture_ns: Some(7),
        }
    }

    fn sidecar(folder: &std::path::Path) -> serde_json::Value {
        serde_json::from_slice(&fs::read(folder.join(SIDECAR)).unwrap()).unwrap()
    }

    #[test]
    fn a_recording_holds_the_codes_and_says_what_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("new");
        let metrics = Metrics::new("record");
        let mut record = Record::new(folder.clone(), recording(), None, 3, &metrics).unwrap();
        let flows = [3, 4, 6, 7].map(|sequence| record.step(&frame(sequence), &mut ()).unwrap());
        assert_eq!(flows, [Flow::Send, Flow::Send, Flow::Send, Flow::End]);
        let early = sidecar(&folder);
        assert_eq!((&early["frames_written"], &early["is_complete"]), (&1.into(), &false.into()));
        record.finish(true).unwrap();
        let found = sidecar(&folder);
        assert_eq!(found["sequence_numbers"], serde_json::json!([3, 6]));
        assert_eq!((&found["frames_written"], &found["frames_missing"]), (&3.into(), &1.into()));
        assert_eq!((&found["samples"], &found["source"]), (&"codes".into(), &"test".into()));
        assert_eq!(found["is_complete"], true);
        let mut read_back = Frame::default();
        let attributes = read(&folder.join("frame.000006.exr"), &mut read_back).unwrap();
        assert_eq!(attributes.capture_time_ns, Some(frame(6).stamp.capture_time_ns));
        assert_eq!(read_back.pixels, frame(6).pixels);
        let again = Record::new(folder, recording(), None, 3, &metrics).err().unwrap();
        assert!(again.to_string().contains("is not empty"), "{again}");
    }

    #[test]
    fn radiance_is_cut_at_the_largest_half_float_and_counted() {
        let folder = tempfile::tempdir().unwrap();
        let metrics = Metrics::new("record");
        let table: Vec<f32> = (0..=1000).map(|code| code as f32 * 100.0).collect();
        let mut record =
            Record::new(folder.path().to_owned(), recording(), Some(table), 9, &metrics).unwrap();
        record.step(&frame(0), &mut ()).unwrap();
        let mut read_back = Frame::default();
        read(&folder.path().join("frame.000000.exr"), &mut read_back).unwrap();
        let Pixels::Radiance(values) = read_back.pixels else { panic!("codes") };
        assert_eq!(values[..3], [0.0, 10_000.0, 20_000.0]);
        // Codes 700 to 1100 are 70,000 and more; the largest half is exact.
        assert_eq!(values[7..], [HALF_MAX; 5]);
        assert_eq!(metrics.counters(), [("pixels beyond half floats", 5)]);
    }

    #[test]
    fn radiance_is_recorded_as_it_comes_or_as_half_floats_that_are_counted() {
        let metrics = Metrics::new("record");
        let values = vec![1e6, 0.1, 1e-9, 0.0];
        let frame = Frame { width: 4, height: 1, pixels: Pixels::Radiance(values.clone()), ..frame(0) };
        for (table, expected) in [(None, values), (Some(Vec::new()), vec![HALF_MAX, 0.099_975_586, 0.0, 0.0])]
        {
            let folder = tempfile::tempdir().unwrap();
            let mut record = Record::new(folder.path().to_owned(), recording(), table, 9, &metrics).unwrap();
            record.step(&frame, &mut ()).unwrap();
            let mut read_back = Frame::default();
            read(&folder.path().join("frame.000000.exr"), &mut read_back).unwrap();
            assert_eq!(read_back.pixels, Pixels::Radiance(expected));
        }
        assert_eq!(metrics.counters(), [("pixels beyond half floats", 2)]);
    }

    #[test]
    fn files_wait_for_a_recorder_that_is_behind() {
        let shutdown = Shutdown::new();
        let (frames, mut recorder_end) = bounded(1, &shutdown, Frame::default);
        let recorder = Recorder { frames, dropped: Counter::default(), waits: true };
        let mut tee = Tee::new(None, Some(recorder));
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for sequence in 0..20 {
                    let mut buffer = tee.take().unwrap();
                    buffer.copy_from(&frame(sequence));
                    tee.send(buffer).unwrap();
                }
            });
            for sequence in 0..20 {
                assert_eq!(recorder_end.receive().unwrap().stamp.sequence, sequence);
            }
            assert!(recorder_end.receive().is_none());
        });
    }

    #[test]
    fn a_recorder_that_is_behind_loses_frames_and_holds_nobody_up() {
        let shutdown = Shutdown::new();
        let (frames, mut recorder_end) = bounded(2, &shutdown, Frame::default);
        let dropped = Counter::default();
        let mut tee = Tee::new(None, Some(Recorder { frames, dropped: dropped.clone(), waits: false }));
        let mut send = |sequence: u64| {
            let mut buffer = tee.take()?;
            buffer.copy_from(&frame(sequence));
            tee.send(buffer)
        };
        (0..10).for_each(|sequence| send(sequence).unwrap());
        assert_eq!(dropped.get(), 8, "the link holds two");
        for expected in [0, 1] {
            assert_eq!(recorder_end.receive().unwrap().stamp.sequence, expected);
        }
        send(10).unwrap();
        assert_eq!(recorder_end.receive().unwrap().stamp.sequence, 10);
        drop(recorder_end);
        assert_eq!(send(11), Err(Closed), "nobody is left");
    }

    #[test]
    fn the_end_of_a_recording_is_not_the_end_of_the_capture() {
        let shutdown = Shutdown::new();
        let (frames, next) = bounded(2, &shutdown, Frame::default);
        let (copies, recorder_end) = bounded(2, &shutdown, Frame::default);
        drop(recorder_end);
        let recorder = Recorder { frames: copies, dropped: Counter::default(), waits: false };
        let mut tee = Tee::new(Some(frames), Some(recorder));
        let buffer = tee.take().unwrap();
        tee.send(buffer).unwrap();
        drop(next);
        let buffer = tee.take().unwrap();
        assert_eq!(tee.send(buffer), Err(Closed));
    }
}
