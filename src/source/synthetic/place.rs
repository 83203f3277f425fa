//! Where in a script a fault stands.

use crate::error::Error;
use std::path::Path;
use toml::de::{DeTable, DeValue};

/// The error of a text that is no TOML, or that has a key or a type which does not belong there.
pub(super) fn of_toml(error: &toml::de::Error, text: &str, path: &Path) -> Error {
    let line = error.span().map_or(1, |span| line_of_byte(text, span.start));
    let written = text.lines().nth(line - 1).unwrap_or_default().trim();
    let message = error.message().replace('\n', ", ");
    Error::usage(format!("{}:{line}: {message}, in `{written}`", path.display()))
}

/// The error of a value that does not fit; `message` begins with its key, as in `sky.lamp[1].radius_deg must ...`.
pub(super) fn of_value(message: &str, text: &str, path: &Path) -> Error {
    let key = message.split([' ', ':', ',']).next().unwrap_or_default();
    let line = line_of_key(text, key);
    Error::usage(format!("{}:{line}: {message}", path.display()))
}

fn line_of_byte(text: &str, byte: usize) -> usize {
    1 + text.bytes().take(byte).filter(|byte| *byte == b'\n').count()
}

/// Line of a key, or of the innermost table about it that is there; 1 where there is none.
fn line_of_key(text: &str, key: &str) -> usize {
    let Ok(table) = DeTable::parse(text) else { return 1 };
    let root = DeValue::Table(table.into_inner());
    let (mut value, mut start) = (&root, 0);
    for step in key.split(['.', '[']) {
        let next = match step.strip_suffix(']') {
            Some(index) => index.parse::<usize>().ok().and_then(|index| value.get(index)),
            None => value.get(step),
        };
        let Some(next) = next else { break };
        (value, start) = (next.get_ref(), next.span().start);
    }
    line_of_byte(text, start)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "frames = 3\n[sky]\nzenith = [1, 2, 3]\n\n[[sky.lamp]]\na = 1\n[[sky.lamp]]\na = 2\n";

    #[test]
    fn keys_are_found_or_else_the_table_about_them() {
        for (key, line) in [
            ("frames", 1),
            ("sky.zenith", 3),
            ("sky.lamp[0].a", 6),
            ("sky.lamp[1].a", 8),
            ("sky.lamp[1].b", 7),
            ("sky.sun.path", 2),
            ("room", 1),
        ] {
            assert_eq!(line_of_key(TEXT, key), line, "{key}");
        }
    }

    #[test]
    fn messages_name_file_line_and_key() {
        let error = of_value("sky.zenith must be light", TEXT, Path::new("a.toml"));
        assert_eq!(error.to_string(), "a.toml:3: sky.zenith must be light");
    }
}
