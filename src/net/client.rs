use super::Token;
use crate::error::{Error, Result};
use crate::rt::{BackOff, Counter, Metrics, Shutdown, Threads, monotonic_ns};
use crate::wire::{self, MESSAGE_MAX_BYTES, Message, Subscription, binary, json};
use axum::http::header::{AUTHORIZATION, SEC_WEBSOCKET_PROTOCOL};
use axum::http::{HeaderValue, StatusCode, Uri};
use futures_util::{SinkExt, StreamExt};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::net::TcpStream;
use tokio::runtime;
use tokio::time::{MissedTickBehavior, interval, sleep, timeout};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::handshake::client::Request;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::tungstenite::{Bytes, Error as SocketError, Message as SocketMessage};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async_with_config};

/// Longest time for a connection to be established.
const CONNECT_WITHIN: Duration = Duration::from_secs(10);
/// Wait before the second attempt to connect; doubled with every further one.
const FIRST_WAIT: Duration = Duration::from_millis(250);
/// Longest wait between two attempts.
const LONGEST_WAIT: Duration = Duration::from_secs(8);
/// Interval at which a server is sent a ping.
const ASK_EVERY: Duration = Duration::from_secs(5);
/// A server that has sent nothing for this long is given up.
const SILENCE_MAX: Duration = Duration::from_secs(20);
/// Four lists of 300 lights as bytes.
const READ_BUFFER_BYTES: usize = 1 << 14;
/// Most bytes that wait for the server to take them: a client only sends pings, pongs and a closing message.
const WRITE_BUFFER_MAX_BYTES: usize = 1 << 16;
/// Longest wait for a server to take the closing message.
const FAREWELL: Duration = Duration::from_millis(100);
/// How often a shutdown request is checked for.
const GLANCE: Duration = Duration::from_millis(20);

/// What a client wants, and from whom.
#[derive(Clone, Debug)]
pub struct ClientOptions {
    uri: Uri,
    /// What it asks for.
    pub subscription: Subscription,
    /// Whether lists come as bytes or as JSON.
    pub is_binary: bool,
    /// The token that it presents.
    pub token: Option<Token>,
}

impl ClientOptions {
    /// Everything, as bytes, from the server at `url`: `ws://HOST:PORT`, the address of its page
    /// (`http://...`), or HOST:PORT. Without a path it is `/ws`.
    ///
    /// # Errors
    /// Kind `Usage`: this is not such an address.
    pub fn new(url: &str) -> Result<Self> {
        let wrong = || Error::usage("is no address of a server, such as ws://127.0.0.1:7300").at(url);
        let rest = ["ws://", "http://"].iter().find_map(|scheme| url.strip_prefix(scheme)).unwrap_or(url);
        if rest.contains("://") {
            return Err(wrong());
        }
        let (host, path) = rest.split_once('/').unwrap_or((rest, ""));
        let path = if path.is_empty() { "ws" } else { path };
        let uri: Uri = format!("ws://{host}/{path}").parse().map_err(|_| wrong())?;
        if uri.host().is_none_or(str::is_empty) || uri.query().is_some() {
            return Err(wrong());
        }
        Ok(Self { uri, subscription: Subscription::default(), is_binary: true, token: None })
    }

    fn request(&self) -> Result<Request> {
        let failed = |error| Error::usage("cannot be asked for").because(error).at(self.uri.to_string());
        let query = serde_urlencoded::to_string(self.subscription)
            .map_err(|error| Error::usage("cannot be a query").because(error))?;
        let mut request = format!("{}?{query}", self.uri).into_client_request().map_err(failed)?;
        let protocol = if self.is_binary { wire::BINARY } else { wire::JSON };
        let headers = request.headers_mut();
        headers.insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(protocol));
        if let Some(token) = &self.token {
            let mut bearer = HeaderValue::try_from(format!("Bearer {}", token.reveal()))
                .map_err(|error| Error::usage("the token cannot be shown").because(error))?;
            bearer.set_sensitive(true);
            headers.insert(AUTHORIZATION, bearer);
        }
        Ok(request)
    }
}

/// Receives lists from a server until a shutdown is requested or nobody wants them any more. A connection
/// that breaks or cannot be made yet is tried again, as often as necessary, with growing waits.
pub struct Client {
    threads: Threads,
}

