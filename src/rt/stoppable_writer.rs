use super::Shutdown;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::Errno;
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often a wait for room checks whether an end was requested.
const GLANCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

/// After a shutdown request, a reader that takes nothing for this long is given up.
const PATIENCE: Duration = Duration::from_secs(1);

/// A file, or a pipe whose reader may have stopped reading: a write waits for room as long as necessary, but
/// not after the end was requested. Where a writer had to leave a line unfinished, the next one to the same
/// file ends that line first.
pub struct StoppableWriter {
    file: File,
    shutdown: Shutdown,
    /// Whether what has been written ends within a line.
    is_cut: Arc<AtomicBool>,
    /// Whether the line before is to be ended first.
    ends_line: bool,
}

impl StoppableWriter {
    /// Writes to `file`, which becomes non-blocking for all that share its open description. `is_cut` tells
    /// the next writer to it whether this one has left a line unfinished.
    ///
    /// # Errors
    /// When the file cannot be made non-blocking.
    pub fn new(file: File, is_cut: &Arc<AtomicBool>, shutdown: &Shutdown) -> io::Result<Self> {
        let flags = fcntl_getfl(&file)?;
        fcntl_setfl(&file, flags | OFlags::NONBLOCK)?;
        let ends_line = is_cut.load(Ordering::Relaxed);
        Ok(Self { file, shutdown: shutdown.clone(), is_cut: is_cut.clone(), ends_line })
    }

    fn write_when_there_is_room(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut asked_to_end = None;
        loop {
            match self.file.write(bytes) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Ok(count) => {
                    if let Some(last) = bytes[..count].last() {
                        self.is_cut.store(*last != b'\n', Ordering::Relaxed);
                    }
                    return Ok(count);
                }
                Err(error) => return Err(error),
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
}

impl Write for StoppableWriter {
    /// # Errors
    /// `TimedOut` where the reader took nothing for a second since an end was asked for; those of the file.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.ends_line {
            self.write_when_there_is_room(b"\n")?;
            self.ends_line = false;
        }
        self.write_when_there_is_room(bytes)
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
        let file = File::from(OwnedFd::from(writer));
        (StoppableWriter::new(file, &Arc::default(), shutdown).unwrap(), reader)
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
    #[test]
    fn a_line_that_was_cut_is_ended_by_the_next_writer() {
        let (mut reader, writer) = io::pipe().unwrap();
        let (file, is_cut) = (File::from(OwnedFd::from(writer)), Arc::default());
        let writer = |shutdown| StoppableWriter::new(file.try_clone().unwrap(), &is_cut, shutdown).unwrap();
        let ending = Shutdown::new();
        ending.request();
        let line = [vec![b'1'; 1_000_000], vec![b'\n']].concat();
        assert_eq!(writer(&ending).write_all(&line).unwrap_err().kind(), ErrorKind::TimedOut);
        let mut taken = vec![0; 100_000];
        let count = reader.read(&mut taken).unwrap();
        assert!(count > 0);
        let goes_on = Shutdown::new();
        writer(&goes_on).write_all(b"2\n").unwrap();
        writer(&goes_on).write_all(b"3\n").unwrap();
        drop(file);
        let mut text = String::from_utf8(taken[..count].to_vec()).unwrap();
        reader.read_to_string(&mut text).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].bytes().all(|byte| byte == b'1'));
        assert_eq!(lines[1..], ["2", "3"]);
    }
}
