use std::fmt;
use std::path::{Path, PathBuf};

/// The place of a fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A file, or a folder.
    File(PathBuf),
    /// A line of a text.
    Line {
        /// Counted from 1.
        number: u64,
        /// What is written there, where the message does not say it.
        written: Option<String>,
    },
    /// A byte of a message or a file, counted from 0.
    Byte(usize),
    /// A frame, by its number in the sequence.
    Frame(u64),
    /// A light list, by its sequence number.
    List(u64),
    /// A key of a configuration, script or table.
    Key {
        /// As in `sky.sun.path[1].time_s`, beginning in the table that the fault was found in.
        name: String,
        /// Its value as it is written, where one value is wrong.
        value: Option<String>,
    },
    /// Something with a name and no number: a device, an address, a part of a file. Or a circumstance, in
    /// words.
    Part(String),
}

impl Place {
    /// A line, counted from 1.
    pub fn line(number: u64) -> Self {
        Self::Line { number, written: None }
    }

    /// A key.
    pub fn key(name: impl Into<String>) -> Self {
        Self::Key { name: name.into(), value: None }
    }

    /// A key with a value that is not allowed.
    pub fn value(name: impl Into<String>, value: impl fmt::Display) -> Self {
        Self::Key { name: name.into(), value: Some(value.to_string()) }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(f, "{}", path.display()),
            Self::Line { number, written: None } => write!(f, "line {number}"),
            Self::Line { number, written: Some(written) } => write!(f, "line {number} (`{written}`)"),
            Self::Byte(number) => write!(f, "byte {number}"),
            Self::Frame(number) => write!(f, "frame {number}"),
            Self::List(number) => write!(f, "list {number}"),
            Self::Key { name, value: None } => f.write_str(name),
            Self::Key { name, value: Some(value) } => write!(f, "{name} = {value}"),
            Self::Part(name) => f.write_str(name),
        }
    }
}

impl From<&Path> for Place {
    fn from(path: &Path) -> Self {
        Self::File(path.to_owned())
    }
}

impl From<&PathBuf> for Place {
    fn from(path: &PathBuf) -> Self {
        Self::File(path.clone())
    }
}

impl From<&str> for Place {
    fn from(part: &str) -> Self {
        Self::Part(part.to_owned())
    }
}

impl From<String> for Place {
    fn from(part: String) -> Self {
        Self::Part(part)
    }
}

impl From<&String> for Place {
    fn from(part: &String) -> Self {
        Self::Part(part.clone())
    }
}

impl From<fmt::Arguments<'_>> for Place {
    fn from(part: fmt::Arguments<'_>) -> Self {
        Self::Part(part.to_string())
    }
}
