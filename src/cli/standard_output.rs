use crate::error::{Error, Result};
use std::io::{self, ErrorKind, Write};

/// Writes lines to standard output; false when nobody reads it any more.
pub(super) fn print(lines: &[String]) -> Result<bool> {
    let mut out = io::stdout().lock();
    match lines.iter().try_for_each(|line| writeln!(out, "{line}")) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(Error::failed("standard output cannot be written").because(error)),
    }
}
