//! The interface of a live camera to the stage that runs it, and the numbering of its frames.

use crate::error::Result;
use lightcast_core::image::{Frame, Stamp};
use std::time::Duration;

/// A device that delivers frames at its own pace and may be lost at any time.
pub trait LiveCamera: Send {
    /// Opens the device and starts it, the first time or again after a loss.
    ///
    /// # Errors
    /// `LostDevice`: it cannot start now, but perhaps later. Any other kind: it can never start as
    /// configured.
    fn start(&mut self) -> Result<()>;

    /// Waits at most `patience` for a frame and fills `frame`'s picture; the stamp is left alone.
    ///
    /// # Errors
    /// `LostDevice`: it has to be started again.
    fn capture(&mut self, patience: Duration, frame: &mut Frame) -> Result<Captured>;

    /// Releases the device.
    fn stop(&mut self);
}

impl<C: LiveCamera + ?Sized> LiveCamera for Box<C> {
    fn start(&mut self) -> Result<()> {
        (**self).start()
    }

    fn capture(&mut self, patience: Duration, frame: &mut Frame) -> Result<Captured> {
        (**self).capture(patience, frame)
    }

    fn stop(&mut self) {
        (**self).stop();
    }
}

/// The outcome of waiting for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Captured {
    /// A frame.
    Frame(Mark),
    /// A frame that cannot be used, and why.
    Bad(Mark, BadBuffer),
    /// A part of a frame that is not complete yet.
    Part,
    /// No frame yet.
    Nothing,
}

/// Why a buffer cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadBuffer {
    /// The driver says that its content is damaged.
    Faulty,
    /// It holds fewer bytes than a picture has.
    Short,
    /// Its compressed picture cannot be decoded.
    Undecodable,
    /// It consists of several exposures, some of which are missing or had not been set.
    Incomplete,
}

/// Sequence count and times that the kernel gives a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mark {
    /// The driver's count of frames since the start of the stream; wraps around.
    pub sequence: u32,
    /// Time of capture on the kernel's monotonic clock in nanoseconds.
    pub time_ns: i64,
    /// Age of the frame when it was taken out of the driver's queue.
    pub age_ns: i64,
}

/// Turns the driver's counts, which begin anew with every start and have 32 bits, into sequence numbers that
/// never decrease, and reports how many frames were lost in between.
///
/// Within one start the difference of the counts gives the loss. Across a restart it is estimated from the
/// elapsed time and the camera's rate.
#[derive(Clone, Debug)]
pub struct Numbering {
    frame_rate_hz: f64,
    /// Mark and sequence number of the last frame that was used.
    last: Option<(Mark, u64)>,
    /// The last count seen since the start, whether or not its frame was used.
    count: Option<u32>,
    /// Since the last used frame: whether the stream was started again, frames that came and were not used,
    /// frames that the kernel counted and never delivered.
    was_away: bool,
    unused: u64,
    dropped: u64,
    /// Frames in a row that were out of order.
    refused: u32,
}

/// Number of consecutive frames out of order after which the driver is taken to have restarted its count.
const REFUSED_MAX: u32 = 8;

/// What [`Numbering::number`] returns for a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbered {
    /// Stamp of the frame; its `lost_before` includes the two counts below and the frames that were not used.
    pub stamp: Stamp,
    /// Frames that the kernel counted and never delivered.
    pub dropped_by_kernel: u64,
    /// Frames that the camera would have taken while it was away.
    pub missed_while_away: u64,
}

impl Numbering {
    /// Numbering for a camera of this rate; 0 if it is unknown: no losses are then counted across a restart.
    pub fn new(frame_rate_hz: f64) -> Self {
        Self { frame_rate_hz, last: None, count: None, was_away: false, unused: 0, dropped: 0, refused: 0 }
    }

    /// Notes that the stream was started again and its counts begin anew.
    pub fn restart(&mut self) {
        self.count = None;
        self.was_away = true;
    }

