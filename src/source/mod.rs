//! Sources of frames: recorded sequences of files ([`Sequence`]), synthetic ones ([`synthetic`]) and live
//! cameras ([`LiveCamera`], `v4l2`).
//!
//! A [`FrameSource`] delivers a frame whenever it is asked; a stage with a clock asks at the right time. A
//! camera has its own pace; a stage waits for it and restarts it after a loss.

mod bracket;
mod file_number;
mod live;
mod pattern;
mod sequence;
pub mod synthetic;
#[cfg(feature = "camera")]
pub mod v4l2;

pub use bracket::{Bracket, BracketOptions, ExposureControl};
pub use live::{BadBuffer, Captured, LiveCamera, Mark, Numbered, Numbering};
pub use sequence::{FrameFormat, Sequence, SequenceOptions};

use crate::error::Result;
use lightcast_core::image::Frame;

/// What a source returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// A frame.
    Frame,
    /// The end: there are no further frames.
    End,
}

/// A source of frames.
pub trait FrameSource: Send {
    /// Fills `frame`, whose buffers are reused, with the next picture and its stamp.
    ///
    /// # Errors
    ///
    /// Of kind [`BadFrame`](crate::error::Kind::BadFrame): this frame is lost and the content of `frame` is
    /// meaningless; the next call continues after it and counts it in `lost_before`. Of kind
    /// [`NotNow`](crate::error::Kind::NotNow): the next call tries the same again. Of any other kind: calling
    /// again is useless.
    fn next(&mut self, frame: &mut Frame) -> Result<Next>;
}
