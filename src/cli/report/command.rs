//! Commands that print the figures of a report again, as a shell takes them.

use super::Arguments;
use crate::report::tables::COUNTS;
use std::path::Path;

/// Prints the tables of these inputs, as the report with these arguments has them.
pub(super) fn command<'a>(arguments: &Arguments, inputs: impl Iterator<Item = &'a Path>) -> String {
    let mut command = "lightcast report --tables".to_owned();
    if arguments.lights != COUNTS {
        let counts: Vec<String> = arguments.lights.iter().map(usize::to_string).collect();
        command += &format!(" --lights {}", counts.join(","));
    }
    if arguments.frames != 100 {
        command += &format!(" --frames {}", arguments.frames);
    }
    if let Some(rate_hz) = arguments.frame_rate {
        command += &format!(" --frame-rate {rate_hz}");
    }
    for input in inputs {
        command += " ";
        command += &quoted(&input.to_string_lossy());
    }
    command
}

/// The command line of this process.
pub(super) fn command_line() -> String {
    let words = std::env::args_os().skip(1).map(|word| quoted(&word.to_string_lossy()));
    std::iter::once("lightcast".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// A word as a shell takes it.
pub(super) fn quoted(word: &str) -> String {
    let is_plain =
        |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '/' | ',' | ':' | '=' | '+' | '@');
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_read_them_otherwise() {
        let found = ["a/b_1k.hdr", "two words", "it's", "", "$HOME", "sky.####.exr", "é"].map(quoted);
        assert_eq!(
            found,
            ["a/b_1k.hdr", "'two words'", r"'it'\''s'", "''", "'$HOME'", "'sky.####.exr'", "é"]
        );
    }
}
