//! What a report is about: panoramas, sequences, and what is built in where none are named.

use super::Arguments;
use super::sequences;
use crate::cli::panorama::read_panorama;
use crate::error::Result;
use crate::image::{PolarMap, PolarShape};
use crate::report::built_in::{self, BuiltIn};
use crate::report::sequence::Sequence;
use crate::report::stills::SHAPE;
use crate::rt::Shutdown;
use std::path::{Path, PathBuf};

/// A map to be read.
pub(super) enum Map {
    File(PathBuf),
    BuiltIn(BuiltIn),
}

/// A sequence to be read.
pub(super) enum Moving {
    /// A folder, a pattern or a configuration.
    Recorded(PathBuf),
    /// One that METHODS section 7 makes of a panorama.
    Made {
        name: &'static str,
        map: PathBuf,
        make: fn(&PolarMap) -> Result<Sequence>,
    },
    BuiltIn(BuiltIn),
}

/// All that a command line names.
pub(super) struct Inputs {
    pub maps: Vec<Map>,
    pub sequences: Vec<Moving>,
}

impl Inputs {
    pub fn of(arguments: &Arguments) -> Self {
        let (sequences, maps): (Vec<&PathBuf>, Vec<&PathBuf>) =
            arguments.inputs.iter().partition(|path| is_sequence(path));
        let maps: Vec<Map> = maps.into_iter().cloned().map(Map::File).collect();
        let mut sequences: Vec<Moving> = sequences.into_iter().cloned().map(Moving::Recorded).collect();
        if let Some((garden, hall)) = arguments.garden.clone().zip(arguments.hall.clone()) {
            sequences.push(Moving::Made { name: "garden", map: garden, make: Sequence::garden });
            sequences.push(Moving::Made { name: "hall", map: hall, make: Sequence::hall });
        }
        if maps.is_empty() && sequences.is_empty() {
            return Self {
                maps: built_in::MAPS.map(Map::BuiltIn).into(),
                sequences: built_in::SEQUENCES.map(Moving::BuiltIn).into(),
            };
        }
        Self { maps, sequences }
    }
}

/// A folder, a pattern (`name.####.exr`, `name.%04d.exr`) or a configuration.
fn is_sequence(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.is_dir()
        || path.extension().is_some_and(|extension| extension == "toml")
        || (!path.is_file() && (name.contains('#') || name.contains('%')))
}

impl Map {
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
            Self::BuiltIn(built_in) => built_in.name.to_owned(),
        }
    }

    /// What names it on a command line; nothing names what is built in.
    pub fn words(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::BuiltIn(_) => None,
        }
    }

    pub fn read(&self, shape: PolarShape) -> Result<PolarMap> {
        match self {
            Self::File(path) => read_panorama(path, shape),
            Self::BuiltIn(built_in) => Ok(built_in.maps(shape, 1)?.swap_remove(0)),
        }
    }
}

impl Moving {
    pub fn name(&self) -> String {
        match self {
            Self::Recorded(path) => path.display().to_string(),
            Self::Made { name, map, .. } => {
                let map = map.file_stem().unwrap_or(map.as_os_str()).to_string_lossy();
                format!("{name} (of {map})")
            }
            Self::BuiltIn(built_in) => built_in.name.to_owned(),
        }
    }

    /// Reads at most `limit` frames and works out their truth; `None` when `shutdown` is requested meanwhile.
    pub fn read(&self, arguments: &Arguments, shutdown: &Shutdown) -> Result<Option<Sequence>> {
        let limit = arguments.frames as usize;
        let maps = match self {
            Self::Made { map, make, .. } => return make(&read_panorama(map, SHAPE)?).map(Some),
            Self::Recorded(path) => sequences::read(path, arguments.frame_rate, limit, shutdown)?,
            Self::BuiltIn(built_in) => built_in.maps(SHAPE, limit)?,
        };
        match Sequence::from_maps(maps, || !shutdown.is_requested()) {
            Err(_) if shutdown.is_requested() => Ok(None),
            Err(error) => Err(error.at(self.name())),
            Ok(sequence) => Ok(Some(sequence)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_patterns_and_configurations_are_sequences() {
        let folder = tempfile::tempdir().unwrap();
        let odd = folder.path().join("map#1.hdr");
        std::fs::write(&odd, "").unwrap();
        assert!(is_sequence(folder.path()));
        for name in ["config/replay.toml", "frames/sky.####.exr", "sky.%04d.exr"] {
            assert!(is_sequence(Path::new(name)), "{name}");
        }
        for name in ["sky.0001.exr", "garden.hdr", "", "folder#1/garden.hdr"] {
            assert!(!is_sequence(Path::new(name)), "{name}");
        }
        assert!(!is_sequence(&odd), "a file of this very name");
    }
}
