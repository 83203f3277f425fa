//! File handles, of which every connection and every open file is one, and of which a process has a limited
//! number.

use rustix::io::Errno;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use std::io;

/// Raises the limit on open files from the shell's to the highest that is allowed.
///
/// # Errors
/// When the system refuses; the limit then stays as it was.
pub fn raise_handle_limit() -> io::Result<()> {
    let limit = getrlimit(Resource::Nofile);
    Ok(setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit })?)
}

/// How many files and connections this process may have open; `None`: as many as it likes.
pub fn handle_limit() -> Option<u64> {
    getrlimit(Resource::Nofile).current
}

/// Whether this error says that no file handle is left in this process or in the machine.
pub fn is_out_of_handles(error: &io::Error) -> bool {
    let code = error.raw_os_error();
    code == Some(Errno::MFILE.raw_os_error()) || code == Some(Errno::NFILE.raw_os_error())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_lack_of_handles_is_one() {
        assert!(is_out_of_handles(&io::Error::from(Errno::MFILE)));
        assert!(is_out_of_handles(&io::Error::from(Errno::NFILE)));
        assert!(!is_out_of_handles(&io::Error::from(Errno::NOENT)));
        assert!(!is_out_of_handles(&io::Error::other("too many open files")));
    }
}
