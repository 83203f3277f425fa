//! Files that people write in TOML, and the position of faults in them.

use super::{Error, Place, Result, plain_words, read_at_most};
use serde::de::DeserializeOwned;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// Such files are a page or two; more is a picture or a recording given by mistake.
const SIZE_MAX_BYTES: u64 = 1 << 20;

/// A file as it was written.
#[derive(Clone, Debug, PartialEq)]
pub struct TomlText {
    /// Its path, for messages.
    pub path: PathBuf,
    /// Its contents.
    pub text: String,
}

impl TomlText {
    /// Reads a file.
    ///
    /// # Errors
    /// Kind `Usage`, naming the file: unreadable, not UTF-8, or above 1 MiB.
    pub fn load(path: &Path) -> Result<Self> {
        let unreadable = |error: std::io::Error| Error::usage("cannot be read").because(error).at(path);
        let bytes = read_at_most(path, SIZE_MAX_BYTES).map_err(unreadable)?;
        if bytes.len() as u64 > SIZE_MAX_BYTES {
            return Err(Error::usage("is larger than 1 MiB: nobody writes that by hand").at(path));
        }
        let text = String::from_utf8(bytes)
            .map_err(|_| unreadable(std::io::Error::new(ErrorKind::InvalidData, "it is not UTF-8")))?;
        Ok(Self { path: path.to_owned(), text })
    }

    /// The values by their keys.
    ///
    /// # Errors
    /// Kind `Usage`, naming file, line and what is written there: invalid TOML, unknown keys, wrong types.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T> {
        toml::from_str(&self.text).map_err(|error| {
            let message = plain_words(&error.message().replace('\n', ", "));
            let fault = match error.span() {
                Some(span) => {
                    let number = self.line_of_byte(span.start);
                    let written =
                        self.text.lines().nth(number as usize - 1).unwrap_or_default().trim().to_owned();
                    Error::usage(message).at(Place::Line { number, written: Some(written) })
                }
                None => Error::usage(message),
            };
            fault.at(&self.path)
        })
    }

    /// Adds file and line to an error about a value of `table` (empty: the whole file), by its
    /// [key](Error::key). Where no such key is written, the line is that of the innermost table around it,
    /// and where there is none either, the table is named instead.
    pub fn locate(&self, table: &str, error: Error) -> Error {
        let key = error.key().unwrap_or_default();
        let steps = table.split('.').chain(key.split(['.', '['])).filter(|step| !step.is_empty());
        let error = match self.line_of_key(steps) {
            Some(line) => error.at(Place::line(line)),
            None if table.is_empty() => error,
            None => error.at(format_args!("[{table}]")),
        };
        error.at(&self.path)
    }

    fn line_of_byte(&self, byte: usize) -> u64 {
        1 + self.text.bytes().take(byte).filter(|byte| *byte == b'\n').count() as u64
    }

    /// Line of a key, or of the innermost existing table around it.
    fn line_of_key<'a>(&self, steps: impl Iterator<Item = &'a str>) -> Option<u64> {
        let root = DeValue::Table(DeTable::parse(&self.text).ok()?.into_inner());
        let (mut value, mut start) = (&root, None);
        for step in steps {
            let next = match step.strip_suffix(']') {
                Some(index) => index.parse::<usize>().ok().and_then(|index| value.get(index)),
                None => value.get(step),
            };
            let Some(next) = next else { break };
            (value, start) = (next.get_ref(), Some(next.span().start));
        }
        start.map(|byte| self.line_of_byte(byte))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text() -> TomlText {
        let text = "frames = 3\n[sky]\nzenith = [1, 2, 3]\n\n[[sky.lamp]]\na = 1\n[[sky.lamp]]\na = 2\n[b]\n# c = 1\nd = {e = 4}\n";
        TomlText { path: "a.toml".into(), text: text.to_owned() }
    }

    #[test]
    fn values_are_found_or_else_the_table_about_them() {
        for (table, key, place) in [
            ("", "frames", "line 1: "),
            ("", "sky.zenith", "line 3: "),
            ("sky", "zenith", "line 3: "),
            ("", "sky.lamp[0].a", "line 6: "),
            ("", "sky.lamp[1].a", "line 8: "),
            ("", "sky.lamp[1].b", "line 7: "),
            ("", "sky.sun.path", "line 2: "),
            ("b", "c", "line 9: "),
            ("b", "d.e", "line 11: "),
            ("", "room", ""),
            ("room", "size", "[room]: "),
        ] {
            let error = text().locate(table, Error::usage("too much").at(Place::value(key, 4)));
            assert_eq!(error.to_string(), format!("a.toml: {place}{key} = 4: too much"));
        }
    }

    #[test]
    fn a_text_that_does_not_parse_is_told_with_its_line() {
        let broken = TomlText { text: "a = 1\nb =\n".to_owned(), ..text() };
        let error = broken.parse::<toml::Table>().unwrap_err().to_string();
        assert!(error.starts_with("a.toml: line 2 (`b =`): "), "{error}");
    }

    #[test]
    fn what_is_no_page_of_text_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, vec![b' '; (1 << 20) + 1]).unwrap();
        assert!(TomlText::load(&path).unwrap_err().to_string().contains("a.toml: is larger than 1 MiB"));
        std::fs::write(&path, [0xff]).unwrap();
        assert!(TomlText::load(&path).unwrap_err().to_string().contains("a.toml: cannot be read: "));
    }
}
