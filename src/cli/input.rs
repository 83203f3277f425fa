//! The inputs of a command, distinguished by their names, and on standard input by the first bytes.

use super::standard_input::StandardInput;
use crate::error::{Error, Result, without_mark};
use crate::rt::Shutdown;
use crate::wire::ListFile;
use std::ffi::OsStr;
use std::io::{self, BufRead};
use std::path::{Path, PathBuf};

/// The name of standard input.
const STANDARD_INPUT: &str = "-";

/// Light in any form that a command accepts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Input {
    /// A lat-long panorama: a picture file, or `-`.
    Panorama(PathBuf),
    /// Numbered panoramas: a folder or a pattern (`name.####.exr`, `name.%04d.exr`).
    Panoramas(PathBuf),
    /// Light lists, one JSON object a line: a file, or `-`.
    Lists(PathBuf),
    /// A configuration, of a sequence or a camera.
    Configuration(PathBuf),
    /// The address of a server.
    Server(String),
}

// The input of a command that takes light in every form. (Clap shows a `///` here as the text of the
// command.)
#[cfg(feature = "render")]
#[derive(Debug, clap::Args)]
pub(super) struct InputArguments {
    /// A panorama, light lists, a configuration, a server, or `-` for standard input.
    #[arg(value_name = "INPUT", required_unless_present = "config")]
    input: Option<PathBuf>,

    /// A configuration (TOML) as INPUT, whatever it is called.
    #[arg(long, value_name = "FILE", conflicts_with = "input")]
    config: Option<PathBuf>,
}

// The input of a command that takes a configuration and nothing else.
#[derive(Debug, clap::Args)]
pub(super) struct ConfigurationArguments {
    /// Configuration (TOML); config/replay.toml and config/camera.toml explain every key.
    #[arg(value_name = "CONFIG", required_unless_present = "config")]
    positional: Option<PathBuf>,

    /// The same, whatever the file is called.
    #[arg(long, short, value_name = "FILE", conflicts_with = "positional")]
    config: Option<PathBuf>,
}

impl Input {
    /// The input that `path` names. Panoramas have many different names, the others few; a name with a colon
    /// and a port is a server's, unless there is such a file.
    ///
    /// # Errors
    /// Standard input that cannot be read, or is neither light lists nor a panorama.
    pub fn of(path: &Path) -> Result<Self> {
        if is_standard_input(path) {
            let mut input = io::stdin().lock();
            let unreadable = |error| Error::failed("cannot be read").because(error).at("standard input");
            return Self::of_first_bytes(input.fill_buf().map_err(unreadable)?);
        }
        Ok(Self::of_name(path))
    }

    fn of_name(path: &Path) -> Self {
        let path_buf = path.to_owned();
        let name = path.file_name().and_then(OsStr::to_str).unwrap_or_default();
        if path.is_dir() || (is_pattern(name) && !path.is_file()) {
            return Self::Panoramas(path_buf);
        }
        if let Some(address) = path.to_str().filter(|text| is_address(text) && !path.exists()) {
            return Self::Server(address.to_owned());
        }
        let extension = path.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default();
        match extension.to_str() {
            Some("toml") => Self::Configuration(path_buf),
            Some("jsonl" | "json") => Self::Lists(path_buf),
            _ => Self::Panorama(path_buf),
        }
    }

    /// Lists begin with a brace, pictures with a magic number.
    fn of_first_bytes(bytes: &[u8]) -> Result<Self> {
        let path = PathBuf::from(STANDARD_INPUT);
        match without_mark(bytes).trim_ascii_start() {
            [] | [b'{', ..] => Ok(Self::Lists(path)),
            [0x76, 0x2f, 0x31, 0x01, ..] | [b'#', b'?', ..] => Ok(Self::Panorama(path)),
            // Refused with a sentence of its own: these have codes, not radiance.
            [0x89, b'P', b'N', b'G', ..] | [0xff, 0xd8, 0xff, ..] => Ok(Self::Panorama(path)),
            other => Err(Error::usage(format!(
                "is neither light lists (JSON lines) nor a panorama (OpenEXR, Radiance HDR): it begins with the bytes \
                 {:02x?}; a configuration has paths relative to its file, so name the file",
                &other[..other.len().min(8)]
            ))
            .at("standard input")),
        }
    }

