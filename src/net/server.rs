use super::access::Names;
use super::places::{Found, Place, Places};
use super::room::Room;
use super::shared::{Peer, Phase, Shared};
use super::watched::Watched;
use super::{Board, ServerOptions, requests};
use crate::error::{Error, Result};
use crate::rt::{Metrics, Shutdown, Threads, handle_limit, monotonic_ns};
use axum::Router;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use socket2::SockRef;
use std::net::{SocketAddr, TcpListener, ToSocketAddrs};
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::runtime;
use tokio::task::yield_now;
use tokio::time::{MissedTickBehavior, interval, sleep, timeout};

/// Size of the kernel's send buffer for a client. More would only hold older lists for the client to read
/// before it gets to the newest: this holds some 15 lists of 300 lights as bytes.
const SEND_BUFFER_BYTES: usize = 1 << 16;
/// Longest time for the head of a request.
const HEAD_WITHIN: Duration = Duration::from_secs(5);
/// How often a connection is looked at, whether its client takes its answer fast enough.
const GLANCE: Duration = Duration::from_secs(1);
/// Answer to a connection for which there is no place.
const NO_PLACE: &[u8] =
    b"HTTP/1.1 503 Service Unavailable\r\nretry-after: 1\r\nconnection: close\r\ncontent-length: 0\r\n\r\n";
/// How often a place is looked for that is free soon.
const SOON: Duration = Duration::from_millis(5);
/// Longest time that clients have at the end to take the remaining lists.
const END_WITHIN: Duration = Duration::from_secs(2);

/// A server that streams the posts of a [`Board`], on a thread of its own, until it is stopped.
pub struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
    /// Until it is stopped.
    threads: Option<Threads>,
}

impl Server {
    /// Listens on `address`, HOST:PORT (port 0: any), immediately.
    ///
    /// # Errors
    /// Kind `Usage` for an invalid address; others when it is taken or not this machine's.
    pub fn start(
        address: &str,
        board: &Arc<Board>,
        options: ServerOptions,
        shutdown: &Shutdown,
    ) -> Result<Self> {
        let (listener, asked) = (listen(address)?, address.to_owned());
        let failed = |error: std::io::Error| Error::failed("cannot listen").because(error).at(address);
        let address = listener.local_addr().map_err(failed)?;
        let names = Names::new(&asked, address.ip().is_loopback());
        let room = Room::within(handle_limit())?;
        warn(address, room, &options);
        let shared = Arc::new(Shared::new(board, names, room, options));
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
            // Clients will not take what they have not taken by now.
            runtime.shutdown_timeout(Duration::from_millis(100));
            outcome
        })?;
        Ok(Self { address, shared, threads: Some(threads) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Its metrics so far.
    pub fn metrics(&self) -> &Arc<Metrics> {
        &self.shared.metrics
    }

    /// Serves by these rules from now on. If they changed, connected clients have to reconnect.
    pub fn set_options(&self, options: ServerOptions) {
        if *self.shared.options() != options {
            warn(self.address, self.shared.room, &options);
        }
        self.shared.set_options(options);
    }

    /// Sends all clients the remaining lists, for two seconds at most, and ends.
    ///
    /// # Errors
    /// When it had failed or panicked before.
    pub fn stop(mut self) -> Result<()> {
        self.shared.end();
        self.threads.take().map_or(Ok(()), |threads| threads.join(Duration::from_millis(100), || ()))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // Its thread is joined after this.
        self.shared.end();
    }
}

/// Says what these options let happen.
fn warn(address: SocketAddr, room: Room, options: &ServerOptions) {
    if options.token.is_none() && !address.ip().is_loopback() {
        tracing::warn!(
            "{address} can be reached by other machines, and whoever reaches it gets in: see [server] token_file"
        );
    }
    let (asked, have) = (options.clients_max, room.streams);
    if asked > have {
        tracing::warn!(
            "[server] clients_max = {asked}, but the limit of open files leaves room for {have}: the clients \
             beyond them are sent away; raise the limit (ulimit -n, LimitNOFILE= of a unit) to {}",
            Room::limit_for(asked)
        );
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
    // Connections inherit this from their listener.
    SockRef::from(&listener).set_send_buffer_size(SEND_BUFFER_BYTES).map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    Ok(listener)
}

async fn serve(listener: TcpListener, shared: Arc<Shared>, router: Router) -> Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener)
        .map_err(|error| Error::failed("the server cannot listen").because(error))?;
    let places = Places::new(shared.room.requests);
    let mut phase = shared.phase();
    let mut sums = interval(GLANCE);
    sums.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            _ = phase.wait_for(|phase| *phase == Phase::Ending) => break,
            _ = sums.tick() => {
                shared.tell_rest();
                continue;
            }
        };
        match accepted {
            Ok((stream, address)) => match place(&places).await {
                Some(place) => {
                    let service = TowerToHyperService::new(router.clone());
                    tokio::spawn(connection(stream, Peer(address), service, place, shared.clone()));
                    // One that has to leave for it does so before the next one comes: their number is
                    // limited.
                    yield_now().await;
                }
                None => {
                    shared.counters.refused.add(1);
                    let _ = stream.try_write(NO_PLACE);
                }
            },
            Err(error) => {
                // The client has gone again, or this process has no file handle left: try again later.
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

/// A place for a connection, which is waited for where one is free soon; the others that come meanwhile wait
/// in the system's queue.
async fn place(places: &Arc<Places>) -> Option<Place> {
    loop {
        match places.take(monotonic_ns()) {
            Found::Place(place) => return Some(place),
            Found::Soon => sleep(SOON).await,
            Found::Nothing => return None,
        }
    }
}

/// Answers the requests of one connection. A connection that becomes a stream of lists leaves this function
/// and gives its place back.
async fn connection(
    stream: TcpStream,
    peer: Peer,
    service: TowerToHyperService<Router>,
    place: Place,
    shared: Arc<Shared>,
) {
    // A list is one write, which need not be combined with others.
    let _ = stream.set_nodelay(true);
    let visit = &place.visit;
    let watched = Watched::new(stream, visit);
    let asking = visit.clone();
    let service = service_fn(move |mut request: Request<Incoming>| {
        asking.asks(monotonic_ns());
        request.extensions_mut().insert(peer);
        request.extensions_mut().insert(asking.clone());
        service.call(request)
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_WITHIN)
        .serve_connection(TokioIo::new(watched), service)
        .with_upgrades();
    let is_too_slow = async {
        while !visit.is_too_slow(monotonic_ns()) {
            sleep(GLANCE).await;
        }
    };
    tokio::select! {
        // Errors of clients that send nonsense or disconnect meanwhile do not matter to the server.
        _ = connection => {}
        () = visit.leave.notified() => shared.counters.left_for_others.add(1),
        () = is_too_slow => shared.counters.too_slow.add(1),
    }
}
