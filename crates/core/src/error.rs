//! What the algorithms refuse: a [`Kind`] for the caller that decides what to do next, and a sentence for its reader.

use std::fmt;

/// Shorthand for results with this crate's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What an error is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One frame cannot be used; the next one may be.
    BadFrame,
    /// An option or another argument is outside of what its documentation says.
    Usage,
}

/// An error: what was found, and what is wanted, in one sentence.
#[derive(Clone, PartialEq, Eq)]
pub struct Error {
    kind: Kind,
    message: String,
}

impl Error {
    pub(crate) fn bad_frame(message: impl Into<String>) -> Self {
        Self { kind: Kind::BadFrame, message: message.into() }
    }

    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self { kind: Kind::Usage, message: message.into() }
    }

    /// What it is about.
    pub fn kind(&self) -> Kind {
        self.kind
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {self}", self.kind)
    }
}

impl std::error::Error for Error {}