impl Client {
    /// Starts on a thread of its own, which counts in `metrics` and calls `deliver` with every message; when
    /// that returns false or an error, the thread ends. While `deliver` is busy, the server skips lists.
    ///
    /// # Errors
    /// Those of the system for threads.
    pub fn start(
        options: ClientOptions,
        metrics: &Arc<Metrics>,
        shutdown: &Shutdown,
        deliver: impl FnMut(&Message) -> Result<bool> + Send + 'static,
    ) -> Result<Self> {
        let mut threads = Threads::new(shutdown);
        let (metrics, shutdown) = (metrics.clone(), shutdown.clone());
        threads.spawn("client", move || {
            let runtime = runtime::Builder::new_current_thread()
                .enable_io()
                .enable_time()
                .build()
                .map_err(|error| Error::failed("the client cannot start").because(error))?;
            let mut connection = Connection {
                bytes: metrics.counter("bytes received"),
                reconnects: metrics.counter("connections lost"),
                options,
                deliver,
                message: Message::default(),
                attempts: BackOff::new(FIRST_WAIT, LONGEST_WAIT),
                metrics,
            };
            runtime.block_on(async {
                tokio::select! {
                    outcome = connection.keep() => outcome,
                    () = requested(&shutdown) => Ok(()),
                }
            })
        })?;
        Ok(Self { threads })
    }

    /// Waits for its end; calls `watch` about every `interval` meanwhile.
    ///
    /// # Errors
    /// When the server refuses this client for good: a wrong address, subscription or token; those of
    /// `deliver`.
    pub fn join(self, interval: Duration, watch: impl FnMut()) -> Result<()> {
        self.threads.join(interval, watch)
    }
}

type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

struct Connection<D> {
    options: ClientOptions,
    deliver: D,
    /// The last message.
    message: Message,
    /// Attempts to connect since the last list.
    attempts: BackOff,
    metrics: Arc<Metrics>,
    bytes: Counter,
    reconnects: Counter,
}

/// Why a connection ended.
enum End {
    /// Nobody wants more lists.
    Enough,
    /// It may be made again.
    Lost(String),
    /// Trying again is pointless.
    Failed(Error),
}

impl<D: FnMut(&Message) -> Result<bool>> Connection<D> {
    async fn keep(&mut self) -> Result<()> {
        loop {
            let end = match self.connect().await {
                Ok(socket) => {
                    tracing::info!("connected to {}", self.options.uri);
                    let Err(end) = self.receive(socket).await;
                    self.reconnects.add(u64::from(matches!(end, End::Lost(_))));
                    end
                }
                Err(end) => end,
            };
            match end {
                End::Enough => return Ok(()),
                End::Failed(error) => return Err(error),
                End::Lost(reason) => {
                    self.attempts.attempt();
                    if self.attempts.is_worth_telling() {
                        let attempts = self.attempts.attempts();
                        tracing::warn!("{}: {reason}; trying again (attempt {attempts})", self.options.uri);
                    }
                    // Clients that a server has lost together do not all reconnect at the same moment.
                    let chance = (monotonic_ns() / 1000 % 1000) as f64 * 1e-3;
                    sleep(self.attempts.wait().mul_f64(0.5 + 0.5 * chance)).await;
                }
            }
        }
    }

    async fn connect(&self) -> Result<Socket, End> {
        let request = self.options.request().map_err(End::Failed)?;
        let config = WebSocketConfig::default()
            .max_message_size(Some(MESSAGE_MAX_BYTES))
            .max_frame_size(Some(MESSAGE_MAX_BYTES))
            // The buffer is cleared before every read.
            .read_buffer_size(READ_BUFFER_BYTES)
            // A server that sends pings and takes no pong is given up.
            .write_buffer_size(0)
            .max_write_buffer_size(WRITE_BUFFER_MAX_BYTES);
        let connecting = connect_async_with_config(request, Some(config), true);
        match timeout(CONNECT_WITHIN, connecting).await {
            Ok(Ok((socket, _))) => Ok(socket),
            Ok(Err(SocketError::Http(response))) => {
                Err(self.refusal(response.status(), response.body().as_deref()))
            }
            Ok(Err(error)) => Err(End::Lost(error.to_string())),
            Err(_) => Err(End::Lost(format!("no answer within {} s", CONNECT_WITHIN.as_secs()))),
        }
    }

    /// The meaning of an answer other than a stream: some answers may change later.
    fn refusal(&self, status: StatusCode, body: Option<&[u8]>) -> End {
        let reason = String::from_utf8_lossy(body.unwrap_or_default());
        let told = printable(&reason);
        let is_for_now = [StatusCode::REQUEST_TIMEOUT, StatusCode::TOO_EARLY, StatusCode::TOO_MANY_REQUESTS];
        if status.is_client_error() && !is_for_now.contains(&status) {
            let error = Error::usage(format!("the server refuses, {status}: {told}"));
            return End::Failed(error.at(self.options.uri.to_string()));
        }
        End::Lost(format!("the server answers {status}: {told}"))
    }

