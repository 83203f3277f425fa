//! The one error type: a [`Kind`] for the code that decides what to do next, the place of the fault as data
//! ([`Place`]), and a sentence for the reader.

mod place;
mod plain_words;
mod text_file;
mod toml_text;

pub use place::Place;
pub use plain_words::plain_words;
pub use text_file::{read_at_most, without_mark};
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
    /// What is needed is taken, and will be there again, such as a file handle: wait, and try the same again.
    NotNow,
    /// The command line, a configuration or a calibration is wrong: exit code 2.
    Usage,
    /// Anything else: stop, exit code 1.
    Failed,
}

/// An error: what went wrong, where, and what to do. It reads as one sentence, `PLACE: PLACE: MESSAGE:
/// CAUSE`.
pub struct Error {
    kind: Kind,
    /// The innermost first.
    places: Vec<Place>,
    message: String,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl Error {
    /// A frame that cannot be used.
    pub fn bad_frame(message: impl Into<String>) -> Self {
        Self::new(Kind::BadFrame, message.into())
    }

    /// A device that does not answer or has gone.
    pub fn lost_device(message: impl Into<String>) -> Self {
        Self::new(Kind::LostDevice, message.into())
    }

    /// Something that cannot be had for now.
    pub fn not_now(message: impl Into<String>) -> Self {
        Self::new(Kind::NotNow, message.into())
    }

    /// A mistake in a command line, configuration or calibration.
    pub fn usage(message: impl Into<String>) -> Self {
        Self::new(Kind::Usage, message.into())
    }

    /// Anything that stops the program.
    pub fn failed(message: impl Into<String>) -> Self {
        Self::new(Kind::Failed, message.into())
    }

    fn new(kind: Kind, message: String) -> Self {
        Self { kind, places: Vec::new(), message, source: None }
    }

    /// Adds the error that caused this one; it is printed after the message.
    #[must_use]
    pub fn because(mut self, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        self.source = Some(source.into());
        self
    }

    /// Says where: puts a place in front of the message so far, as in `frame 17: ...`. A key about a key
    /// makes one path of both, as in `sky.sun.radiance: ...`.
    #[must_use]
    pub fn at(mut self, place: impl Into<Place>) -> Self {
        match (place.into(), self.places.last_mut()) {
            (Place::Key { name: table, value: None }, Some(Place::Key { name, .. })) => {
                *name = format!("{table}.{name}");
            }
            (place, _) => self.places.push(place),
        }
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

    /// The places of the fault, from the outermost (most often a file) inwards.
    pub fn places(&self) -> impl Iterator<Item = &Place> {
        self.places.iter().rev()
    }

    /// The key at fault, as in `sky.sun.path[1].time_s`.
    pub fn key(&self) -> Option<&str> {
        self.places().find_map(|place| match place {
            Place::Key { name, .. } => Some(name.as_str()),
            _ => None,
        })
    }
}

impl From<lightcast_core::error::Error> for Error {
    fn from(error: lightcast_core::error::Error) -> Self {
        let kind = match error.kind() {
            lightcast_core::error::Kind::BadFrame => Kind::BadFrame,
            lightcast_core::error::Kind::Usage => Kind::Usage,
        };
        let places = error
            .option()
            .map(|option| Place::Key { name: option.to_owned(), value: error.value().map(str::to_owned) });
        Self { places: places.into_iter().collect(), ..Self::new(kind, error.message().to_owned()) }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for place in self.places() {
            write!(f, "{place}: ")?;
        }
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
    use std::path::Path;

    #[test]
    fn message_reads_places_then_fault_then_cause() {
        let error = Error::bad_frame("cannot be decoded")
            .because("bad magic")
            .at(Place::Byte(17))
            .at(Path::new("a.exr"))
            .at(Place::Frame(3));
        assert_eq!(error.to_string(), "frame 3: a.exr: byte 17: cannot be decoded: bad magic");
        assert_eq!(error.kind(), Kind::BadFrame);
        let places = [Place::Frame(3), Place::File("a.exr".into()), Place::Byte(17)];
        assert!(error.places().eq(&places), "{:?}", error.places);
        assert_eq!(error.key(), None);
    }

    #[test]
    fn an_option_of_the_core_is_a_key() {
        use lightcast_core::light::Options;
        let error = Error::from(Options { count: 0, ..Options::default() }.check().unwrap_err());
        assert_eq!((error.kind(), error.key()), (Kind::Usage, Some("count")));
        assert!(error.to_string().starts_with("count = 0: give 1 to "), "{error}");
    }

    #[test]
    fn keys_about_keys_make_a_path() {
        let error = Error::usage("must be finite").at(Place::value("time_s", f64::NAN));
        let error = error.at(Place::key("path[1]")).at(Place::key("sky.sun")).at(Place::line(7));
        assert_eq!(error.to_string(), "line 7: sky.sun.path[1].time_s = NaN: must be finite");
        assert_eq!(error.key(), Some("sky.sun.path[1].time_s"));
        let apart = Error::usage("no such file").at("a.exr").at(Place::key("file"));
        assert_eq!((apart.to_string().as_str(), apart.key()), ("file: a.exr: no such file", Some("file")));
    }
}
