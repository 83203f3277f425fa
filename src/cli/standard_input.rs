//! Standard input that can be abandoned while nothing arrives.

use crate::rt::Shutdown;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io::{self, BufRead, Cursor, Read};

/// How often a shutdown request is checked for while nothing arrives.
const GLANCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

/// Standard input, which ends with its last byte or when a shutdown is requested, even if its writer is
/// silent.
pub(super) struct StandardInput {
    /// The bytes that were read to find out its kind.
    first: Cursor<Vec<u8>>,
    end: Shutdown,
}

impl StandardInput {
    /// Takes all that was read so far.
    pub fn new(end: &Shutdown) -> Self {
        let mut input = io::stdin().lock();
        // A read error is reported by the first read.
        let first = input.fill_buf().map(<[u8]>::to_vec).unwrap_or_default();
        input.consume(first.len());
        Self { first: Cursor::new(first), end: end.clone() }
    }
}

impl Read for StandardInput {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.first.read(buffer)?;
        if count > 0 {
            return Ok(count);
        }
        let input = io::stdin();
        while !self.end.is_requested() {
            let mut events = [PollFd::new(&input, PollFlags::IN)];
            match poll(&mut events, Some(&GLANCE)) {
                Ok(0) | Err(rustix::io::Errno::INTR) => {}
                Ok(_) => return Ok(rustix::io::read(&input, &mut *buffer)?),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(0)
    }
}