    async fn receive(&mut self, mut socket: Socket) -> Result<std::convert::Infallible, End> {
        let mut ask = interval(ASK_EVERY);
        ask.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut last_activity = Instant::now();
        loop {
            tokio::select! {
                received = socket.next() => {
                    match received {
                        Some(Ok(message)) => {
                            if let Err(end) = self.pass_on(&message) {
                                let _ = timeout(FAREWELL, socket.close(None)).await;
                                return Err(end);
                            }
                        }
                        Some(Err(error)) => return Err(End::Lost(error.to_string())),
                        None => return Err(End::Lost("the server has gone".to_owned())),
                    }
                    // Delivering the list may have taken long.
                    last_activity = Instant::now();
                }
                _ = ask.tick() => {
                    if last_activity.elapsed() >= SILENCE_MAX {
                        return Err(End::Lost(format!("silent for {} s", SILENCE_MAX.as_secs())));
                    }
                    let ping = socket.send(SocketMessage::Ping(Bytes::new()));
                    match timeout(SILENCE_MAX, ping).await {
                        Ok(Ok(())) => {}
                        _ => return Err(End::Lost("the server takes nothing any more".to_owned())),
                    }
                }
            }
        }
    }

    fn pass_on(&mut self, message: &SocketMessage) -> Result<(), End> {
        let started = Instant::now();
        let decoded = match message {
            SocketMessage::Binary(bytes) if self.options.is_binary => {
                binary::decode(bytes, &mut self.message)
            }
            SocketMessage::Text(text) if !self.options.is_binary => {
                json::decode(text.as_bytes(), &mut self.message)
            }
            SocketMessage::Close(Some(frame)) => {
                return Err(End::Lost(format!(
                    "the server says {}: {}",
                    frame.code,
                    printable(&frame.reason)
                )));
            }
            _ => return Ok(()),
        };
        decoded.map_err(|error| End::Lost(format!("the server sent what is no list: it {error}")))?;
        self.metrics.time_ns.record(u64::try_from(started.elapsed().as_nanos()).unwrap_or(u64::MAX));
        self.metrics.frames.add(1);
        self.metrics.drops.add(self.message.delivery.lost);
        self.bytes.add(message.len() as u64);
        self.attempts.succeeded();
        match (self.deliver)(&self.message) {
            Ok(true) => Ok(()),
            Ok(false) => Err(End::Enough),
            Err(error) => Err(End::Failed(error)),
        }
    }
}

/// The first line of a text from outside, made safe for a terminal.
fn printable(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    line.chars().filter(|character| !character.is_control()).take(200).collect()
}

/// Waits until a shutdown is requested.
async fn requested(shutdown: &Shutdown) {
    while !shutdown.is_requested() {
        sleep(GLANCE).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_come_in_many_spellings() {
        let addresses: serde_json::Value =
            serde_json::from_str(include_str!("../../tests/clients/addresses.json")).unwrap();
        for pair in addresses["everyone takes"].as_array().unwrap() {
            let [url, expected] = [0, 1].map(|at| pair[at].as_str().unwrap());
            assert_eq!(ClientOptions::new(url).unwrap().uri.to_string(), expected);
        }
        for url in ["", "ftp://a", "ws://", "ws://a/ws?lights=3", "a b"] {
            assert!(ClientOptions::new(url).is_err(), "{url}");
        }
    }

    #[test]
    fn a_request_carries_what_is_wanted_and_hides_the_token() {
        let mut options = ClientOptions::new("localhost:7300").unwrap();
        options.subscription = Subscription { lights: Some(8), queue: 3, ..Subscription::default() };
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(&file, "secret-0123456789").unwrap();
        options.token = Some(Token::load(file.path()).unwrap());
        let request = options.request().unwrap();
        assert_eq!(request.uri(), "ws://localhost:7300/ws?lights=8&queue=3");
        assert_eq!(request.headers()[SEC_WEBSOCKET_PROTOCOL], wire::BINARY);
        assert_eq!(request.headers()[AUTHORIZATION], "Bearer secret-0123456789");
        for shown in [format!("{options:?}"), format!("{request:?}")] {
            assert!(!shown.contains("secret"), "{shown}");
        }
    }
}
