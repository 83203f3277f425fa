//! The one error type: a [`Kind`] for the machine that decides what to do next, and a sentence with a
//! position (file, frame, line, byte) for the person who reads it.

mod toml_text;

pub use toml_text::TomlText;

use std::fmt;

/// Shorthand for results with this crate's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What the supervisor does about an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One frame cannot be used: count it and go on with the next.
    BadFrame,
    /// A device does not answer or has gone: try again later.
    LostDevice,
    /// The command line, a configuration or a calibration is wrong: exit code 2.
    Usage,
    /// Anything else: stop, exit code 1.
    Failed,
}

/// An error: what went wrong, where, and what to do, in one sentence.
pub struct Error {
    kind: Kind,
    message: String,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl Error {
    /// A frame that cannot be used; `message` names file and frame.
    pub fn bad_frame(message: impl Into<String>) -> Self {
        Self { kind: Kind::BadFrame, message: message.into(), source: None }
    }

    /// A device that does not answer or has gone; `message` names it.
    pub fn lost_device(message: impl Into<String>) -> Self {
        Self { kind: Kind::LostDevice, message: message.into(), source: None }
    }

    /// A mistake in a command line, configuration or calibration; `message` names file, line or key.
    pub fn usage(message: impl Into<String>) -> Self {
        Self { kind: Kind::Usage, message: message.into(), source: None }
    }

    /// Anything that stops the program.
    pub fn failed(message: impl Into<String>) -> Self {
        Self { kind: Kind::Failed, message: message.into(), source: None }
    }

    /// Adds the error that caused this one; it is printed after the message.
    #[must_use]
    pub fn because(mut self, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        self.source = Some(source.into());
        self
    }

    /// Puts a position or a circumstance in front of the message, as in `frame 17: ...`.
    #[must_use]
    pub fn at(mut self, place: impl fmt::Display) -> Self {
        self.message = format!("{place}: {}", self.message);
        self
    }

    /// Changes the kind: the same fault may end a program that reads one file and be skipped in a sequence.
    #[must_use]
    pub fn with_kind(mut self, kind: Kind) -> Self {
        self.kind = kind;
        self
    }

    /// What to do about it.
    pub fn kind(&self) -> Kind {
        self.kind
    }
}

impl From<lightcast_core::error::Error> for Error {
    fn from(error: lightcast_core::error::Error) -> Self {
        let kind = match error.kind() {
            lightcast_core::error::Kind::BadFrame => Kind::BadFrame,
            lightcast_core::error::Kind::Usage => Kind::Usage,
        };
        Self { kind, message: error.to_string(), source: None }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)?;
        match &self.source {
            Some(source) => write!(f, ": {source}"),
            None => Ok(()),
        }
    }
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {self}", self.kind)
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.source.as_deref().map(|source| source as _)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_reads_place_then_fault_then_cause() {
        let error =
            Error::bad_frame("cannot be decoded").because("byte 17: bad magic").at("a.exr").at("frame 3");
        assert_eq!(error.to_string(), "frame 3: a.exr: cannot be decoded: byte 17: bad magic");
        assert_eq!(error.kind(), Kind::BadFrame);
    }
}
