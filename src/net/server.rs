use super::access::Names;
use super::requests::{self, EncodedMap};
use super::{Board, ServerOptions};
use crate::error::{Error, Result};
use crate::rt::{Counter, Metrics, Shutdown, Threads};
use axum::Router;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use socket2::SockRef;
use std::net::{SocketAddr, TcpListener, ToSocketAddrs};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::runtime;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::time::{sleep, timeout};

/// Bytes that the kernel keeps for a client that does not take them. More would only be older lists for the
/// client to read before it comes to the newest: this holds some 15 lists of 300 lights as bytes.
const SEND_BUFFER_BYTES: usize = 1 << 16;
/// Connections for requests beside those that lists are streamed over.
const REQUESTS_MAX: usize = 64;
/// Longest time for the head of a request.
const HEAD_WITHIN: Duration = Duration::from_secs(5);
/// Longest life of a connection for requests: a client that reads an answer byte by byte does not hold it for
/// ever.
const CONNECTION_WITHIN: Duration = Duration::from_secs(120);
/// Longest time that clients have in the end to take what is left.
const END_WITHIN: Duration = Duration::from_secs(2);

/// A server that streams what is posted on a [`Board`], on a thread of its own, until it is stopped.
pub struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
    /// Until it is stopped.
    threads: Option<Threads>,
}

/// What all connections share.
pub(super) struct Shared {
    pub board: Arc<Board>,
    pub names: Names,
    pub metrics: Arc<Metrics>,
    pub counters: Counters,
    /// The newest map as PNG and as OpenEXR.
    pub maps: [Arc<tokio::sync::Mutex<Option<EncodedMap>>>; 2],
    options: RwLock<Arc<ServerOptions>>,
    clients: AtomicUsize,
    phase: watch::Sender<Phase>,
}

/// What sessions have to know of the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// It serves by the rules of this number.
    Serving(u64),
    /// It takes nobody any more.
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
}

/// Whose connection a request came over.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peer(pub SocketAddr);

/// The connection slot of a client; free again when dropped.
pub(super) struct ConnectionSlot(Arc<Shared>);

