//! The file of `--output`: it is appended to, opened anew when logs are rotated, and written by one program
//! at a time.

use crate::error::{Error, Result};
use crate::rt::{Shutdown, StoppableWriter};
use crate::service::Output;
use rustix::fs::OFlags;
use rustix::io::Errno;
use std::cell::RefCell;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How often a pipe is looked at until somebody reads it.
const GLANCE: Duration = Duration::from_millis(50);

/// Where the services of one program write their lists, one after the other.
pub(in crate::cli) struct OutputFile {
    path: Option<PathBuf>,
    /// Lists that are streamed to clients are written only on request.
    is_streamed: bool,
    /// A pipe or device stays open from one service to the next, so that its reader sees no end in between.
    pipe: Rc<RefCell<Option<File>>>,
    state: Arc<State>,
}

/// The state of the file, which its writer shares.
#[derive(Default)]
struct State {
    /// Whether what has been written ends within a line.
    is_cut: Arc<AtomicBool>,
    /// Whether the file is to be opened anew.
    is_rotated: AtomicBool,
}

impl OutputFile {
    /// No file is touched yet.
    pub fn new(path: Option<&Path>, is_streamed: bool) -> Self {
        Self { path: path.map(Path::to_owned), is_streamed, pipe: Rc::default(), state: Arc::default() }
    }

    /// Lets the writer open the file anew before its next line: it may have another name by now.
    pub fn rotate(&self) {
        self.state.is_rotated.store(true, Ordering::Relaxed);
    }

    /// The output of a service that ends with `shutdown`.
    pub fn output(&self, shutdown: &Shutdown) -> Option<Output> {
        let Some(path) = &self.path else {
            return (!self.is_streamed).then(|| Output::new("standard output", io::stdout()));
        };
        let name = path.display().to_string();
        let (path, pipe) = (path.clone(), self.pipe.clone());
        let (state, shutdown) = (self.state.clone(), shutdown.clone());
        let open = move || -> Result<Box<dyn Write + Send>> {
            let failed =
                |error: io::Error| Error::failed("the output file cannot be opened").because(error).at(&path);
            state.is_rotated.store(false, Ordering::Relaxed);
            let kept = pipe.borrow().as_ref().map(File::try_clone);
            let file = match kept {
                Some(kept) => kept.map_err(failed)?,
                None => open(&path, &state, &shutdown)?,
            };
            if !file.metadata().map_err(failed)?.is_file() {
                *pipe.borrow_mut() = Some(file.try_clone().map_err(failed)?);
            }
            let writer = StoppableWriter::new(file, &state.is_cut, &shutdown).map_err(failed)?;
            Ok(Box::new(Lines { path, state, shutdown, writer }))
        };
        Some(Output { name, open: Box::new(open) })
    }
}

/// Lines for the file, which is opened anew between two of them where that is asked for.
struct Lines {
    path: PathBuf,
    state: Arc<State>,
    shutdown: Shutdown,
    writer: StoppableWriter,
}

impl Lines {
    fn open_anew(&mut self) -> Result<()> {
        let failed = |error: io::Error| Error::failed("cannot be opened anew").because(error).at(&self.path);
        if std::fs::metadata(&self.path).is_ok_and(|found| !found.is_file()) {
            return Ok(());
        }
        let file = open(&self.path, &self.state, &self.shutdown)?;
        self.writer = StoppableWriter::new(file, &self.state.is_cut, &self.shutdown).map_err(failed)?;
        Ok(())
    }
}

impl Write for Lines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let is_between_lines = !self.state.is_cut.load(Ordering::Relaxed);
        if is_between_lines && self.state.is_rotated.swap(false, Ordering::Relaxed) {
            // The old file is as good as any until somebody mends this.
            self.open_anew()
                .unwrap_or_else(|error| tracing::error!("the output goes on in the file as it was: {error}"));
        }
        self.writer.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

/// Opens a file to append to, which is made where there is none, and keeps other programs from it; waits for
/// the reader of a pipe.
fn open(path: &Path, state: &State, shutdown: &Shutdown) -> Result<File> {
    let failed = |error: io::Error| Error::failed("the output file cannot be opened").because(error).at(path);
    let mut options = OpenOptions::new();
    options.append(true).create(true).custom_flags(OFlags::NONBLOCK.bits() as i32);
    let file = loop {
        match options.open(path) {
            Ok(file) => break file,
            Err(error) if error.raw_os_error() == Some(Errno::NXIO.raw_os_error()) => {
                if shutdown.wait(GLANCE) {
                    return Err(Error::failed("is a pipe that nobody reads").at(path));
                }
            }
            Err(error) => return Err(failed(error)),
        }
    };
    if !file.metadata().map_err(failed)?.is_file() {
        return Ok(file);
    }
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            return Err(Error::failed("another program writes to it; name another file").at(path));
        }
        // Some network shares know no locks.
        Err(TryLockError::Error(error)) => {
            tracing::warn!("{}: other programs are not kept from writing to it: {error}", path.display());
        }
    }
    let bytes = file.metadata().map_err(failed)?.len();
    if bytes > 0 {
        tracing::info!("{}: goes on after the {bytes} bytes that it has", path.display());
    }
    state.is_cut.store(ends_within_a_line(path).unwrap_or(false), Ordering::Relaxed);
    Ok(file)
}

/// Whether the last line of a file has no end, because its writer was killed or the disk was full.
fn ends_within_a_line(path: &Path) -> io::Result<bool> {
    let mut file = File::open(path)?;
    if file.metadata()?.len() == 0 {
        return Ok(false);
    }
    file.seek(SeekFrom::End(-1))?;
    let mut last = [0];
    file.read_exact(&mut last)?;
    Ok(last != *b"\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn writer(file: &OutputFile) -> Result<Box<dyn Write + Send>> {
        (file.output(&Shutdown::new()).unwrap().open)()
    }

    #[test]
    fn a_file_is_gone_on_with_after_a_cut_line_and_after_a_rotation() {
        let folder = tempfile::tempdir().unwrap();
        let (path, old) = (folder.path().join("lists"), folder.path().join("lists.1"));
        fs::write(&path, "1\n2\n{\"cut").unwrap();
        let output = OutputFile::new(Some(&path), true);
        let mut lines = writer(&output).unwrap();
        lines.write_all(b"3\n").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "1\n2\n{\"cut\n3\n");
        fs::rename(&path, &old).unwrap();
        lines.write_all(b"4\n").unwrap();
        output.rotate();
        lines.write_all(b"5\n").unwrap();
        lines.write_all(b"6\n").unwrap();
        assert!(fs::read_to_string(&old).unwrap().ends_with("\n3\n4\n"));
        assert_eq!(fs::read_to_string(&path).unwrap(), "5\n6\n");
        // Where it cannot be opened anew, the file as it was is still there.
        fs::rename(&path, &old).unwrap();
        fs::create_dir(&path).unwrap();
        output.rotate();
        lines.write_all(b"7\n").unwrap();
        assert_eq!(fs::read_to_string(&old).unwrap(), "5\n6\n7\n");
    }

    #[test]
    fn a_second_writer_is_refused_until_the_first_has_gone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lists");
        let (first, second) = (OutputFile::new(Some(&path), true), OutputFile::new(Some(&path), true));
        let lines = writer(&first).unwrap();
        let error = writer(&second).err().unwrap().to_string();
        assert!(error.contains("lists: another program writes to it"), "{error}");
        drop(lines);
        writer(&second).unwrap();
    }
}
