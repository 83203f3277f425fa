//! Frames from numbered files.
//!
//! The number of a file is the time at which it was taken: file n of a sequence that begins with file n0 has
//! the capture time (n - n0) / rate, whether or not the files in between exist. Missing numbers and unusable
//! files are counted in `lost_before` of the next usable frame.
//!
//! Files of `lightcast record` hold their own capture times. Names may be times, see `timeline`.
//!
//! When a sequence repeats, the count continues: with n1 the last number, pass k gives file n the sequence
//! number n + k (n1 - n0 + 1) and the corresponding capture time, so that the first frame follows the last at
//! the usual interval and nothing ever runs backwards.

#[cfg(test)]
mod tests;
mod timeline;

use super::{FrameSource, Next, pattern};
use crate::error::{Error, Kind, Place, Result};
use crate::files::{Attributes, read, read_of_size};
use crate::rt::Counter;
use lightcast_core::image::{Bayer, Frame, LatLongCentres, Pixels};
use std::path::{Path, PathBuf};
use timeline::{Timeline, rate_hz};

/// Which files to play, and how fast they were taken.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SequenceOptions {
    /// A pattern (`name.####.exr`, `name.%04d.exr`), a folder with one sequence, or one file.
    pub path: PathBuf,
    /// Frames per second; overrides the rate in the files. It is required where they have none, except for a
    /// single picture that is not repeated.
    pub frame_rate_hz: Option<f64>,
    /// Smallest file number to play.
    pub first: Option<i64>,
    /// Largest file number to play.
    pub last: Option<i64>,
    /// Whether to play it in a loop.
    pub repeat: bool,
    /// Colours of the pixels of a mosaic sensor, whose codes were saved as grey pictures; `None`: as the
    /// files say.
    pub bayer: Option<Bayer>,
}

/// What every frame of a source is like: enough to build a calibration before the first one comes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameFormat {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// 1 (luminance) or 3 (RGB).
    pub channels: usize,
    /// Colours of a mosaic sensor's pixels.
    pub bayer: Option<Bayer>,
    /// Whether the samples are raw sensor codes and not radiance.
    pub is_codes: bool,
    /// Where the pixel centres lie if the pictures are lat-long maps.
    pub latlong_centres: LatLongCentres,
    /// Frames per second; 0 for a single picture without a rate.
    pub frame_rate_hz: f64,
}

impl FrameFormat {
    fn of(frame: &Frame, attributes: &Attributes, frame_rate_hz: f64) -> Self {
        Self {
            width: frame.width,
            height: frame.height,
            channels: frame.channels,
            bayer: frame.bayer,
            is_codes: matches!(frame.pixels, Pixels::Codes(_)),
            latlong_centres: attributes.latlong_centres,
            frame_rate_hz,
        }
    }

    fn describe(&self) -> String {
        let samples = if self.is_codes { "codes" } else { "radiance" };
        let centres = match self.latlong_centres {
            LatLongCentres::Half => "",
            LatLongCentres::Ends => ", lat-long attribute",
        };
        let bayer = self.bayer.map(|bayer| format!(" ({bayer})")).unwrap_or_default();
        format!("{} x {} x {}{bayer} {samples}{centres}", self.width, self.height, self.channels)
    }
}

/// A source that reads numbered files in order.
#[derive(Debug)]
pub struct Sequence {
    path: PathBuf,
    /// Frame number and path, ascending by number, at least one.
    files: Vec<(u64, PathBuf)>,
    /// When each was captured after the first, where the names say so.
    times_ns: Option<Vec<i64>>,
    format: FrameFormat,
    /// The file whose format all others must have.
    model: PathBuf,
    repeat: bool,
    bayer: Option<Bayer>,
    /// Index of the next file, and number of complete passes before.
    index: usize,
    pass: u64,
    /// Sequence number that follows the last frame delivered.
    expected: u64,
    /// Files since the last usable one.
    bad_in_a_row: usize,
    /// Samples that were infinite, see [`Attributes::overflowed`].
    overflowed: Counter,
}

