use crate::error::{Error, Kind, Result};
use crate::rt::is_out_of_handles;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes a file under a temporary, hidden name and renames it when it is complete, so that no reader sees a
/// partial file and a failed write leaves the old one.
///
/// # Errors
/// Those of `write`, `NotNow` where no file handle is left, and `Failed` when the file cannot be written; all
/// name it.
pub fn replace_file(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let part = path.with_file_name(format!(".{name}.{}.part", std::process::id()));
    let failed = |error: std::io::Error| {
        let kind = if is_out_of_handles(&error) { Kind::NotNow } else { Kind::Failed };
        Error::failed("cannot be written").because(error).with_kind(kind)
    };
    let run = || -> Result<()> {
        let mut writer = BufWriter::new(File::create(&part).map_err(failed)?);
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
}
