//! State that the connections of a server share.

use super::access::{Names, Refusal};
use super::burst::Burst;
use super::room::Room;
use super::{Board, ServerOptions};
use crate::rt::{Counter, Metrics, monotonic_ns};
use axum::body::Bytes;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};
use tokio::sync::watch;

/// Most origins and names that are told to be refused, and the longest.
const TOLD_MAX: usize = 32;
const TOLD_MAX_BYTES: usize = 200;

/// State that all connections share, and how many of them there may be.
pub(super) struct Shared {
    pub board: Arc<Board>,
    pub names: Names,
    pub room: Room,
    pub metrics: Arc<Metrics>,
    pub counters: Counters,
    /// The newest map as PNG and as OpenEXR.
    pub maps: [Arc<tokio::sync::Mutex<Option<EncodedMap>>>; 2],
    options: RwLock<Arc<ServerOptions>>,
    clients: AtomicUsize,
    /// Origins and names that were told to be refused.
    told: Mutex<Vec<String>>,
    /// Requests without the token.
    strangers: Mutex<Burst>,
    phase: watch::Sender<Phase>,
}

/// The phase of the server, for its sessions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// It serves by the rules of this number.
    Serving(u64),
    /// It accepts no more clients.
    Ending,
}

/// What the server counts.
pub(super) struct Counters {
    pub lists_sent: Counter,
    pub lists_lost: Counter,
    pub bytes_sent: Counter,
    pub refused: Counter,
    pub bad_messages: Counter,
    pub floods: Counter,
    pub silent: Counter,
    pub left_for_others: Counter,
    pub too_slow: Counter,
}

/// The peer of the connection over which a request came.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peer(pub SocketAddr);

/// The connection slot of a client; free again when dropped.
pub(super) struct ConnectionSlot(Arc<Shared>);

/// A map as a file.
#[derive(Clone)]
pub(super) struct EncodedMap {
    /// Number of maps on the board before it.
    pub number: u64,
    pub sequence: u64,
    pub theta_max_rad: f64,
    pub bytes: Bytes,
}

impl Shared {
    /// The shared state of a new server, with the data for clients on `board` and the rules for access in
    /// `options`.
    pub fn new(board: &Arc<Board>, names: Names, room: Room, options: ServerOptions) -> Self {
        let metrics = Metrics::new("serve");
        Self {
            board: board.clone(),
            names,
            room,
            counters: Counters::new(&metrics),
            metrics,
            maps: Default::default(),
            options: RwLock::new(Arc::new(options)),
            clients: AtomicUsize::new(0),
            told: Mutex::default(),
            strangers: Mutex::default(),
            phase: watch::Sender::new(Phase::Serving(0)),
        }
    }

    pub fn options(&self) -> Arc<ServerOptions> {
        self.options.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Serves by these rules from now on; sessions are notified if they changed.
    pub fn set_options(&self, options: ServerOptions) {
        let mut kept = self.options.write().unwrap_or_else(PoisonError::into_inner);
        if **kept != options {
            *kept = Arc::new(options);
            self.phase.send_modify(|phase| {
                if let Phase::Serving(rules) = phase {
                    *rules += 1;
                }
            });
        }
    }

    /// Logs an origin or a name that is refused, once, and what lets it in: a browser shows its page nothing
    /// of it.
    pub fn tell_of_refused(&self, refusal: Refusal, subject: &str) {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        // Somebody may invent more.
        if told.len() >= TOLD_MAX
            || subject.len() > TOLD_MAX_BYTES
            || told.iter().any(|known| known == subject)
        {
            return;
        }
        told.push(subject.to_owned());
        match refusal {
            Refusal::Origin => tracing::warn!(
                "pages of {subject} are refused; to let them connect, set [server] origins = [\"{subject}\"]"
            ),
            _ => tracing::warn!(
                "requests to the name {subject:?} are refused; to let them in, listen on that name, or set [server] \
                 origins = [\"http://{subject}\"]"
            ),
        }
    }

    /// Logs that a request had no token, or a wrong one; many of them in sum.
    pub fn tell_of_stranger(&self, peer: Option<Peer>) {
        if let Some(count) = self.strangers().note(monotonic_ns()) {
            let from = peer.map_or("?".to_owned(), |Peer(peer)| peer.ip().to_string());
            tracing::warn!("{count} requests without the token, the last of them from {from}");
        }
    }

    /// Logs what has not been told yet; called now and then.
    pub fn tell_rest(&self) {
        if let Some(count) = self.strangers().rest(monotonic_ns()) {
            tracing::warn!("{count} more requests without the token");
        }
    }

    fn strangers(&self) -> MutexGuard<'_, Burst> {
        self.strangers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Accepts no more clients; sessions are notified.
    pub fn end(&self) {
        self.phase.send_replace(Phase::Ending);
    }

    pub fn phase(&self) -> watch::Receiver<Phase> {
        self.phase.subscribe()
    }

    pub fn client_count(&self) -> u64 {
        self.clients.load(Ordering::Acquire) as u64
    }

    /// A connection slot for a client, if fewer than `clients_max` are taken, and there is room for it.
    pub fn admit(self: &Arc<Self>, clients_max: usize) -> Option<ConnectionSlot> {
        let most = clients_max.min(self.room.streams);
        self.clients
            .fetch_update(Ordering::AcqRel, Ordering::Acquire, |count| (count < most).then_some(count + 1))
            .ok()
            .map(|_| ConnectionSlot(self.clone()))
    }
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Shared").field("clients", &self.clients).finish_non_exhaustive()
    }
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        self.0.clients.fetch_sub(1, Ordering::AcqRel);
    }
}

impl Counters {
    fn new(metrics: &Metrics) -> Self {
        Self {
            lists_sent: metrics.frames.clone(),
            lists_lost: metrics.drops.clone(),
            bytes_sent: metrics.counter("bytes sent"),
            refused: metrics.counter("requests refused"),
            bad_messages: metrics.counter("bad messages"),
            floods: metrics.counter("clients that sent too many messages"),
            silent: metrics.counter("clients that went silent"),
            left_for_others: metrics.counter("connections that gave their place to others"),
            too_slow: metrics.counter("answers that were taken too slowly"),
        }
    }
}
