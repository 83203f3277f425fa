//! Misbehaving clients and servers.

use crate::connection::{LONG, Posting, close_code, connect, get, next_json, referenced, wait_until};
use lightcast::net::{Board, Client, ClientOptions, Server, ServerOptions, Token};
use lightcast::rt::{Metrics, Shutdown};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tokio_tungstenite::tungstenite::{self, Message};

const TOKEN: &str = "0123456789abcdefABCDEF";

fn with_token() -> ServerOptions {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("token");
    std::fs::write(&path, TOKEN).unwrap();
    ServerOptions { token: Some(Token::load(&path).unwrap()), ..ServerOptions::default() }
}

/// Checks that another client is served as if nothing had happened.
fn still_serves(posting: &Posting) {
    let mut client = posting.client("");
    posting.post(1000..1001);
    while next_json(&mut client)["sequence"] != 1000 {}
}

#[test]
fn a_client_that_dies_in_the_middle_of_a_message_frees_its_connection_slot() {
    let posting = Posting::new(ServerOptions::default());
    posting.post(0..1);
    let mut client = posting.client("");
    next_json(&mut client);
    // A masked text frame with a payload of 100 bytes, of which only 3 are sent.
    client.get_mut().write_all(&[0x81, 0x80 | 100, 1, 2, 3, 4, b'a', b'b', b'c']).unwrap();
    posting.wait_for_clients(1.0);
    drop(client);
    posting.wait_for_clients(0.0);
    still_serves(&posting);
}

#[test]
fn a_connection_whose_other_end_is_gone_without_a_word_is_given_up() {
    let patience = Duration::from_secs(2);
    let posting = Posting::new(ServerOptions { patience, ..ServerOptions::default() });
    // It never reads, so it answers no ping: to the server it looks like an unplugged cable.
    let dead = posting.client("");
    let mut living = posting.client("");
    posting.wait_for_clients(2.0);
    let started = Instant::now();
    let mut sequence = 0;
    while posting.metric("lightcast_clients") == 2.0 {
        assert!(started.elapsed() < LONG);
        posting.post(sequence..sequence + 1);
        next_json(&mut living);
        sequence += 1;
    }
    assert!(started.elapsed() >= patience / 2, "it was given up at once");
    let silent = "lightcast_stage_events_total{stage=\"serve\",event=\"clients that went silent\"}";
    assert_eq!(posting.metric(silent), 1.0);
    next_json(&mut posting.client(""));
    drop(dead);
}

#[test]
fn a_client_that_stops_reading_for_less_than_the_patience_stays() {
    let patience = Duration::from_secs(4);
    let posting = Posting::new(ServerOptions { patience, ..ServerOptions::default() });
    let mut client = posting.client("");
    posting.wait_for_clients(1.0);
    // Twice: the second time it has been silent for longer than the patience, although it has read in
    // between.
    for round in 0..2 {
        posting.post(1000 * round..1000 * round + 600);
        let started = Instant::now();
        while started.elapsed() < patience * 3 / 5 {
            posting.post(1000 * round + 600..1000 * round + 601);
            Shutdown::new().wait(Duration::from_millis(20));
        }
        posting.post(1000 * round + 700..1000 * round + 701);
        let mut last = 0;
        while last != 1000 * round + 700 {
            last = next_json(&mut client)["sequence"].as_u64().unwrap();
        }
    }
    assert_eq!(posting.metric("lightcast_clients"), 1.0);
}