impl Sequence {
    /// Finds the files and reads until one is usable, whose format all others must have.
    ///
    /// # Errors
    ///
    /// Of kind [`Usage`](crate::error::Kind::Usage): no file matches, or none lies between `first` and
    /// `last`; the names do not form one sequence; no frame rate is known, or it is not a positive number. Of
    /// kind [`Failed`](crate::error::Kind::Failed): none of the files can be used.
    pub fn open(options: &SequenceOptions) -> Result<Self> {
        let path = &options.path;
        let fault = |message: String| Error::usage(message).at(path);
        let (first, last) = (options.first.unwrap_or(i64::MIN), options.last.unwrap_or(i64::MAX));
        let mut files = pattern::files(path)?;
        let (lowest, highest) = (files[0].0, files[files.len() - 1].0);
        files.retain(|(number, _)| (first..=last).contains(number));
        if files.is_empty() {
            let wanted = |name: &str, value: Option<i64>| {
                value.map_or(String::new(), |value| format!(" {name} = {value}"))
            };
            return Err(fault(format!(
                "no file has a number within{}{}; they have {lowest} to {highest}",
                wanted("first", options.first),
                wanted("last", options.last)
            )));
        }

        let mut frame = Frame::default();
        let (model, attributes) = first_readable(options, &files, &mut frame)?;
        let numbers: Vec<i64> = files.iter().map(|(number, _)| *number).collect();
        let rate = match options.frame_rate_hz.or(attributes.frame_rate_hz).or_else(|| rate_hz(&numbers)) {
            Some(rate) if rate.is_finite() && rate > 0.0 => rate,
            // The recording of a camera without a rate: its files have capture times.
            Some(0.0) if options.frame_rate_hz.is_none() && attributes.capture_time_ns.is_some() => 0.0,
            Some(rate) => {
                let fault = Error::usage("must be a positive number").at(Place::value("frame_rate_hz", rate));
                return Err(fault.at(path));
            }
            None if files.len() == 1 && !options.repeat => 0.0,
            None => {
                return Err(fault(
                    "no frame rate is known: the files have no framesPerSecond attribute; set frame_rate_hz"
                        .into(),
                ));
            }
        };
        let Timeline { numbers, times_ns, note } = Timeline::new(&numbers, rate);
        if let Some(note) = note {
            tracing::warn!("{}: {note}", path.display());
        }
        let model = model.to_owned();
        let files: Vec<(u64, PathBuf)> =
            numbers.into_iter().zip(files).map(|(number, (_, path))| (number, path)).collect();
        Ok(Self {
            path: path.clone(),
            expected: files[0].0,
            format: FrameFormat::of(&frame, &attributes, rate),
            model,
            files,
            times_ns,
            repeat: options.repeat,
            bayer: options.bayer,
            index: 0,
            pass: 0,
            bad_in_a_row: 0,
            overflowed: Counter::default(),
        })
    }

    /// Counts samples that were infinite in the files, and are the largest value that they may have had in
    /// the frames, by `overflowed` from now on.
    pub fn count_overflowed(&mut self, overflowed: Counter) {
        self.overflowed = overflowed;
    }

    /// The format of every frame.
    pub fn format(&self) -> FrameFormat {
        self.format
    }

    /// Remaining frames, readable or not; `None` when the sequence repeats.
    pub fn frame_count(&self) -> Option<u64> {
        (!self.repeat).then_some(self.files.len() as u64)
    }

    /// Number of files in one pass, readable or not.
    pub fn file_count(&self) -> usize {
        self.files.len()
    }

