//! Where frames come from: recorded sequences of files ([`Sequence`]), calculated ones ([`synthetic`]) and
//! live cameras ([`LiveCamera`], `v4l2`).
//!
//! A [`FrameSource`] delivers as fast as it is asked; a stage with a clock asks at the right time. A camera
//! has its own pace; a stage waits for it, and starts it again when it was lost.

mod bracket;
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

/// What a source came back with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// A frame.
    Frame,
    /// Nothing, now and from here on.
    End,
}

/// Where frames come from.
pub trait FrameSource: Send {
    /// Fills `frame`, whose buffers are reused, with the next picture and its stamp.
    ///
    /// # Errors
    ///
    /// Of kind [`BadFrame`](crate::error::Kind::BadFrame): this frame is lost and the content of `frame`
    /// means nothing; the next call goes on behind it and counts it in `lost_before`. Of any other kind:
    /// there is no use in calling again.
    fn next(&mut self, frame: &mut Frame) -> Result<Next>;
}
