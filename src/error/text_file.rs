use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;
use std::fs::OpenOptions;
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::{Duration, Instant};

/// A text without the byte order mark that programs on Windows put before it.
pub fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text)
}

/// How long the writer of a pipe is waited for.
const PIPE_WITHIN: Duration = Duration::from_secs(5);

/// Reads a file that people write, `most` + 1 bytes of it at most, so that a caller who gets more than `most`
/// knows that it is too long: a device may have no end. A pipe (`<(...)` in a shell) is read too. A byte
/// order mark, which programs on Windows put before a text, is taken off.
///
/// # Errors
/// Those of the file; `TimedOut` for a pipe into which nobody writes for five seconds.
pub fn read_at_most(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let flags = OFlags::NONBLOCK.bits() as i32;
    let file = OpenOptions::new().read(true).custom_flags(flags).open(path)?;
    let is_file = file.metadata()?.is_file();
    let mut reader = (&file).take(most.saturating_add(1));
    let mut bytes = Vec::new();
    if is_file {
        reader.read_to_end(&mut bytes)?;
        return Ok(without_mark(&bytes).to_vec());
    }
    let deadline = Instant::now() + PIPE_WITHIN;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let left = Timespec::try_from(left).map_err(io::Error::other)?;
        if poll(&mut [PollFd::new(&file, PollFlags::IN)], Some(&left))? == 0 {
            return Err(io::Error::new(ErrorKind::TimedOut, "it is a pipe into which nobody writes"));
        }
        // Bytes that came before a pipe ran dry are kept.
        match reader.read_to_end(&mut bytes) {
            Ok(_) => return Ok(without_mark(&bytes).to_vec()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::io::Write;
    use std::os::fd::AsRawFd;

    #[test]
    fn what_has_no_end_is_read_no_further() {
        assert_eq!(read_at_most(Path::new("/dev/zero"), 1000).unwrap(), [0; 1001]);
        assert!(read_at_most(Path::new("/dev/null"), 1000).unwrap().is_empty());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text");
        fs::write(&path, "twelve bytes").unwrap();
        assert_eq!(read_at_most(&path, 12).unwrap(), b"twelve bytes");
        assert_eq!(read_at_most(&path, 5).unwrap(), b"twelve");
        assert_eq!(read_at_most(folder.path(), 5).unwrap_err().kind(), ErrorKind::IsADirectory);
    }

    #[test]
    fn a_pipe_is_read_to_its_end_and_one_without_a_writer_is_given_up() {
        let (reader, mut writer) = io::pipe().unwrap();
        let path = format!("/proc/self/fd/{}", reader.as_raw_fd());
        std::thread::scope(|scope| {
            scope.spawn(move || {
                writer.write_all(b"from a ").unwrap();
                let _ = poll(&mut [], Some(&Timespec { tv_sec: 0, tv_nsec: 50_000_000 }));
                writer.write_all(b"shell").unwrap();
            });
            assert_eq!(read_at_most(Path::new(&path), 100).unwrap(), b"from a shell");
        });
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        assert_eq!(read_at_most(&pipe, 100).unwrap_err().kind(), ErrorKind::TimedOut);
    }
}
