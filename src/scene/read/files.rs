//! The files of a scene: what they may refer to, how much of them is read, and how a reader's panic is
//! handled.

use crate::error::{Error, Result};
use crate::rt;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

/// Most bytes of all files of a scene together.
pub const MAX_BYTES: u64 = 1 << 30;

/// The folder of a scene, from which files are read by the names that other files give.
pub(super) struct Files {
    folder: PathBuf,
    bytes_left: u64,
}

impl Files {
    /// The folder that the scene's own file lies in.
    pub(super) fn beside(path: &Path) -> Self {
        Self { folder: path.parent().map(Path::to_path_buf).unwrap_or_default(), bytes_left: MAX_BYTES }
    }

    /// Reads the file `name`, a path relative to the scene's folder with `/` between its parts. Parts that
    /// lead out of the folder are refused, and so are URLs.
    pub(super) fn read(&mut self, name: &str) -> Result<Vec<u8>> {
        let relative = Path::new(name);
        let is_inside =
            relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        let outcome = if name.contains("://") {
            Err(Error::usage("is a URL; fetch the file and refer to it by its name"))
        } else if name.is_empty() || name.contains('\0') {
            Err(Error::usage("is no name of a file"))
        } else if !is_inside {
            Err(Error::usage("leads out of the scene's folder; put the file there"))
        } else {
            self.read_path(&self.folder.join(relative))
        };
        outcome.map_err(|error| error.at(format_args!("`{}`", short(name))))
    }

    pub(super) fn read_path(&mut self, path: &Path) -> Result<Vec<u8>> {
        let failed = |error: std::io::Error| Error::usage("cannot be read").because(error);
        // This is checked before the file is opened, because opening a pipe waits for its writer.
        let about = std::fs::metadata(path).map_err(failed)?;
        if !about.is_file() {
            return Err(Error::usage("cannot be read: it is not a file"));
        }
        let mut bytes = Vec::new();
        let file = File::open(path).map_err(failed)?;
        // The limit also applies to a file that grows meanwhile.
        let read = file.take(self.bytes_left + 1).read_to_end(&mut bytes).map_err(failed)?;
        self.bytes_left = self.bytes_left.checked_sub(read as u64).ok_or_else(|| {
            Error::usage(format!("is too large: a scene's files have at most {MAX_BYTES} bytes together"))
        })?;
        Ok(bytes)
    }
}

/// Runs a reader; its panic becomes an error. `gltf` 1.4, `tobj` 4.0 and the decoders of `image` 0.25 index
/// and unwrap values from damaged files. None of their state outlives the call.
pub(super) fn contained<T>(read: impl FnOnce() -> Result<T>) -> Result<T> {
    rt::contained(read)
        .unwrap_or_else(|cause| Err(Error::usage(format!("is damaged: its reader gave up with `{cause}`"))))
}

/// The beginning of a text from a file, for messages.
pub(in crate::scene) fn short(text: &str) -> String {
    let mut beginning: String = text.chars().take(80).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().nth(80).is_some() {
        beginning.push_str("...");
    }
    beginning
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("scene");
        std::fs::create_dir_all(inside.join("a")).unwrap();
        std::fs::write(folder.path().join("secret"), b"x").unwrap();
        std::fs::write(inside.join("a/b.bin"), b"1234567").unwrap();
        let mut files = Files { folder: inside.clone(), bytes_left: 10 };
        let mut failure = |name: &str| files.read(name).unwrap_err().to_string();
        let absolute = folder.path().join("secret");
        for name in ["../secret", "a/../../secret", absolute.to_str().unwrap(), ".."] {
            assert!(failure(name).contains("leads out"), "{name}");
        }
        assert!(failure("https://example.com/a.bin").contains("is a URL"));
        assert!(failure("a").contains("not a file"));
        assert!(failure("").contains("no name"));
        assert!(failure("missing.bin").starts_with("`missing.bin`: cannot be read: "));
        assert_eq!(files.read("./a/b.bin").unwrap(), b"1234567");
        assert!(files.read("a/b.bin").unwrap_err().to_string().contains("too large"));
    }
}
