//! How many connections a server has room for, so that they never take the last file handle.

use crate::error::{Error, Result};

/// Handles that connections leave to everything else: the files of frames, of a recording, of pictures and of
/// the configuration, the listener, standard streams. A service uses about twenty.
const FOR_FILES: usize = 32;
/// Most connections for requests, in addition to those for streams of lists: after a restart a thousand
/// clients come at once, and each is one until it has its stream.
const REQUESTS_MAX: usize = 1024;
/// Fewest of each kind.
const LEAST: usize = 4;

/// Most connections at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Room {
    /// For requests, before they are answered or become streams.
    pub requests: usize,
    /// For streams of lists.
    pub streams: usize,
}

impl Room {
    /// The room where `limit` files may be open; `None`: any number.
    ///
    /// # Errors
    /// When there is hardly any.
    pub fn within(limit: Option<u64>) -> Result<Self> {
        let limit = limit.map_or(usize::MAX, |limit| usize::try_from(limit).unwrap_or(usize::MAX));
        let connections = limit.saturating_sub(FOR_FILES);
        if connections < 2 * LEAST {
            return Err(Error::failed(format!(
                "a server needs {} open files or more, but the limit is {limit}; raise it (ulimit -n, LimitNOFILE= of \
                 a unit)",
                FOR_FILES + 2 * LEAST
            )));
        }
        let requests = (connections / 4).clamp(LEAST, REQUESTS_MAX);
        Ok(Self { requests, streams: connections - requests })
    }

    /// The limit that leaves room for `streams`.
    pub fn limit_for(streams: usize) -> usize {
        streams + (streams / 3 + 1).clamp(LEAST, REQUESTS_MAX) + FOR_FILES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_never_take_the_handles_of_files() {
        for limit in [40, 41, 64, 100, 256, 1024, 65_536] {
            let Room { requests, streams } = Room::within(Some(limit)).unwrap();
            assert_eq!((requests + streams + FOR_FILES) as u64, limit);
            assert!(requests >= LEAST && streams >= LEAST && requests <= REQUESTS_MAX, "{limit}");
        }
        assert_eq!(Room::within(Some(64)).unwrap(), Room { requests: 8, streams: 24 });
        assert_eq!(Room::within(None).unwrap().requests, REQUESTS_MAX);
        assert!(Room::within(Some(39)).unwrap_err().to_string().contains("needs 40 open files or more"));
    }

    #[test]
    fn the_limit_that_is_advised_suffices_and_is_hardly_too_high() {
        for streams in [4, 5, 24, 100, 256, 1000, 100_000] {
            let limit = Room::limit_for(streams);
            assert!(Room::within(Some(limit as u64)).unwrap().streams >= streams, "{streams}");
            assert!(
                Room::within(Some(limit as u64 - 3)).is_ok_and(|room| room.streams < streams) || streams < 6
            );
        }
    }
}
