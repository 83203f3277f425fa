use crate::error::{Error, Result, read_at_most};
use std::fmt;
use std::path::Path;
use std::time::Duration;
use subtle::ConstantTimeEq;

/// Most bytes of a file with a token.
const TOKEN_MAX_BYTES: usize = 1024;
/// Bytes of the file that are read: its first line, and notes.
const FILE_MAX_BYTES: u64 = 1 << 16;
/// Fewest bytes of a token; a shorter one can be guessed.
const TOKEN_LEAST_BYTES: usize = 16;

/// Who may connect to a server, and how many.
#[derive(Clone, Debug, PartialEq)]
pub struct ServerOptions {
    /// The token that clients must present; `None`: none.
    pub token: Option<Token>,
    /// Web pages that may connect besides the server's own: `https://studio.example`.
    pub origins: Vec<String>,
    /// Most clients at a time that lists are streamed to.
    pub clients_max: usize,
    /// A client that takes nothing and sends nothing for this long is disconnected; one that is silent for
    /// half of it is sent a ping.
    pub patience: Duration,
}

impl Default for ServerOptions {
    fn default() -> Self {
        Self { token: None, origins: Vec::new(), clients_max: 256, patience: Duration::from_secs(30) }
    }
}

/// A secret that clients present. It is compared in constant time and never printed.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// Reads the first line of a file.
    ///
    /// # Errors
    /// Kind `Usage`, naming the file: it cannot be read; the line has less than 16 or more than 1024
    /// characters, or characters other than letters, digits and `-._~`, which are valid in every place that
    /// carries a token.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = read_at_most(path, FILE_MAX_BYTES).map_err(|error| {
            Error::usage("the file with the token cannot be read").because(error).at(path)
        })?;
        let line = bytes.split(|&byte| byte == b'\n').next().unwrap_or_default();
        Self::new(String::from_utf8_lossy(line).trim()).map_err(|error| error.at(path))
    }

    fn new(text: &str) -> Result<Self> {
        if !(TOKEN_LEAST_BYTES..=TOKEN_MAX_BYTES).contains(&text.len()) {
            return Err(Error::usage(format!(
                "a token has {TOKEN_LEAST_BYTES} to {TOKEN_MAX_BYTES} characters, this one has {}",
                text.len()
            )));
        }
        if !text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte)) {
            return Err(Error::usage("a token consists of letters, digits and -._~"));
        }
        Ok(Self(text.to_owned()))
    }

    /// Whether this is the token. The time that the comparison takes reveals the length of the token and
    /// nothing else.
    pub fn is(&self, shown: &[u8]) -> bool {
        self.0.as_bytes().ct_eq(shown).into()
    }

    /// The text of the token, for a client that has to present it.
    pub(super) fn reveal(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("Token(...)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_the_first_line_and_stays_unsaid() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        std::fs::write(&path, "0123456789abcdef-._~\nnotes\n").unwrap();
        let token = Token::load(&path).unwrap();
        assert!(token.is(b"0123456789abcdef-._~"));
        for shown in ["", "0123456789abcdef-._", "0123456789abcdef-._!", "0123456789abcdef-._~\n"] {
            assert!(!token.is(shown.as_bytes()), "{shown:?}");
        }
        assert_eq!(format!("{token:?}"), "Token(...)");
    }

    #[test]
    fn tokens_that_cannot_be_carried_or_can_be_guessed_are_refused_without_being_said() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        for (text, expected) in [
            ("short", "has 16 to 1024 characters, this one has 5"),
            ("0123456789abcdef 0", "letters, digits"),
            ("", "this one has 0"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = Token::load(&path).unwrap_err().to_string();
            assert!(error.contains(expected) && error.contains("/token: "), "{error}");
            assert!(text.is_empty() || !error.contains(text), "{error}");
        }
        let zeros = Token::load(Path::new("/dev/zero")).unwrap_err().to_string();
        assert!(zeros.contains("this one has 65537"), "{zeros}");
        assert!(Token::load(&folder.path().join("none")).unwrap_err().to_string().contains("none"));
    }
}