    /// The files in order, readable or not.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(|(_, path)| path.as_path())
    }

    /// Numbers from the first file to the last, missing ones included: the length of one pass in frame times.
    fn period(&self) -> u64 {
        (self.files[self.files.len() - 1].0 - self.files[0].0).saturating_add(1)
    }

    /// Reads a file and compares it with the first.
    fn fill(&self, path: &Path, frame: &mut Frame) -> Result<Attributes> {
        let attributes = read_of_size(path, [self.format.width, self.format.height], frame)?;
        take_as(self.bayer, path, frame)?;
        let found = FrameFormat::of(frame, &attributes, self.format.frame_rate_hz);
        if found == self.format {
            return Ok(attributes);
        }
        let (found, expected) = (found.describe(), self.format.describe());
        Err(Error::bad_frame(format!(
            "is {found}, but {} is {expected}; all frames must be alike",
            self.model.display()
        ))
        .at(path))
    }
}

/// Takes the frame of a file as a mosaic if `bayer` says so.
fn take_as(bayer: Option<Bayer>, path: &Path, frame: &mut Frame) -> Result<()> {
    if let Some(bayer) = bayer {
        if frame.channels != 1 || matches!(frame.pixels, Pixels::Radiance(_)) {
            return Err(Error::bad_frame(format!(
                "is no mosaic of colours {bayer}, which is a picture of one channel of raw sensor codes; remove \
                 the key `bayer` of [source] or give the sensor's own codes"
            ))
            .at(path));
        }
        frame.bayer = Some(bayer);
    }
    Ok(())
}

fn first_readable<'a>(
    options: &SequenceOptions,
    files: &'a [(i64, PathBuf)],
    frame: &mut Frame,
) -> Result<(&'a Path, Attributes)> {
    let mut first_error = None;
    for (_, file) in files {
        let attributes = read(file, frame);
        match attributes.and_then(|found| take_as(options.bayer, file, frame).map(|()| found)) {
            Ok(attributes) => return Ok((file, attributes)),
            Err(error) if error.kind() == Kind::NotNow => return Err(error),
            Err(error) => first_error = first_error.or(Some(error)),
        }
    }
    let mut fault = Error::failed(format!("none of {} files can be used", files.len()));
    if let Some(error) = first_error {
        fault = fault.because(error);
    }
    Err(fault.at(&options.path))
}

impl FrameSource for Sequence {
    fn next(&mut self, frame: &mut Frame) -> Result<Next> {
        if self.index == self.files.len() {
            if !self.repeat {
                return Ok(Next::End);
            }
            (self.index, self.pass) = (0, self.pass + 1);
        }
        if self.repeat && self.bad_in_a_row >= self.files.len() {
            // The folder may be away for a while. Every pass is waited for once.
            self.bad_in_a_row = 0;
            let message = format!("none of its {} files can be used for now", self.files.len());
            return Err(Error::not_now(message).at(&self.path));
        }
        let (number, path) = &self.files[self.index];
        let filled = match self.fill(path, frame) {
            // The next call reads the same file.
            Err(error) if error.kind() == Kind::NotNow => return Err(error),
            filled => filled,
        };
        let named_ns = self.times_ns.as_ref().map(|times_ns| times_ns[self.index]);
        self.index += 1;
        self.bad_in_a_row += 1;
        let Attributes { capture_time_ns, overflowed, .. } = filled?;
        let capture_time_ns = capture_time_ns.or(named_ns);
        self.overflowed.add(overflowed);
        self.bad_in_a_row = 0;

        // Overflow would require a sequence of 2^64 frames.
        let sequence = number.saturating_add(self.pass.saturating_mul(self.period()));
        let rate = self.format.frame_rate_hz;
        let time_ns = |steps: u64| if rate > 0.0 { (steps as f64 * 1e9 / rate).round() as i64 } else { 0 };
        frame.stamp.sequence = sequence;
        frame.stamp.capture_time_ns = match capture_time_ns {
            None => time_ns(sequence - self.files[0].0),
            Some(captured_ns) => captured_ns.saturating_add(time_ns(sequence - number)),
        };
        frame.stamp.lost_before = sequence.saturating_sub(self.expected);
        frame.stamp.frame_rate_hz = rate;
        self.expected = sequence.saturating_add(1);
        Ok(Next::Frame)
    }
}
