//! Errors of the algorithms: a [`Kind`] for the caller that decides what to do next, the option at fault as
//! data, and a sentence for the reader.

use std::fmt;

/// Shorthand for results with this crate's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What an error is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One frame cannot be used; the next one may be.
    BadFrame,
    /// An option or another argument is outside the range that its documentation gives.
    Usage,
}

/// An error: what was found, and what is expected, in one sentence.
#[derive(Clone, PartialEq, Eq)]
pub struct Error {
    kind: Kind,
    option: Option<String>,
    value: Option<String>,
    message: String,
}

impl Error {
    pub(crate) fn bad_frame(message: impl Into<String>) -> Self {
        Self { kind: Kind::BadFrame, option: None, value: None, message: message.into() }
    }

    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self { kind: Kind::Usage, option: None, value: None, message: message.into() }
    }

    /// Names the option at fault by its field's name, and its value where one value is wrong.
    pub(crate) fn in_option(mut self, option: &str, value: Option<&dyn fmt::Display>) -> Self {
        self.option = Some(option.to_owned());
        self.value = value.map(ToString::to_string);
        self
    }

    /// What it is about.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The option at fault, by its field's name, if the error is about an option.
    pub fn option(&self) -> Option<&str> {
        self.option.as_deref()
    }

    /// The value of the option, where one value is wrong.
    pub fn value(&self) -> Option<&str> {
        self.value.as_deref()
    }

    /// What is wrong, without option and value.
    pub fn message(&self) -> &str {
        &self.message
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.option, &self.value) {
            (Some(option), Some(value)) => write!(f, "{option} = {value}: ")?,
            (Some(option), None) => write!(f, "{option}: ")?,
            _ => {}
        }
        f.write_str(&self.message)
    }
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {self}", self.kind)
    }
}

impl std::error::Error for Error {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_at_fault_is_data_and_stands_in_front() {
        let error = Error::usage("give 1 to 9").in_option("count", Some(&0));
        assert_eq!(
            (error.option(), error.value(), error.message()),
            (Some("count"), Some("0"), "give 1 to 9")
        );
        assert_eq!(error.to_string(), "count = 0: give 1 to 9");
        assert_eq!(Error::usage("must ascend").in_option("knees", None).to_string(), "knees: must ascend");
        assert_eq!(Error::bad_frame("is empty").to_string(), "is empty");
    }
}