impl Server {
    /// Listens on `address`, HOST:PORT (port 0: any), at once.
    ///
    /// # Errors
    /// Kind `Usage` for an address that is none; when it is taken or not this machine's.
    pub fn start(
        address: &str,
        board: &Arc<Board>,
        options: ServerOptions,
        shutdown: &Shutdown,
    ) -> Result<Self> {
        let (listener, asked) = (listen(address)?, address.to_owned());
        let failed = |error: std::io::Error| Error::failed("cannot listen").because(error).at(address);
        let address = listener.local_addr().map_err(failed)?;
        if options.token.is_none() && !address.ip().is_loopback() {
            tracing::warn!(
                "{address} can be reached by other machines, and whoever reaches it gets in: see [server] token_file"
            );
        }
        let metrics = Metrics::new("serve");
        let shared = Arc::new(Shared {
            board: board.clone(),
            names: Names::new(&asked, address.ip().is_loopback()),
            counters: Counters::new(&metrics),
            metrics,
            maps: Default::default(),
            options: RwLock::new(Arc::new(options)),
            clients: AtomicUsize::new(0),
            phase: watch::Sender::new(Phase::Serving(0)),
        });
        let runtime = runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .max_blocking_threads(2)
            .thread_name("serve maps")
            .build()
            .map_err(failed)?;
        let mut threads = Threads::new(shutdown);
        let (serving, router) = (shared.clone(), requests::router(&shared));
        threads.spawn("serve", move || {
            let outcome = runtime.block_on(serve(listener, serving, router));
            // What clients have not taken by now they will not.
            runtime.shutdown_timeout(Duration::from_millis(100));
            outcome
        })?;
        Ok(Self { address, shared, threads: Some(threads) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What it has done so far.
    pub fn metrics(&self) -> &Arc<Metrics> {
        &self.shared.metrics
    }

    /// Serves by other rules from now on. Clients that are connected have to connect again if they changed.
    pub fn set_options(&self, options: ServerOptions) {
        let mut kept = self.shared.options.write().unwrap_or_else(PoisonError::into_inner);
        if **kept != options {
            *kept = Arc::new(options);
            self.shared.phase.send_modify(|phase| {
                if let Phase::Serving(rules) = phase {
                    *rules += 1;
                }
            });
        }
    }

    /// Gives all clients the rest, for two seconds at most, and ends.
    ///
    /// # Errors
    /// When it had failed or panicked before.
    pub fn stop(mut self) -> Result<()> {
        self.shared.phase.send_replace(Phase::Ending);
        self.threads.take().map_or(Ok(()), |threads| threads.join(Duration::from_millis(100), || ()))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // Its thread is joined after this.
        self.shared.phase.send_replace(Phase::Ending);
    }
}

fn listen(address: &str) -> Result<TcpListener> {
    let wrong = "is no HOST:PORT to listen on, such as 127.0.0.1:7300";
    let addresses: Vec<SocketAddr> =
        address.to_socket_addrs().map_err(|error| Error::usage(wrong).because(error).at(address))?.collect();
    let failed = |error: std::io::Error| {
        Error::failed("cannot be listened on; is another program there?").because(error).at(address)
    };
    let listener = TcpListener::bind(&addresses[..]).map_err(failed)?;
    // Connections take over what their listener has.
    SockRef::from(&listener).set_send_buffer_size(SEND_BUFFER_BYTES).map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    Ok(listener)
}

async fn serve(listener: TcpListener, shared: Arc<Shared>, router: Router) -> Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener)
        .map_err(|error| Error::failed("the server cannot listen").because(error))?;
    let connections = Arc::new(Semaphore::new(REQUESTS_MAX));
    let mut phase = shared.phase();
    loop {
        // With all connection slots taken, the others wait in the kernel until a connection ends or its time
        // is up.
        let permit = tokio::select! {
            permit = connections.clone().acquire_owned() => permit.expect("nobody closes the semaphore"),
            _ = phase.wait_for(|phase| *phase == Phase::Ending) => break,
        };
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            _ = phase.wait_for(|phase| *phase == Phase::Ending) => break,
        };
        match accepted {
            Ok((stream, address)) => {
                let service = TowerToHyperService::new(router.clone());
                tokio::spawn(connection(stream, Peer(address), service, permit));
            }
            Err(error) => {
                // The client has gone again, or this process has no file handle left: another time.
                tracing::warn!("a connection cannot be accepted: {error}");
                sleep(Duration::from_millis(100)).await;
            }
        }
    }
    drop(listener);
    let is_empty = async {
        while shared.client_count() > 0 {
            sleep(Duration::from_millis(5)).await;
        }
    };
    let _ = timeout(END_WITHIN, is_empty).await;
    Ok(())
}

/// Answers the requests of one connection. One that becomes a stream of lists leaves it, and its permit,
/// behind.
async fn connection(
    stream: TcpStream,
    peer: Peer,
    service: TowerToHyperService<Router>,
    permit: OwnedSemaphorePermit,
) {
    // A list is one write, and waits for no other.
    let _ = stream.set_nodelay(true);
    let service = service_fn(move |mut request: Request<Incoming>| {
        request.extensions_mut().insert(peer);
        service.call(request)
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_WITHIN)
        .serve_connection(TokioIo::new(stream), service)
        .with_upgrades();
    // Whoever sends nonsense or goes away meanwhile is no concern of the server's.
    let _ = timeout(CONNECTION_WITHIN, connection).await;
    drop(permit);
}

impl Shared {
    pub fn options(&self) -> Arc<ServerOptions> {
        self.options.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub fn phase(&self) -> watch::Receiver<Phase> {
        self.phase.subscribe()
    }

    pub fn client_count(&self) -> u64 {
        self.clients.load(Ordering::Acquire) as u64
    }

    /// A connection slot for a client, if fewer than `most` are taken.
    pub fn admit(self: &Arc<Self>, most: usize) -> Option<ConnectionSlot> {
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
        }
    }
}
