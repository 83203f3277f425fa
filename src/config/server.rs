//! The keys of `[server]`.

use super::Config;
use crate::error::{Error, Place, Result};
use crate::net::{ServerOptions, Token};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Most clients that can be configured: the number of file handles is limited by the machine.
const CLIENTS_MAX: usize = 100_000;

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ServerKeys {
    token_file: Option<PathBuf>,
    origins: Option<Vec<String>>,
    clients_max: Option<usize>,
    patience_s: Option<f64>,
}

/// Who may connect to a server, and how many; the token itself is read when a server starts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServerConfig {
    /// The file whose first line is the token; `None`: clients need none.
    pub token_file: Option<PathBuf>,
    /// All other options.
    pub options: ServerOptions,
}

impl ServerKeys {
    /// The options; paths are relative to `folder`.
    pub(super) fn check(self, folder: &Path) -> Result<ServerConfig> {
        let default = ServerOptions::default();
        let clients_max = self.clients_max.unwrap_or(default.clients_max);
        if !(1..=CLIENTS_MAX).contains(&clients_max) {
            return Err(
                Error::usage(format!("give 1 to {CLIENTS_MAX}")).at(Place::value("clients_max", clients_max))
            );
        }
        let patience_s = self.patience_s.unwrap_or(default.patience.as_secs_f64());
        if !(0.1..=3600.0).contains(&patience_s) {
            return Err(Error::usage("give 0.1 to 3600 seconds").at(Place::value("patience_s", patience_s)));
        }
        let origins = self.origins.unwrap_or_default();
        for origin in &origins {
            let host = origin.strip_prefix("https://").or_else(|| origin.strip_prefix("http://"));
            if host.is_none_or(|host| host.is_empty() || host.contains(['/', '*', ' '])) {
                return Err(Error::usage(format!(
                    "\"{origin}\" is no origin, such as \"https://studio.example\" (no path, no pattern)"
                ))
                .at(Place::key("origins")));
            }
        }
        Ok(ServerConfig {
            token_file: self.token_file.map(|file| folder.join(file)),
            options: ServerOptions {
                token: None,
                origins,
                clients_max,
                patience: Duration::from_secs_f64(patience_s),
            },
        })
    }
}

impl Config {
    /// The options that a server starts with.
    ///
    /// # Errors
    /// Those of [`Token::load`].
    pub fn server_options(&self) -> Result<ServerOptions> {
        let token = self.server.token_file.as_deref().map(Token::load).transpose();
        Ok(ServerOptions {
            token: token.map_err(|error| self.locate("server", error.at(Place::key("token_file"))))?,
            ..self.server.options.clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(keys: &str) -> Result<ServerConfig> {
        toml::from_str::<ServerKeys>(keys).unwrap().check(Path::new("conf"))
    }

    #[test]
    fn nothing_said_is_the_default_and_paths_are_relative() {
        assert_eq!(check("").unwrap(), ServerConfig::default());
        let config = check(
            "token_file = \"token\"\norigins = [\"https://a.example\"]\nclients_max = 3\npatience_s = 0.5",
        )
        .unwrap();
        assert_eq!(config.token_file.as_deref(), Some(Path::new("conf/token")));
        let expected = ServerOptions {
            token: None,
            origins: vec!["https://a.example".into()],
            clients_max: 3,
            patience: Duration::from_millis(500),
        };
        assert_eq!(config.options, expected);
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_key() {
        for (keys, expected) in [
            ("clients_max = 0", "clients_max = 0: give 1 to 100000"),
            ("patience_s = 0", "patience_s = 0: give 0.1"),
            ("patience_s = nan", "patience_s = NaN: give 0.1"),
            ("origins = [\"*\"]", "\"*\" is no origin"),
            ("origins = [\"https://a/b\"]", "\"https://a/b\" is no origin"),
            ("origins = [\"https://\"]", "is no origin"),
        ] {
            let error = check(keys).unwrap_err().to_string();
            assert!(error.contains(expected), "{keys}: {error}");
        }
    }
}
