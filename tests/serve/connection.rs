//! A server in this process, and connections to it.

use lightcast::net::{Board, Server, ServerOptions};
use lightcast::rt::{CaptureEpoch, Shutdown};
use lightcast_core::image::Stamp;
use lightcast_core::light::ReferencedList;
use lightcast_core::light::{Light, LightList};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::handshake::client::Request;
use tokio_tungstenite::tungstenite::{self, Message, WebSocket};

/// Longer than anything takes on localhost.
pub const LONG: Duration = Duration::from_secs(20);

/// A server whose lists are posted by the test.
pub struct Posting {
    pub board: Arc<Board>,
    server: Server,
    epoch: CaptureEpoch,
}

impl Posting {
    pub fn new(options: ServerOptions) -> Self {
        let board = Arc::new(Board::default());
        let server = Server::start("127.0.0.1:0", &board, options, &Shutdown::new()).unwrap();
        let epoch = CaptureEpoch::default();
        epoch.set(0);
        Self { board, server, epoch }
    }

    pub fn address(&self) -> SocketAddr {
        self.server.address()
    }

    pub fn server(&self) -> &Server {
        &self.server
    }

    pub fn stop(self) {
        self.server.stop().unwrap();
    }

    /// Posts lists of these sequence numbers, with 100 lights each.
    pub fn post(&self, sequences: std::ops::Range<u64>) {
        for sequence in sequences {
            self.post_list(list(sequence, 100));
        }
    }

    pub fn post_list(&self, list: LightList) {
        self.board.post(&referenced(list), &self.epoch);
    }

    /// A client of JSON lists with this query.
    pub fn client(&self, query: &str) -> WebSocket<TcpStream> {
        connect(self.request(query, "lightcast.v1.json"), self.address()).unwrap()
    }

    pub fn request(&self, query: &str, protocol: &str) -> Request {
        let mut request = format!("ws://{}/ws?{query}", self.address()).into_client_request().unwrap();
        request.headers_mut().insert("sec-websocket-protocol", protocol.parse().unwrap());
        request
    }

    /// The value in `/metrics` for this name and these labels.
    pub fn metric(&self, name: &str) -> f64 {
        let (_, body) = get(self.address(), "/metrics", &[]);
        let line = body.lines().find(|line| line.starts_with(name) && line[name.len()..].starts_with(' '));
        line.unwrap_or_else(|| panic!("no {name} in\n{body}")).rsplit(' ').next().unwrap().parse().unwrap()
    }

    /// Waits until that many clients are connected.
    #[track_caller]
    pub fn wait_for_clients(&self, count: f64) {
        wait_until(|| self.metric("lightcast_clients") == count);
    }
}

#[track_caller]
pub fn wait_until(mut is_so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < LONG, "waited in vain");
        Shutdown::new().wait(Duration::from_millis(5));
    }
}

pub fn list(sequence: u64, count: u32) -> LightList {
    let mut list = LightList::default();
    list.stamp = Stamp {
        sequence,
        capture_time_ns: 40_000_000 * sequence as i64,
        frame_rate_hz: 25.0,
        ..Stamp::default()
    };
    list.lights = (0..count)
        .map(|id| {
            let phi = 0.1 * id as f32 + 0.01 * sequence as f32;
            let y = (id as f32 + 0.5) / count as f32;
            let radius = (1.0 - y * y).sqrt();
            let direction = [radius * phi.cos(), y, radius * phi.sin()];
            Light { id, direction, irradiance: [0.1 + id as f32, 1.0, 0.3], spread_rad: 0.1 }
        })
        .collect();
    list.power = list.sum_of_lights();
    list.prefix_errors = vec![(8, 0.1), (16, 0.04), (32, 0.015), (64, 0.004), (count, 0.001)];
    list.error = Some(0.001);
    list
}

/// A list in the form in which a service posts it.
pub fn referenced(list: LightList) -> ReferencedList {
    ReferencedList { list, ..ReferencedList::default() }
}

pub fn connect(request: Request, address: SocketAddr) -> Result<WebSocket<TcpStream>, tungstenite::Error> {
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    match tungstenite::client(request, stream) {
        Ok((socket, _)) => Ok(socket),
        Err(tungstenite::HandshakeError::Failure(error)) => Err(error),
        Err(tungstenite::HandshakeError::Interrupted(_)) => panic!("no answer"),
    }
}

/// The next message with a list, or with an answer.
pub fn next_json(socket: &mut WebSocket<TcpStream>) -> serde_json::Value {
    loop {
        if let Message::Text(text) = socket.read().unwrap() {
            return serde_json::from_str(&text).unwrap();
        }
    }
}

/// Reads until the server closes; returns the close code.
pub fn close_code(socket: &mut WebSocket<TcpStream>) -> u16 {
    loop {
        match socket.read() {
            Ok(Message::Close(Some(frame))) => return frame.code.into(),
            Ok(_) => {}
            Err(error) => panic!("closed without a word: {error}"),
        }
    }
}

/// Status and body of a request.
pub fn get(address: SocketAddr, path: &str, headers: &[(&str, &str)]) -> (u16, String) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    let mut head = format!("GET {path} HTTP/1.1\r\nConnection: close\r\n");
    if !headers.iter().any(|(name, _)| *name == "Host") {
        head += &format!("Host: {address}\r\n");
    }
    for (name, value) in headers {
        head += &format!("{name}: {value}\r\n");
    }
    stream.write_all((head + "\r\n").as_bytes()).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let answer = String::from_utf8_lossy(&answer).into_owned();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_owned())
}
