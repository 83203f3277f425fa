//! Commands that print the figures of a report again, as a shell takes them.

use super::Arguments;
use super::inputs::{Map, Moving};
use crate::report::tables::COUNTS;
use std::path::Path;

/// The command that prints the tables of maps; for built-in maps it prints those of all of them.
pub(super) fn of_maps<'a>(arguments: &Arguments, maps: impl Iterator<Item = &'a Map>) -> String {
    with_inputs(of_lights(arguments), maps.filter_map(|map| map.path.as_deref()))
}

/// The command that prints the table of a sequence as the report with these arguments has it.
pub(super) fn of_sequence(arguments: &Arguments, moving: &Moving) -> String {
    let mut command = of_lights(arguments);
    match moving {
        Moving::Made(_) => {
            for (option, path) in [("--garden", &arguments.garden), ("--hall", &arguments.hall)] {
                if let Some(path) = path {
                    command += &format!(" {option} {}", quoted(&path.to_string_lossy()));
                }
            }
            command
        }
        Moving::BuiltIn(_) => command + &of_frames(arguments),
        Moving::Recorded(recorded) => {
            command += &of_frames(arguments);
            if let Some(rate_hz) = arguments.frame_rate.filter(|_| !recorded.is_configured()) {
                command += &format!(" --frame-rate {rate_hz}");
            }
            if recorded.is_configured() {
                // This option takes a file of any name.
                command += " --config";
            }
            with_inputs(command, std::iter::once(recorded.path()))
        }
    }
}

fn of_lights(arguments: &Arguments) -> String {
    let mut command = "lightcast report --tables".to_owned();
    if arguments.lights != COUNTS {
        let counts: Vec<String> = arguments.lights.iter().map(usize::to_string).collect();
        command += &format!(" --lights {}", counts.join(","));
    }
    command
}

fn of_frames(arguments: &Arguments) -> String {
    arguments.frames.map(|frames| format!(" --frames {frames}")).unwrap_or_default()
}

fn with_inputs<'a>(mut command: String, inputs: impl Iterator<Item = &'a Path>) -> String {
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
fn quoted(word: &str) -> String {
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