#[test]
fn without_the_token_nobody_gets_in_and_nobody_learns_it() {
    let posting = Posting::new(with_token());
    let address = posting.address();
    for path in ["/ws", "/lights", "/map.png", "/map.exr", "/metrics"] {
        for headers in [&[][..], &[("Authorization", "Bearer 0123456789abcdefABCDEG")]] {
            let (status, body) = get(address, path, headers);
            assert_eq!(status, 401, "{path}");
            assert!(body.contains("a token is needed") && !body.contains(TOKEN), "{body}");
        }
    }
    for path in ["/healthz", "/readyz"] {
        assert_ne!(get(address, path, &[]).0, 401, "{path}");
    }
    let bearer = format!("Bearer {TOKEN}");
    assert_eq!(get(address, "/metrics", &[("Authorization", &bearer)]).0, 200);
    // As browsers do it: the token is one of the subprotocols, and not the one that is chosen.
    let request = posting.request("", &format!("lightcast.v1.json, lightcast.token.{TOKEN}"));
    let (_, response) = tungstenite::client(request, TcpStream::connect(address).unwrap()).unwrap();
    assert_eq!(response.headers()["sec-websocket-protocol"], "lightcast.v1.json");
    let wrong = posting.request("", "lightcast.v1.json, lightcast.token.0123456789abcdefABCDEG");
    assert!(connect(wrong, address).unwrap_err().to_string().contains("401"));
}

#[test]
fn pages_of_others_and_other_names_for_this_machine_are_refused() {
    let posting = Posting::new(ServerOptions::default());
    posting.post(0..1);
    let address = posting.address();
    for path in ["/ws", "/lights", "/healthz"] {
        assert_eq!(get(address, path, &[("Origin", "https://evil.example")]).0, 403, "{path}");
        assert_eq!(get(address, path, &[("Host", "evil.example")]).0, 403, "{path}");
    }
    let own = format!("http://{address}");
    assert_eq!(get(address, "/lights", &[("Origin", &own)]).0, 200);
    let mut request = posting.request("", "lightcast.v1.bin");
    request.headers_mut().insert("origin", "https://evil.example".parse().unwrap());
    assert!(connect(request, address).unwrap_err().to_string().contains("403"));
}

/// The head of the answer to these bytes.
fn answer(posting: &Posting, request: &str) -> String {
    let mut stream = TcpStream::connect(posting.address()).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer.split("\r\n\r\n").next().unwrap().to_owned()
}

#[test]
fn this_machine_has_more_than_one_spelling_and_a_request_one_host() {
    let posting = Posting::new(ServerOptions::default());
    let port = posting.address().port();
    for host in ["LOCALHOST", "localhost.", "LocalHost."] {
        assert_eq!(
            get(posting.address(), "/healthz", &[("Host", &format!("{host}:{port}"))]).0,
            200,
            "{host}"
        );
    }
    assert!(answer(&posting, "GET /healthz HTTP/1.0\r\n\r\n").starts_with("HTTP/1.0 200"));
    let two = format!("GET /healthz HTTP/1.1\r\nHost: localhost:{port}\r\nHost: evil.example\r\n\r\n");
    assert!(answer(&posting, &two).starts_with("HTTP/1.1 400"));
    let https = format!("https://localhost:{port}");
    let own = [("Host", &*format!("localhost:{port}")), ("Origin", &https)];
    assert_eq!(get(posting.address(), "/healthz", &own).0, 403, "the scheme of an origin counts");
}

#[test]
fn an_origin_that_is_allowed_lets_nobody_else_embed() {
    let origins = vec!["https://studio.example".to_owned()];
    let posting = Posting::new(ServerOptions { origins, ..ServerOptions::default() });
    let ask = |more: &str| {
        answer(&posting, &format!("GET /healthz HTTP/1.1\r\nHost: {}\r\n{more}\r\n", posting.address()))
    };
    assert!(ask("").contains("cross-origin-resource-policy: same-origin"));
    assert!(ask("Referer: https://evil.example/\r\n").contains("cross-origin-resource-policy: same-origin"));
    assert!(
        ask("Referer: https://studio.example/\r\n").contains("cross-origin-resource-policy: cross-origin")
    );
}

#[test]
fn a_message_of_ten_megabytes_is_refused_before_it_is_read() {
    let posting = Posting::new(ServerOptions::default());
    let mut client = posting.client("");
    // The length in its header is enough: 10 MB of masked text. The rest may no longer be read.
    client.get_mut().write_all(&[0x81, 0x80 | 127, 0, 0, 0, 0, 0, 0x98, 0x96, 0x80, 1, 2, 3, 4]).unwrap();
    let _ = client.get_mut().write_all(&vec![b'a'; 100_000]);
    assert_eq!(close_code(&mut client), 1009);
    posting.wait_for_clients(0.0);
    still_serves(&posting);
}

