//! Clients of all kinds come and go while a replay loops: memory, file handles and threads of the service
//! must stay constant. The test runs thirty rounds, or as many seconds as `LIGHTCAST_SOAK_S` gives; `make
//! soak-clients` runs for an hour.

use crate::connection::{connect, get, wait_until};
use crate::program::Running;
use std::fs;
use std::io::Write;
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::{Message, WebSocket};

/// Rounds until every kind of client has connected, and the number of idle clients has reached its maximum.
const WARM_ROUNDS: u64 = 10;
const LEAST_ROUNDS: u64 = 30;

/// Resources of a process.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Holdings {
    resident_kb: u64,
    threads: u64,
    files: usize,
}

fn holdings(running: &Running) -> Holdings {
    let folder = format!("/proc/{}", running.child.id());
    let status = fs::read_to_string(format!("{folder}/status")).unwrap();
    let value = |key: &str| -> u64 {
        let line = status.lines().find(|line| line.starts_with(key)).unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    };
    Holdings {
        resident_kb: value("VmRSS:"),
        threads: value("Threads:"),
        files: fs::read_dir(format!("{folder}/fd")).unwrap().count(),
    }
}

fn stream(running: &Running, query: &str, protocol: &str) -> WebSocket<TcpStream> {
    let mut request = format!("ws://{}/ws?{query}", running.address).into_client_request().unwrap();
    request.headers_mut().insert("sec-websocket-protocol", protocol.parse().unwrap());
    connect(request, running.address).unwrap()
}

/// Connects one client of each kind; those in `idle` stay connected for a while without reading.
fn visit(running: &Running, round: u64, idle: &mut Vec<WebSocket<TcpStream>>) {
    let (json, binary) = ("lightcast.v1.json", "lightcast.v1.bin");
    for query in ["", "lights=16", "error=0.01&rate_hz=12", "queue=64"] {
        let protocol = if round.is_multiple_of(2) { json } else { binary };
        let mut client = stream(running, query, protocol);
        for _ in 0..3 {
            client.read().unwrap();
        }
        client.send(Message::text("{\"subscribe\":{\"lights\":3}}")).unwrap();
        client.read().unwrap();
        client.close(None).unwrap();
        while client.read().is_ok() {}
    }
    let mut killed = stream(running, "", json);
    killed.read().unwrap();
    killed.get_mut().write_all(&[0x81, 0x80 | 50, 1, 2, 3]).unwrap();
    drop(killed);
    let mut wrong = stream(running, "", json);
    wrong.send(Message::binary(vec![7; 100])).unwrap();
    drop(wrong);
    for path in ["/map.png", "/map.exr", "/lights?lights=5", "/metrics", "/nothing", "/lights?x=1"] {
        get(running.address, path, &[]);
    }
    get(running.address, "/lights", &[("Origin", "https://evil.example")]);
    let mut half = TcpStream::connect(running.address).unwrap();
    half.write_all(b"GET /map.png HT").unwrap();
    drop(half);
    idle.push(stream(running, "", binary));
    if idle.len() > 4 {
        idle.remove(0);
    }
}

#[test]
fn clients_that_come_and_go_leave_nothing_behind() {
    let seconds = std::env::var("LIGHTCAST_SOAK_S").ok().map_or(0, |text| text.parse().unwrap());
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut command = crate::recording::lightcast();
    command.args(["run", "--listen", "127.0.0.1:0", "--config"]).arg(root.join("config/stream.toml"));
    let running = Running::start(&mut command);
    wait_until(|| get(running.address, "/readyz", &[]).0 == 200);
    let started = Instant::now();
    let (mut idle, mut round, mut first, mut told) = (Vec::new(), 0, None, 0);
    while started.elapsed() < Duration::from_secs(seconds) || round < LEAST_ROUNDS {
        visit(&running, round, &mut idle);
        round += 1;
        if round >= WARM_ROUNDS {
            let now = holdings(&running);
            first.get_or_insert(now);
            let minutes = started.elapsed().as_secs() / 60;
            if minutes > told {
                told = minutes;
                println!("{told:>4} min  {round:>7} rounds  {now:?}");
            }
        }
    }
    idle.clear();
    wait_until(|| get(running.address, "/metrics", &[]).1.contains("\nlightcast_clients 0"));
    let first = first.unwrap();
    let mut last = holdings(&running);
    // Clients that come and go have open files at times; after all have disconnected, only the listener and
    // the initial files remain.
    wait_until(|| {
        last = holdings(&running);
        last.files <= first.files
    });
    println!("{round} rounds: {first:?} after {WARM_ROUNDS}, {last:?} in the end");
    assert!(last.threads <= first.threads + 2, "two threads at most encode maps");
    let most_kb = first.resident_kb + 4096;
    assert!(last.resident_kb <= most_kb, "{} kB, were {} kB", last.resident_kb, first.resident_kb);
    running.end();
}
