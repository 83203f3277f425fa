//! Where in the text of a configuration a fault stands.

use crate::error::Error;
use std::path::PathBuf;

/// The error of a text that is no TOML, or has a key or value that does not belong there.
pub(super) fn of_toml(error: &toml::de::Error, text: &str) -> Error {
    match error.span() {
        Some(span) => at_line(text, line_of_byte(text, span.start), error.message()),
        None => Error::usage(error.message()),
    }
}

/// A configuration as it was written: what it takes to say where a fault stands.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Origin {
    pub path: PathBuf,
    pub text: String,
}

impl Origin {
    /// Puts file and line in front of an error about a value of `section` whose message begins with the key.
    pub fn locate(&self, section: &str, error: Error) -> Error {
        let message = error.to_string();
        let key = message.split([' ', '=', ':']).next().unwrap_or_default();
        let error = match line_of_key(&self.text, section, key) {
            Some(line) => error.at(format_args!("line {line}")),
            // The message is about several keys, or the section is written as an inline table.
            None => error.at(format_args!("[{section}]")),
        };
        error.at(self.path.display())
    }
}

fn at_line(text: &str, line: usize, message: &str) -> Error {
    let written = text.lines().nth(line - 1).unwrap_or_default().trim();
    Error::usage(format!("line {line} (`{written}`): {}", message.replace('\n', ", ")))
}

fn line_of_byte(text: &str, byte: usize) -> usize {
    1 + text.bytes().take(byte).filter(|&byte| byte == b'\n').count()
}

/// Line of `key = ` under the heading `[section]`, counted from 1.
fn line_of_key(text: &str, section: &str, key: &str) -> Option<usize> {
    let mut here = "";
    for (index, line) in text.lines().map(str::trim).enumerate() {
        if let Some(heading) = line.strip_prefix('[').and_then(|rest| rest.split(']').next()) {
            here = heading.trim();
        } else if here == section
            && line.strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with('='))
        {
            return Some(index + 1);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[a]\nrate = 1\n[b]\n# rate = 2\nrates = 3\n  rate = 4\n";

    #[test]
    fn a_key_is_found_in_its_own_section() {
        assert_eq!(line_of_key(TEXT, "a", "rate"), Some(2));
        assert_eq!(line_of_key(TEXT, "b", "rate"), Some(6));
        assert_eq!(line_of_key(TEXT, "c", "rate"), None);
        assert_eq!((line_of_byte(TEXT, 0), line_of_byte(TEXT, 4)), (1, 2));
    }

    #[test]
    fn a_fault_of_a_value_gets_the_line_of_its_key() {
        let origin = Origin { path: "a.toml".into(), text: TEXT.to_owned() };
        let error = origin.locate("b", Error::usage("rate = 4: too much"));
        assert_eq!(error.to_string(), "a.toml: line 6: rate = 4: too much");
        let error = origin.locate("b", Error::usage("count = 0: too few"));
        assert_eq!(error.to_string(), "a.toml: [b]: count = 0: too few");
    }
}
