//! The inputs of a report: panoramas, sequences, and built-in ones where none are named. All of them are
//! opened, and panoramas read, before anything is measured.

use super::Arguments;
use super::sequences::Recorded;
use crate::cli::input::{Input, display_name, is_standard_input};
use crate::cli::panorama::{Panorama, PanoramaArguments, read_panorama};
use crate::compare::still_methods;
use crate::error::{Error, Result};
use crate::report::built_in::{self, BuiltIn};
#[cfg(feature = "render")]
use crate::report::picture_tables;
use crate::report::sequence::Sequence;
use crate::rt::Shutdown;
use lightcast_core::image::{PolarMap, PolarShape};
use std::path::{Path, PathBuf};

/// The shapes that every panorama is averaged to: for lights, and for pictures.
const SHAPES: &[PolarShape] = &[
    still_methods::SHAPE,
    #[cfg(feature = "render")]
    picture_tables::SHAPE,
];

/// A map.
pub(super) struct Map {
    pub name: String,
    /// Its name on a command line; built-in maps have none.
    pub path: Option<PathBuf>,
    /// One for each of [`SHAPES`].
    maps: Vec<PolarMap>,
}

/// A sequence that is open.
pub(super) enum Moving {
    Recorded(Recorded),
    Made(Made),
    BuiltIn(BuiltIn),
}

/// A sequence that METHODS section 7 makes of a panorama.
pub(super) struct Made {
    pub name: &'static str,
    pub path: PathBuf,
    map: PolarMap,
    make: Make,
}

type Make = fn(&PolarMap, &dyn Fn() -> bool) -> Result<Option<Sequence>>;

/// All inputs that a command line names.
pub(super) struct Inputs {
    pub maps: Vec<Map>,
    pub sequences: Vec<Moving>,
}

/// The kinds of inputs that a command line names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Kinds {
    pub maps: bool,
    pub configurations: bool,
    /// Numbered panoramas.
    pub panoramas: bool,
    /// None is named, so the built-in ones are used.
    pub built_in: bool,
}

/// The inputs that a command line names, one by one.
///
/// # Errors
/// Kind `Usage` for inputs that have no map.
pub(super) fn named(arguments: &Arguments) -> Result<Vec<Input>> {
    let configurations = arguments.config.iter().map(|path| Ok(Input::Configuration(path.clone())));
    let inputs: Vec<Input> =
        arguments.inputs.iter().map(|path| Input::of(path)).chain(configurations).collect::<Result<_>>()?;
    for input in &inputs {
        let why = match input {
            Input::Panorama(_) | Input::Panoramas(_) | Input::Configuration(_) => continue,
            Input::Lists(_) => {
                "they have no map to measure lights against; name the panorama or the configuration that they were made of"
            }
            Input::Server(_) => {
                "its lights come without a map to measure them against; name the configuration that the server runs, or a \
                 recording (`lightcast run --record`)"
            }
        };
        return Err(input.refused("report", why));
    }
    Ok(inputs)
}

impl Kinds {
    pub fn of(arguments: &Arguments, inputs: &[Input]) -> Self {
        let any = |is_kind: fn(&Input) -> bool| inputs.iter().any(is_kind);
        Self {
            maps: any(|input| matches!(input, Input::Panorama(_))),
            configurations: any(|input| matches!(input, Input::Configuration(_))),
            panoramas: any(|input| matches!(input, Input::Panoramas(_))),
            built_in: inputs.is_empty() && arguments.garden.is_none(),
        }
    }
}

impl Inputs {
    /// Opens everything; `telling` is called with the name of what is read next. `None` when `shutdown` is
    /// requested.
    pub fn open(arguments: &Arguments, shutdown: &Shutdown, telling: impl Fn(&str)) -> Result<Option<Self>> {
        let mut inputs = Self { maps: Vec::new(), sequences: Vec::new() };
        let named = named(arguments)?;
        if Kinds::of(arguments, &named).built_in {
            for built_in in built_in::SEQUENCES {
                check_length(built_in.length()?, arguments).map_err(|error| error.at(built_in.name))?;
            }
            for built_in in built_in::MAPS {
                telling(built_in.name);
                inputs.maps.push(Map::built_in(&built_in)?);
                if shutdown.is_requested() {
                    return Ok(None);
                }
            }
            inputs.sequences.extend(built_in::SEQUENCES.map(Moving::BuiltIn));
            return Ok(Some(inputs));
        }
        // Sequences first: opening one reads one picture, not all.
        for input in &named {
            let recorded = match input {
                Input::Configuration(path) => Recorded::configured(path)?,
                Input::Panoramas(path) => Recorded::panoramas(path, arguments.frame_rate)?,
                _ => continue,
            };
            check_length(recorded.length(), arguments).map_err(|error| error.at(input.name()))?;
            inputs.sequences.push(Moving::Recorded(recorded));
            if shutdown.is_requested() {
                return Ok(None);
            }
        }
        for input in &named {
            let Input::Panorama(path) = input else { continue };
            telling(&input.name());
            inputs.maps.push(Map::read(path, arguments.panorama)?);
            if shutdown.is_requested() {
                return Ok(None);
            }
        }
        for (name, path, make) in [
            ("garden", &arguments.garden, Sequence::garden as Make),
            ("hall", &arguments.hall, Sequence::hall),
        ] {
            let Some(path) = path else { continue };
            telling(&path.display().to_string());
            let known = inputs.maps.iter().find(|map| map.path.as_ref() == Some(path));
            let map = match known {
                Some(known) => known.for_lights().clone(),
                None => read_panorama(path, arguments.panorama, still_methods::SHAPE)?,
            };
            inputs.sequences.push(Moving::Made(Made { name, path: path.clone(), map, make }));
            if shutdown.is_requested() {
                return Ok(None);
            }
        }
        Ok(Some(inputs))
    }
}

