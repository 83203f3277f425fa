use crate::error::{Error, Kind, Result};
use crate::rt::is_out_of_handles;
use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// How many names are tried for a part: more than one is taken only where programs with this number of ours
/// were killed in the middle of it.
const NAMES_MAX: u32 = 100;

/// Writes a file under a temporary, hidden name and renames it when it is complete, so that no reader sees a
/// partial file and a failed write leaves the old one. Nothing that has the temporary name already is opened:
/// in a folder of others it could be a link.
///
/// # Errors
/// Those of `write`, `NotNow` where no file handle is left, and `Failed` when the file cannot be written; all
/// name it.
pub fn replace_file(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    let failed = |error: io::Error| {
        let kind = if is_out_of_handles(&error) { Kind::NotNow } else { Kind::Failed };
        Error::failed("cannot be written").because(error).with_kind(kind)
    };
    let (part, file) = make_part(path).map_err(|error| failed(error).at(path))?;
    let run = || -> Result<()> {
        let mut writer = BufWriter::new(file);
        write(&mut writer)?;
        writer.flush().map_err(failed)?;
        drop(writer);
        fs::rename(&part, path).map_err(failed)
    };
    run().map_err(|error| {
        // Best effort: the error that matters is the one that is returned.
        let _ = fs::remove_file(&part);
        error.at(path)
    })
}

/// A new file beside `path`, and its name.
fn make_part(path: &Path) -> io::Result<(PathBuf, File)> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut number = 0;
    loop {
        let more = if number == 0 { String::new() } else { format!(".{number}") };
        let part = path.with_file_name(format!(".{name}.{}{more}.part", std::process::id()));
        match File::create_new(&part) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists && number < NAMES_MAX => number += 1,
            made => return made.map(|file| (part, file)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        fs::write(&path, b"old").unwrap();
        let error = replace_file(&path, |writer| {
            writer.write_all(b"half a fi").unwrap();
            Err(Error::failed("disk full"))
        })
        .unwrap_err();
        assert!(error.to_string().ends_with("a.exr: disk full"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_has_the_name_of_a_part_is_neither_opened_nor_in_the_way() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("secret"), "kept").unwrap();
        std::os::unix::fs::symlink(at("secret"), at(&format!(".a.exr.{}.part", std::process::id()))).unwrap();
        replace_file(&at("a.exr"), |writer| {
            writer.write_all(b"new").map_err(|error| Error::failed("cannot be written").because(error))
        })
        .unwrap();
        assert_eq!(
            (fs::read(at("a.exr")).unwrap(), fs::read(at("secret")).unwrap()),
            (b"new".into(), b"kept".into())
        );
        assert!(!at("a.exr").is_symlink());
    }
}