    /// Its name in messages.
    pub fn name(&self) -> String {
        match self {
            Self::Panorama(path) | Self::Panoramas(path) | Self::Lists(path) | Self::Configuration(path) => {
                display_name(path)
            }
            Self::Server(address) => address.clone(),
        }
    }

    /// The error that `command` does not take it; `why` gives the reason, and what to do.
    pub fn refused(&self, command: &str, why: &str) -> Error {
        let kind = match self {
            Self::Panorama(_) => "a panorama",
            Self::Panoramas(_) => "a folder or pattern of numbered panoramas",
            Self::Lists(_) => "light lists",
            Self::Configuration(_) => "a configuration",
            Self::Server(_) => "the address of a server",
        };
        Error::usage(format!("is {kind}, which `lightcast {command}` does not take: {why}")).at(self.name())
    }

    /// The panorama, for a `command` that takes no other input.
    ///
    /// # Errors
    /// Kind `Usage` for every other input, with what takes it.
    pub fn panorama(path: &Path, command: &str) -> Result<PathBuf> {
        let input = Self::of(path)?;
        let why = match &input {
            Self::Panorama(path) => return Ok(path.clone()),
            Self::Panoramas(_) => {
                "name one of the panoramas; `lightcast run` makes the lights of a sequence, from a \
                                   configuration with its path"
            }
            Self::Lists(_) => {
                "its lights are made already; name the panorama that they were made of, or see them with \
                               `lightcast render`"
            }
            Self::Configuration(_) => {
                "name a panorama; `lightcast run` makes the lights of what a configuration names"
            }
            Self::Server(_) => "name a panorama; `lightcast watch` prints the lights that a server streams",
        };
        Err(input.refused(command, why))
    }
}

#[cfg(feature = "render")]
impl InputArguments {
    /// # Errors
    /// Those of [`Input::of`].
    pub fn input(&self) -> Result<Input> {
        match (&self.config, &self.input) {
            (Some(path), _) => Ok(Input::Configuration(path.clone())),
            (None, path) => Input::of(path.as_deref().unwrap_or(Path::new(""))),
        }
    }
}

impl ConfigurationArguments {
    /// The file.
    pub fn path(&self) -> &Path {
        self.config.as_deref().or(self.positional.as_deref()).unwrap_or(Path::new(""))
    }

    /// Refuses an input that is not a configuration by its name; `command` is the command that it was given
    /// to.
    ///
    /// # Errors
    /// Kind `Usage`, with what takes such an input.
    pub fn check(&self, command: &str) -> Result<()> {
        let Some(path) = &self.positional else { return Ok(()) };
        let input = Input::of(path)?;
        let why = match &input {
            Input::Configuration(_) => return Ok(()),
            Input::Panorama(_) => {
                "`lightcast lights` makes the lights of one panorama; name a configuration (.toml), with \
                                   --config where it has another name"
            }
            Input::Panoramas(_) => {
                "name a configuration whose section [source] has it as its path; config/replay.toml \
                                    explains every key"
            }
            Input::Lists(_) => {
                "its lights are made already; `lightcast watch` prints them and `lightcast render` shows them"
            }
            Input::Server(_) => {
                "its lights are made there; `lightcast watch` prints them and `lightcast render` shows them"
            }
        };
        Err(input.refused(command, why))
    }
}

/// Whether `path` stands for standard input.
pub(super) fn is_standard_input(path: &Path) -> bool {
    path.as_os_str() == STANDARD_INPUT
}

/// The name of a file, or of standard input, in messages.
pub(super) fn display_name(path: &Path) -> String {
    if is_standard_input(path) { "standard input".to_owned() } else { path.display().to_string() }
}

/// Opens a file of light lists, or those on standard input, which end when `end` is requested.
///
/// # Errors
/// When the file cannot be opened.
pub(super) fn open_lists(path: &Path, end: &Shutdown) -> Result<ListFile> {
    if is_standard_input(path) {
        return Ok(ListFile::new("standard input", StandardInput::new(end)));
    }
    ListFile::open(path)
}