/// Refuses a sequence that is too short now, and not only after everything before it has been measured.
fn check_length((frames, frame_rate_hz): (usize, f64), arguments: &Arguments) -> Result<()> {
    let (least, limit) = (Sequence::least_frames(frame_rate_hz)?, arguments.frame_limit());
    if frames < least {
        return Err(Error::usage(format!(
            "has {frames} frames at {frame_rate_hz} frames per second; at least {least} are needed"
        )));
    }
    if limit < least {
        return Err(Error::usage(format!(
            "--frames {limit} are too few at {frame_rate_hz} frames per second; give at least {least}"
        )));
    }
    Ok(())
}

impl Map {
    fn read(path: &Path, how: PanoramaArguments) -> Result<Self> {
        let name = match path.file_name() {
            Some(name) if !is_standard_input(path) => name.to_string_lossy().into_owned(),
            _ => display_name(path),
        };
        Ok(Self { name, path: Some(path.to_owned()), maps: Panorama::read(path, how)?.maps(SHAPES)? })
    }

    fn built_in(built_in: &BuiltIn) -> Result<Self> {
        let map = |&shape: &PolarShape| Ok(built_in.maps(shape, 1, || true)?.swap_remove(0));
        let maps = SHAPES.iter().map(map).collect::<Result<_>>()?;
        Ok(Self { name: built_in.name.to_owned(), path: None, maps })
    }

    pub fn for_lights(&self) -> &PolarMap {
        &self.maps[0]
    }

    #[cfg(feature = "render")]
    pub fn for_pictures(&self) -> &PolarMap {
        &self.maps[1]
    }
}

impl Moving {
    pub fn name(&self) -> String {
        match self {
            Self::Recorded(recorded) => recorded.path().display().to_string(),
            Self::Made(Made { name, path, .. }) => {
                let map = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy();
                format!("{name} (of {map})")
            }
            Self::BuiltIn(built_in) => built_in.name.to_owned(),
        }
    }

    /// Reads as many frames as `arguments` say and works out their truth; `None` when `shutdown` is requested
    /// meanwhile.
    pub fn read(&mut self, arguments: &Arguments, shutdown: &Shutdown) -> Result<Option<Sequence>> {
        let (limit, goes_on) = (arguments.frame_limit(), || !shutdown.is_requested());
        let maps = match self {
            Self::Made(Made { map, make, .. }) => return make(map, &goes_on),
            Self::Recorded(recorded) => recorded.read(limit, shutdown)?,
            Self::BuiltIn(built_in) => built_in.maps(still_methods::SHAPE, limit, goes_on)?,
        };
        if shutdown.is_requested() {
            return Ok(None);
        }
        Sequence::from_maps(maps, &goes_on).map_err(|error| error.at(self.name()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_asks_for_an_end_while_inputs_are_read_gets_it() {
        let arguments = crate::cli::report::tests::arguments(&[]);
        let (shutdown, read) = (Shutdown::new(), std::cell::Cell::new(0));
        let inputs = Inputs::open(&arguments, &shutdown, |_| {
            read.set(read.get() + 1);
            shutdown.request();
        });
        assert!(inputs.unwrap().is_none() && read.get() == 1);
        let map = PolarMap::from_fn(still_methods::SHAPE, |row, _| [row as f32; 3]);
        let made = Made { name: "hall", path: PathBuf::from("hall.hdr"), map, make: Sequence::hall };
        for mut moving in [Moving::Made(made), Moving::BuiltIn(built_in::SEQUENCES[0])] {
            assert!(moving.read(&arguments, &shutdown).unwrap().is_none(), "{}", moving.name());
        }
    }

    #[test]
    fn inputs_without_a_map_are_refused_and_a_configuration_may_have_any_name() {
        let arguments = |words: &[&str]| crate::cli::report::tests::arguments(words);
        for (word, expected) in [("a.jsonl", "have no map"), ("studio:7300", "come without a map")] {
            let error = named(&arguments(&["a.hdr", word])).unwrap_err().to_string();
            assert!(error.starts_with(word) && error.contains(expected), "{error}");
        }
        let inputs = named(&arguments(&["a.hdr", "--config", "my.conf", "b.toml"])).unwrap();
        let configuration = |name: &str| Input::Configuration(name.into());
        assert_eq!(
            inputs,
            [Input::Panorama("a.hdr".into()), configuration("b.toml"), configuration("my.conf")]
        );
    }
}