    /// Counts a frame that cannot be used; several with the same count are counted once.
    pub fn skip(&mut self, mark: Mark) {
        let is_counted = self.count == Some(mark.sequence);
        if self.advance(mark) && !is_counted {
            self.unused += 1;
        }
    }

    /// Numbers a frame; `None` when it is older than an earlier arrival, whose `lost_before` already includes
    /// it.
    ///
    /// Drivers that do not count give every frame the same number: their frames are taken as consecutive.
    pub fn number(&mut self, mark: Mark) -> Option<Numbered> {
        if !self.advance(mark) {
            return None;
        }
        let (unused, dropped) = (std::mem::take(&mut self.unused), std::mem::take(&mut self.dropped));
        let was_away = std::mem::take(&mut self.was_away);
        let mut numbered =
            Numbered { stamp: Stamp::default(), dropped_by_kernel: dropped, missed_while_away: 0 };
        if let Some((last, sequence)) = self.last {
            if was_away {
                let frames = mark.time_ns.saturating_sub(last.time_ns) as f64 * 1e-9 * self.frame_rate_hz;
                // Negative times become 0 here.
                numbered.missed_while_away = (frames.round() as u64).saturating_sub(1 + unused + dropped);
            }
            let lost_before = unused + dropped + numbered.missed_while_away;
            (numbered.stamp.sequence, numbered.stamp.lost_before) = (sequence + 1 + lost_before, lost_before);
        }
        numbered.stamp.capture_time_ns = mark.time_ns;
        numbered.stamp.frame_rate_hz = self.frame_rate_hz;
        self.last = Some((mark, numbered.stamp.sequence));
        Some(numbered)
    }

    /// Goes on to this count; false for one that is out of order.
    fn advance(&mut self, mark: Mark) -> bool {
        // Counts wrap: what is less than half a round ahead is later.
        let step = self.count.map_or(1, |count| mark.sequence.wrapping_sub(count) as i32);
        if step < 0 && self.refused < REFUSED_MAX {
            self.refused += 1;
            return false;
        }
        if step < 0 {
            self.was_away = true;
        }
        self.refused = 0;
        self.count = Some(mark.sequence);
        let gap = u64::from(step.max(1).unsigned_abs()) - 1;
        self.dropped += gap.min(self.frames_since_last(mark).unwrap_or(gap));
        true
    }