fn is_pattern(name: &str) -> bool {
    name.contains('#') || name.contains('%')
}

/// `ws://HOST:PORT`, another scheme (which the client refuses with what to write), or HOST:PORT, with or
/// without a path.
fn is_address(text: &str) -> bool {
    let authority = text.split('/').next().unwrap_or_default();
    let is_host_and_port = authority
        .rsplit_once(':')
        .is_some_and(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok());
    text.contains("://") || is_host_and_port
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::net::ClientOptions;

    fn of(name: &str) -> Input {
        Input::of_name(Path::new(name))
    }

    #[test]
    fn inputs_are_told_by_their_names() {
        for name in ["a/b.toml", "B.TOML"] {
            assert_eq!(of(name), Input::Configuration(name.into()));
        }
        for name in ["b.jsonl", "b.json"] {
            assert_eq!(of(name), Input::Lists(name.into()));
        }
        for name in ["b.hdr", "sky.0001.exr", "b", "", "folder#1/garden.hdr", "a:b.hdr"] {
            assert_eq!(of(name), Input::Panorama(name.into()));
        }
        for name in ["ws://a:1/b.json", "http://a:1/", "wss://a", "studio:7300", "[::1]:7300", "a:1/ws"] {
            assert_eq!(of(name), Input::Server(name.into()));
        }
        for name in ["frames/sky.####.exr", "sky.%04d.exr"] {
            assert_eq!(of(name), Input::Panoramas(name.into()));
        }
    }

    #[test]
    fn addresses_are_those_that_the_clients_take() {
        let addresses: serde_json::Value =
            serde_json::from_str(include_str!("../../tests/clients/addresses.json")).unwrap();
        for pair in addresses["everyone takes"].as_array().unwrap() {
            let url = pair[0].as_str().unwrap();
            assert_eq!(of(url), Input::Server(url.to_owned()));
        }
        for url in addresses["nobody takes"].as_array().unwrap() {
            let url = url.as_str().unwrap();
            assert!(!matches!(of(url), Input::Server(_)) || ClientOptions::new(url).is_err(), "{url}");
        }
    }

    #[test]
    fn what_there_is_goes_before_what_a_name_could_mean() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["map#1.hdr", "host:80"] {
            std::fs::write(at(name), "").unwrap();
            assert_eq!(Input::of(&at(name)).unwrap(), Input::Panorama(at(name)));
        }
        std::fs::create_dir(at("frames.toml")).unwrap();
        assert_eq!(Input::of(&at("frames.toml")).unwrap(), Input::Panoramas(at("frames.toml")));
    }

    #[test]
    fn standard_input_is_told_by_its_first_bytes() {
        let of = Input::of_first_bytes;
        for bytes in [&b"{\"version\":1"[..], b"\n {", b""] {
            assert_eq!(of(bytes).unwrap(), Input::Lists("-".into()));
        }
        for bytes in [&b"\x76\x2f\x31\x01\x02"[..], b"#?RADIANCE", b"\x89PNG"] {
            assert_eq!(of(bytes).unwrap(), Input::Panorama("-".into()));
        }
        for bytes in [&b"# a configuration"[..], b"[source]"] {
            let error = of(bytes).unwrap_err().to_string();
            assert!(
                error.starts_with("standard input: is neither") && error.contains("name the file"),
                "{error}"
            );
        }
    }

    #[test]
    fn a_refusal_has_the_input_the_command_and_what_to_do() {
        let error = Input::panorama(Path::new("a.jsonl"), "lights").unwrap_err().to_string();
        assert!(
            error.starts_with("a.jsonl: is light lists, which `lightcast lights` does not take: "),
            "{error}"
        );
        let named = |input: &str| ConfigurationArguments { positional: Some(input.into()), config: None };
        let refused = named("garden.hdr").check("run").unwrap_err().to_string();
        assert!(refused.contains("lightcast lights") && refused.contains("--config"), "{refused}");
        assert!(named("a.toml").check("run").is_ok());
        let other = ConfigurationArguments { positional: None, config: Some("a.conf".into()) };
        assert!(other.check("run").is_ok() && other.path() == Path::new("a.conf"));
    }
}
