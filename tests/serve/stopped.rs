//! Readers that stop reading, and connections that never say what they want.

use crate::connection::{Posting, connect, get, wait_until};
use crate::recording::{Recording, lightcast};
use lightcast::net::ServerOptions;
use lightcast_core::image::{PolarMap, PolarShape};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::handshake::server::{Request, Response};

/// Time of a request, and its status.
fn timed(address: SocketAddr, path: &str) -> (Duration, u16) {
    let started = Instant::now();
    let status = get(address, path, &[]).0;
    (started.elapsed(), status)
}

const SOON: Duration = Duration::from_secs(2);

#[test]
fn a_reader_of_messages_that_has_stopped_holds_up_neither_server_nor_signals() {
    let recording = Recording::new(10);
    recording.configure("pace = \"real-time\"\nrepeat = true");
    let mut command = recording.command();
    // As many messages as possible.
    command.env("RUST_LOG", "trace").args(["--listen", "127.0.0.1:0"]);
    let mut child = command.stdout(Stdio::null()).spawn().unwrap();
    let mut messages = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("listening on http://") {
        line.clear();
        assert!(messages.read_line(&mut line).unwrap() > 0, "it has ended");
    }
    let address = line.split("http://").nth(1).unwrap().split('/').next().unwrap().parse().unwrap();
    let dropped = |address| {
        let text = get(address, "/metrics", &[]).1;
        let line = text.lines().find(|line| line.contains("stage_drops_total{stage=\"messages\"}")).unwrap();
        line.rsplit(' ').next().unwrap().parse::<u64>().unwrap()
    };
    let started = Instant::now();
    while dropped(address) == 0 {
        for _ in 0..20 {
            let mut request = format!("ws://{address}/ws").into_client_request().unwrap();
            request.headers_mut().insert("sec-websocket-protocol", "lightcast.v1.bin".parse().unwrap());
            connect(request, address).unwrap().read().unwrap();
        }
        assert!(started.elapsed() < Duration::from_secs(60), "no message is dropped");
    }
    let (time, status) = timed(address, "/readyz");
    assert!(status == 200 && time < SOON, "{status} after {time:?}");
    let signalled = Instant::now();
    let kill = Command::new("sh").args(["-c", &format!("kill -TERM {}", child.id())]).status();
    assert!(kill.unwrap().success());
    let code = child.wait().unwrap().code();
    println!("ended {:?} after the signal", signalled.elapsed());
    assert!(code == Some(0) && signalled.elapsed() < Duration::from_secs(10), "{code:?}");
    drop(messages);
}

#[test]
fn idle_connections_make_room_for_those_that_ask() {
    let posting = Posting::new(ServerOptions::default());
    posting.post(0..1);
    let idle: Vec<_> = (0..500).map(|_| TcpStream::connect(posting.address()).unwrap()).collect();
    for path in ["/healthz", "/lights", "/metrics"] {
        let (time, status) = timed(posting.address(), path);
        assert!(status == 200 && time < SOON, "{path}: {status} after {time:?} with {} idle", idle.len());
    }
    drop(idle);
}

/// As after a restart: all of them at once, more than there are places for requests.
#[test]
fn clients_that_all_come_at_once_all_get_in() {
    let posting = Posting::new(ServerOptions::default());
    posting.post(0..1);
    let request = format!(
        "GET /ws HTTP/1.1\r\nHost: {}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: lightcast.v1.bin\r\n\r\n",
        posting.address()
    );
    let come = || {
        let mut client = TcpStream::connect(posting.address()).unwrap();
        client.write_all(request.as_bytes()).unwrap();
        client
    };
    let mut clients: Vec<_> = (0..200).map(|_| come()).collect();
    for (number, client) in clients.iter_mut().enumerate() {
        let mut head = [0; 12];
        client.read_exact(&mut head).unwrap_or_else(|error| panic!("client {number}: {error}"));
        assert_eq!(&head, b"HTTP/1.1 101", "client {number}");
    }
}

#[test]
fn answers_that_nobody_takes_keep_nobody_from_others() {
    let posting = Posting::new(ServerOptions::default());
    posting.post(0..1);
    let mut map = PolarMap::black(PolarShape::hemisphere(1024, 512));
    // Values that no codec makes small.
    for (index, pixel) in map.pixels.iter_mut().enumerate() {
        let noise = (index as u32).wrapping_mul(2_654_435_761);
        *pixel = [noise as f32, (noise >> 3) as f32, (noise >> 7) as f32];
    }
    posting.board.post_map(&map);
    let ask = || {
        let mut stream = TcpStream::connect(posting.address()).unwrap();
        let request = format!("GET /map.exr HTTP/1.1\r\nHost: {}\r\n\r\n", posting.address());
        stream.write_all(request.as_bytes()).unwrap();
        stream
    };
    let first: Vec<_> = (0..64).map(|_| ask()).collect();
    let (time, status) = timed(posting.address(), "/healthz");
    assert!(status == 200 && time < SOON, "{status} after {time:?}");
    let more: Vec<_> = (0..6).map(|_| ask()).collect();
    let (time, status) = timed(posting.address(), "/readyz");
    assert!(status == 200 && time < SOON, "{status} after {time:?}");
    // Those that have taken nothing for a while leave when somebody else asks.
    let started = Instant::now();
    wait_until(|| get(posting.address(), "/lights", &[]).0 == 200);
    println!("another request is answered after {:?}", started.elapsed());
    drop((first, more));
}

#[test]
#[expect(clippy::result_large_err, reason = "what a handshake answers is the library's own type")]
fn watch_does_not_grow_under_a_server_that_pings_and_reads_nothing() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let mut watch = lightcast().args(["watch", &address]).stderr(Stdio::null()).spawn().unwrap();
    let answer = |_: &Request, mut response: Response| {
        response.headers_mut().insert("sec-websocket-protocol", "lightcast.v1.bin".parse().unwrap());
        Ok(response)
    };
    let stream = listener.accept().unwrap().0;
    let mut socket = tokio_tungstenite::tungstenite::accept_hdr(stream, answer).unwrap();
    let resident_kb = || {
        let status = std::fs::read_to_string(format!("/proc/{}/status", watch.id())).unwrap();
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap().to_owned();
        line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap()
    };
    // A megabyte of pings.
    let pings = [&[0x89, 125][..], &[7; 125]].concat().repeat(8_000);
    let mut told = Vec::new();
    // After some time it gives up a server that takes nothing.
    while told.len() < 48 && socket.get_mut().write_all(&pings).is_ok() {
        told.push(resident_kb());
    }
    println!("{told:?} kB after so many MB of pings");
    assert!(told.len() > 8 && told[told.len() - 1] < told[4] + 8192, "{told:?}");
    watch.kill().unwrap();
    watch.wait().unwrap();
}
