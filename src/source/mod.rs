//! Where frames come from: recorded sequences of files ([`Sequence`]) and calculated ones ([`synthetic`]).
//!
//! A source delivers as fast as it is asked; a stage with a clock asks at the right time.

mod pattern;
mod sequence;
pub mod synthetic;

pub use sequence::{FrameFormat, Sequence, SequenceOptions};

use crate::error::Result;
use crate::image::Frame;

/// What a source came back with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// A frame.
    Frame,
    /// Nothing, now and from here on.
    End,
}

/// Where frames come from.
pub trait Source: Send {
    /// Fills `frame`, whose buffers are reused, with the next picture and its stamp.
    ///
    /// # Errors
    ///
    /// Of kind [`BadFrame`](crate::error::Kind::BadFrame): this frame is lost and the content of `frame` means
    /// nothing; the next call goes on behind it and counts it in `lost_before`. Of any other kind: there is no
    /// use in calling again.
    fn next(&mut self, frame: &mut Frame) -> Result<Next>;
}