#[test]
fn bytes_that_are_no_frame_and_frames_that_are_no_text_end_the_session() {
    let posting = Posting::new(ServerOptions::default());
    let mut client = posting.client("");
    client.send(Message::binary(vec![0xff; 64])).unwrap();
    assert_eq!(close_code(&mut client), 1003);
    let mut client = posting.client("");
    client.get_mut().write_all(&[0xff; 64]).unwrap();
    assert_eq!(close_code(&mut client), 1002);
    let mut client = posting.client("");
    client.send(Message::text("{\"subscribe\":")).unwrap();
    assert!(next_json(&mut client)["error"].as_str().unwrap().contains("is no subscription"));
    posting.post(0..1);
    assert_eq!(next_json(&mut client)["sequence"], 0, "a mistake in text is told, no more");
    still_serves(&posting);
}

#[test]
fn a_flood_of_subscriptions_ends_the_session() {
    let posting = Posting::new(ServerOptions::default());
    let mut client = posting.client("");
    for lights in 1..100 {
        // The server may have closed its end before all are sent.
        if client.send(Message::text(format!("{{\"subscribe\":{{\"lights\":{lights}}}}}"))).is_err() {
            break;
        }
    }
    assert_eq!(close_code(&mut client), 1008);
    posting.wait_for_clients(0.0);
    still_serves(&posting);
}

#[test]
fn a_message_of_endless_empty_frames_is_a_flood() {
    let posting = Posting::new(ServerOptions::default());
    let mut client = posting.client("");
    // The first part of a text, and empty parts that go on with it.
    client.get_mut().write_all(&[0x01, 0x81, 0, 0, 0, 0, b'{']).unwrap();
    let part = [0x00, 0x80, 1, 2, 3, 4].repeat(100);
    for _ in 0..10 {
        let _ = client.get_mut().write_all(&part);
    }
    assert_eq!(close_code(&mut client), 1008);
    posting.wait_for_clients(0.0);
    let floods =
        "lightcast_stage_events_total{stage=\"serve\",event=\"clients that sent too many messages\"}";
    assert_eq!(posting.metric(floods), 1.0);
    still_serves(&posting);
}

#[test]
fn a_port_in_use_is_told_with_what_to_do() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let board = Arc::new(Board::default());
    let start = |address: &str| {
        Server::start(address, &board, ServerOptions::default(), &Shutdown::new()).err().unwrap()
    };
    let error = start(&address).to_string();
    assert!(error.contains(&address) && error.contains("is another program there?"), "{error}");
    for wrong in ["127.0.0.1", "7300", "localhost:http:", "", "256.0.0.1:80"] {
        let error = start(wrong).to_string();
        assert!(error.contains("is no HOST:PORT"), "{wrong}: {error}");
    }
}

#[test]
fn what_is_asked_for_wrongly_is_told() {
    let posting = Posting::new(ServerOptions::default());
    let address = posting.address();
    assert_eq!(get(address, "/lights", &[]).0, 503, "no list yet");
    assert_eq!(get(address, "/readyz", &[]).0, 503);
    assert_eq!(get(address, "/map.png", &[]).0, 503);
    assert_eq!(get(address, "/nothing", &[]).0, 404);
    let (status, body) = get(address, "/lights?lights=-1", &[]);
    assert!(status == 400 && body.contains("the query is no subscription"), "{status} {body}");
    for (query, protocol) in [("lihgts=3", "lightcast.v1.json"), ("", "lightcast.v9.json")] {
        let error = connect(posting.request(query, protocol), address).unwrap_err();
        assert!(error.to_string().contains("400"), "{error}");
    }
    posting.post(0..1);
    assert_eq!(get(address, "/readyz", &[]), (200, "lists flow\n".to_owned()));
}

