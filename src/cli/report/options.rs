//! Which options make sense together, beyond the checks of the argument parser.

use super::Arguments;
use super::inputs::{Kinds, named};
use crate::error::{Error, Result};
#[cfg(feature = "render")]
use crate::report::picture_tables::MOST_LIGHTS;

/// Refuses options that would do nothing with these inputs, and inputs that would count twice.
pub(super) fn check(arguments: &Arguments) -> Result<()> {
    let inputs = named(arguments)?;
    let kinds = Kinds::of(arguments, &inputs);
    for (index, input) in inputs.iter().enumerate() {
        if inputs[..index].contains(input) {
            return Err(Error::usage("is named twice and would count twice; name it once").at(input.name()));
        }
    }
    if arguments.frame_rate.is_some() && !kinds.panoramas {
        let why = if kinds.configurations {
            "a configuration has its own, the key frame_rate_hz of [source]"
        } else {
            "none is named"
        };
        return Err(Error::usage(format!(
            "--frame-rate is the rate of numbered panoramas, and {why}; leave it out"
        )));
    }
    if arguments.frames.is_some() && !(kinds.panoramas || kinds.configurations || kinds.built_in) {
        return Err(Error::usage(
            "--frames limits recorded sequences, and none is named (those of --garden and --hall have 40 frames); leave it \
             out",
        ));
    }
    #[cfg(feature = "render")]
    pictures(arguments, kinds)?;
    Ok(())
}

#[cfg(feature = "render")]
fn pictures(arguments: &Arguments, kinds: Kinds) -> Result<()> {
    if !arguments.pictures {
        return Ok(());
    }
    if !kinds.maps && !kinds.built_in {
        return Err(Error::usage(
            "--pictures draws a scene under every map, and none is named; name one or leave it out",
        ));
    }
    if arguments.lights.iter().all(|&count| count > MOST_LIGHTS) {
        return Err(Error::usage(format!(
            "--pictures has at most {MOST_LIGHTS} lights, and --lights asks for more alone; add fewer or leave it out"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::report::tests::arguments;

    fn refused(words: &[&str]) -> Option<String> {
        check(&arguments(words)).err().map(|error| error.to_string())
    }

    #[test]
    fn options_that_would_do_nothing_are_refused() {
        for (words, expected) in [
            (&["a.hdr", "b.hdr", "a.hdr"][..], "a.hdr: is named twice"),
            (&["a.toml", "--config", "a.toml"], "a.toml: is named twice"),
            (&["a.hdr", "--frame-rate", "25"], "none is named"),
            (&["--frame-rate", "25"], "none is named"),
            (&["a.toml", "--frame-rate", "25"], "frame_rate_hz"),
            (&["a.hdr", "--frames", "20"], "--garden and --hall have 40 frames"),
            (
                &["--garden", "a.hdr", "--hall", "b.hdr", "--frames", "20"],
                "--garden and --hall have 40 frames",
            ),
            #[cfg(feature = "render")]
            (&["sky.#.exr", "--pictures"], "under every map"),
            #[cfg(feature = "render")]
            (&["--pictures", "--lights", "1024,513"], "at most 512 lights"),
        ] {
            let message = refused(words).unwrap_or_else(|| panic!("{words:?} is taken"));
            assert!(message.contains(expected), "{words:?}: {message}");
        }
        for words in [
            &[][..],
            &["--frames", "20"],
            &["sky.#.exr", "a.toml", "--frame-rate", "25", "--frames", "20"],
            &["a.toml", "--frames", "20"],
            &["a.hdr", "--garden", "a.hdr", "--hall", "a.hdr"],
            #[cfg(feature = "render")]
            &["--pictures", "--lights", "1024,512"],
            #[cfg(feature = "render")]
            &["a.hdr", "--pictures", "--tables"],
        ] {
            assert_eq!(refused(words), None, "{words:?}");
        }
    }
}
