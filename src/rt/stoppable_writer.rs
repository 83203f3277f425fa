use super::Shutdown;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::Errno;
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::time::{Duration, Instant};

/// How often a wait for room checks whether an end was requested.
const GLANCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

/// After a shutdown request, a reader that takes nothing for this long is given up.
const PATIENCE: Duration = Duration::from_secs(1);

/// A file, or a pipe whose reader may have stopped reading: a write waits for room as long as necessary, but
/// not after the end was requested.
pub struct StoppableWriter {
    file: File,
    shutdown: Shutdown,
}

impl StoppableWriter {
    /// Writes to `file`, which becomes non-blocking for all that share its open description.
    ///
    /// # Errors
    /// When the file cannot be made non-blocking.
    pub fn new(file: File, shutdown: &Shutdown) -> io::Result<Self> {
        let flags = fcntl_getfl(&file)?;
        fcntl_setfl(&file, flags | OFlags::NONBLOCK)?;
        Ok(Self { file, shutdown: shutdown.clone() })
    }
}

impl Write for StoppableWriter {
    /// # Errors
    /// `TimedOut` where the reader took nothing for a second after an end was requested; those of the file.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut asked_to_end = None;
        loop {
            match self.file.write(bytes) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                outcome => return outcome,
            }
            match poll(&mut [PollFd::new(&self.file, PollFlags::OUT)], Some(&GLANCE)) {
                Ok(_) | Err(Errno::INTR) => {}
                Err(error) => return Err(error.into()),
            }
            if self.shutdown.is_aborted()
                || self.shutdown.is_requested()
                    && asked_to_end.get_or_insert_with(Instant::now).elapsed() >= PATIENCE
            {
                return Err(io::Error::new(ErrorKind::TimedOut, "its reader takes nothing any more"));
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;
    use std::os::fd::OwnedFd;

    fn pipe(shutdown: &Shutdown) -> (StoppableWriter, io::PipeReader) {
        let (reader, writer) = io::pipe().unwrap();
        (StoppableWriter::new(File::from(OwnedFd::from(writer)), shutdown).unwrap(), reader)
    }

    #[test]
    fn a_reader_that_comes_back_gets_everything() {
        let (mut writer, mut reader) = pipe(&Shutdown::new());
        let bytes: Vec<u8> = (0..1_000_000).map(|index| (index % 251) as u8).collect();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                writer.write_all(&bytes).unwrap();
                drop(writer);
            });
            let mut got = vec![0; 10];
            reader.read_exact(&mut got).unwrap();
            reader.read_to_end(&mut got).unwrap();
            assert!(got == bytes);
        });
    }

    #[test]
    fn a_reader_that_has_stopped_holds_up_nobody_who_is_to_end() {
        let shutdown = Shutdown::new();
        let (mut writer, reader) = pipe(&shutdown);
        std::thread::scope(|scope| {
            let writing = scope.spawn(move || writer.write_all(&[1; 1_000_000]).unwrap_err().kind());
            shutdown.request();
            assert_eq!(writing.join().unwrap(), ErrorKind::TimedOut);
        });
        drop(reader);
        let (mut writer, reader) = pipe(&shutdown);
        drop(reader);
        assert_eq!(writer.write(&[1]).unwrap_err().kind(), ErrorKind::BrokenPipe);
    }
}