#[test]
fn more_clients_than_connection_slots_are_sent_away() {
    let posting = Posting::new(ServerOptions { clients_max: 2, ..ServerOptions::default() });
    let first = posting.client("");
    let _second = posting.client("");
    let third = || connect(posting.request("", "lightcast.v1.json"), posting.address());
    assert!(third().unwrap_err().to_string().contains("503"));
    drop(first);
    posting.wait_for_clients(1.0);
    third().unwrap();
}

#[test]
fn half_a_request_is_not_waited_for() {
    let posting = Posting::new(ServerOptions::default());
    let mut stream = TcpStream::connect(posting.address()).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    stream.write_all(b"GET /lights HTTP/1.1\r\nHost: local").unwrap();
    let started = Instant::now();
    let mut rest = Vec::new();
    let _ = stream.read_to_end(&mut rest);
    assert!(started.elapsed() < LONG, "the connection is still open");
}

/// A server that accepts WebSockets, sends each client `message`, and counts them.
#[expect(clippy::result_large_err, reason = "what a handshake answers is the library's own type")]
fn wrong_server(message: Message) -> (String, Arc<AtomicU64>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let accepted = Arc::new(AtomicU64::new(0));
    let count = accepted.clone();
    let serve = move || {
        for stream in listener.incoming() {
            let answer = |_: &_, mut response: tungstenite::handshake::server::Response| {
                response.headers_mut().insert("sec-websocket-protocol", "lightcast.v1.bin".parse().unwrap());
                Ok(response)
            };
            let Ok(mut socket) = tungstenite::accept_hdr(stream.unwrap(), answer) else { continue };
            let _ = socket.send(message.clone());
            count.fetch_add(1, Ordering::SeqCst);
        }
    };
    std::thread::Builder::new().name("wrong server".into()).spawn(serve).unwrap();
    (address, accepted)
}

#[test]
fn a_client_survives_a_server_that_sends_nonsense_and_comes_again() {
    for message in [
        Message::binary(vec![0xff; 500]),
        Message::binary(Vec::new()),
        Message::binary(b"LCL\x02 of another version".to_vec()),
        Message::text("{}"),
    ] {
        let is_ignored = matches!(message, Message::Text(_));
        let (address, accepted) = wrong_server(message);
        let (metrics, shutdown) = (Metrics::new("client"), Shutdown::new());
        let options = ClientOptions::new(&address).unwrap();
        let client = Client::start(options, &metrics, &shutdown, |_| Ok(true)).unwrap();
        wait_until(|| accepted.load(Ordering::SeqCst) >= 3);
        shutdown.request();
        client.join(Duration::from_millis(5), || ()).unwrap();
        assert!(metrics.counter("connections lost").get() >= 2, "{is_ignored}");
        assert_eq!(metrics.frames.get(), 0);
    }
}

#[test]
fn a_client_that_is_refused_ends_with_the_reason() {
    let posting = Posting::new(with_token());
    let options = ClientOptions::new(&posting.address().to_string()).unwrap();
    let client = Client::start(options, &Metrics::new("client"), &Shutdown::new(), |_| Ok(true)).unwrap();
    let error = client.join(Duration::from_millis(5), || ()).unwrap_err().to_string();
    assert!(error.contains("401") && error.contains("a token is needed"), "{error}");
}

#[test]
fn a_client_waits_for_a_server_that_is_not_there_yet_and_ends_when_asked() {
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let shutdown = Shutdown::new();
    let options = ClientOptions::new(&address).unwrap();
    let client = Client::start(options, &Metrics::new("client"), &shutdown, |_| Ok(false)).unwrap();
    shutdown.wait(Duration::from_millis(100));
    let board = Arc::new(Board::default());
    let server = Server::start(&address, &board, ServerOptions::default(), &shutdown).unwrap();
    board.post(&referenced(crate::connection::list(0, 8)), &lightcast::rt::CaptureEpoch::default());
    client.join(Duration::from_millis(5), || ()).unwrap();
    server.stop().unwrap();
}