    /// Most frames that the camera can have taken since the last one that was used; `None` where the rate or
    /// the times are not known. It bounds the loss when the driver's count jumps.
    fn frames_since_last(&self, mark: Mark) -> Option<u64> {
        let elapsed_ns = mark.time_ns.saturating_sub(self.last?.0.time_ns);
        let is_known = self.frame_rate_hz > 0.0 && elapsed_ns > 0;
        // Half as many again are allowed, because rates are nominal and times jitter.
        is_known.then(|| (1.5 * elapsed_ns as f64 * 1e-9 * self.frame_rate_hz).ceil() as u64 + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(sequence: u32, time_ms: i64) -> Mark {
        Mark { sequence, time_ns: time_ms * 1_000_000, age_ns: 0 }
    }

    /// Sequence number and all losses of the frame with this mark.
    fn numbers(numbering: &mut Numbering, mark: Mark) -> [u64; 4] {
        let found = numbering.number(mark).unwrap();
        let Numbered { stamp, dropped_by_kernel, missed_while_away } = found;
        assert_eq!((stamp.capture_time_ns, stamp.frame_rate_hz), (mark.time_ns, 25.0));
        [stamp.sequence, stamp.lost_before, dropped_by_kernel, missed_while_away]
    }

    #[test]
    fn gaps_and_unused_frames_are_lost_before_the_next_one() {
        let mut numbering = Numbering::new(25.0);
        // The driver may begin with any count.
        assert_eq!(numbers(&mut numbering, mark(7, 0)), [0, 0, 0, 0]);
        assert_eq!(numbers(&mut numbering, mark(8, 40)), [1, 0, 0, 0]);
        assert_eq!(numbers(&mut numbering, mark(11, 160)), [4, 2, 2, 0]);
        numbering.skip(mark(12, 200));
        assert_eq!(numbers(&mut numbering, mark(13, 240)), [6, 1, 0, 0]);
    }

    #[test]
    fn a_gap_before_an_unused_frame_is_not_forgotten() {
        let mut numbering = Numbering::new(25.0);
        numbers(&mut numbering, mark(0, 0));
        numbering.skip(mark(3, 120));
        assert_eq!(numbers(&mut numbering, mark(4, 160)), [4, 3, 2, 0]);
    }

    #[test]
    fn frames_out_of_order_are_not_used_and_hide_no_gap() {
        let mut numbering = Numbering::new(25.0);
        numbers(&mut numbering, mark(5, 0));
        assert_eq!(numbers(&mut numbering, mark(7, 80)), [2, 1, 1, 0]);
        assert_eq!(numbering.number(mark(6, 40)), None);
        numbering.skip(mark(6, 40));
        assert_eq!(numbers(&mut numbering, mark(8, 120)), [3, 0, 0, 0]);
    }

    #[test]
    fn a_driver_that_begins_to_count_anew_is_believed_after_a_few_frames() {
        let mut numbering = Numbering::new(25.0);
        numbers(&mut numbering, mark(100_000, 0));
        for frame in 0..8 {
            assert_eq!(numbering.number(mark(frame, 40 * i64::from(frame + 1))), None);
        }
        // The ninth is accepted: eight were not used, and the elapsed time accounts for them.
        assert_eq!(numbers(&mut numbering, mark(8, 360)), [9, 8, 0, 8]);
        assert_eq!(numbers(&mut numbering, mark(9, 400)), [10, 0, 0, 0]);
    }

    #[test]
    fn a_count_that_leaps_loses_no_more_frames_than_the_time_holds() {
        let mut numbering = Numbering::new(25.0);
        numbers(&mut numbering, mark(0, 0));
        let [_, lost, dropped, _] = numbers(&mut numbering, mark(2_000_000_000, 40));
        assert_eq!((lost, dropped), (3, 3));
    }

    #[test]
    fn counts_wrap_and_drivers_without_counts_have_neighbours_only() {
        let mut numbering = Numbering::new(25.0);
        numbers(&mut numbering, mark(u32::MAX, 0));
        assert_eq!(numbers(&mut numbering, mark(0, 40)), [1, 0, 0, 0]);
        assert_eq!(numbers(&mut numbering, mark(0, 80)), [2, 0, 0, 0]);
    }

    #[test]
    fn a_frame_that_cannot_be_used_after_a_restart_does_not_hide_the_time_away() {
        let mut numbering = Numbering::new(25.0);
        numbers(&mut numbering, mark(9, 0));
        numbering.restart();
        numbering.skip(mark(0, 360));
        assert_eq!(numbers(&mut numbering, mark(1, 400)), [10, 9, 0, 8]);
    }

    #[test]
    fn over_a_restart_the_time_tells_what_was_missed() {
        let mut numbering = Numbering::new(25.0);
        numbers(&mut numbering, mark(100, 0));
        numbering.restart();
        assert_eq!(numbers(&mut numbering, mark(0, 1000)), [25, 24, 0, 24]);
        assert_eq!(numbers(&mut numbering, mark(1, 1040)), [26, 0, 0, 0]);
        numbering.restart();
        // Nobody sets a monotonic clock, but a driver may report any time.
        assert_eq!(numbers(&mut numbering, mark(0, -5000)), [27, 0, 0, 0]);
        let mut unknown = Numbering::new(0.0);
        unknown.number(mark(0, 0)).unwrap();
        unknown.restart();
        assert_eq!(unknown.number(mark(0, 9000)).unwrap().missed_while_away, 0);
    }
}
