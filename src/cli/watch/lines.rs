use crate::error::{Error, Place, Result};
use crate::wire::write_list_line;
use lightcast_core::light::LightList;
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Where lists go as lines of JSON.
pub(super) struct Lines {
    /// To standard output.
    is_printed: bool,
    file: Option<(File, PathBuf)>,
    line: Vec<u8>,
}

impl Lines {
    /// # Errors
    /// When the file cannot be made.
    pub fn open(is_printed: bool, file: Option<&Path>) -> Result<Self> {
        let file = file
            .map(|path| match File::create(path) {
                Ok(file) => Ok((file, path.to_owned())),
                Err(error) => Err(Error::failed("the file cannot be made").because(error).at(path)),
            })
            .transpose()?;
        Ok(Self { is_printed, file, line: Vec::new() })
    }

    /// False when nobody reads them any more.
    ///
    /// # Errors
    /// When a list cannot be written, with its number.
    pub fn write(&mut self, list: &LightList) -> Result<bool> {
        if !self.is_printed && self.file.is_none() {
            return Ok(true);
        }
        let place = || Place::List(list.stamp.sequence);
        self.line.clear();
        write_list_line(list, &mut self.line)
            .map_err(|error| Error::failed("cannot be put into JSON").because(error).at(place()))?;
        if let Some((file, path)) = &mut self.file {
            file.write_all(&self.line)
                .map_err(|error| Error::failed("cannot be written").because(error).at(place()).at(&*path))?;
        }
        if self.is_printed {
            let mut output = io::stdout().lock();
            match output.write_all(&self.line).and_then(|()| output.flush()) {
                Ok(()) => {}
                Err(error) if error.kind() == ErrorKind::BrokenPipe => return Ok(false),
                Err(error) => {
                    return Err(Error::failed("cannot be written").because(error).at(place()));
                }
            }
        }
        Ok(true)
    }
}
