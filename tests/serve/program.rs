//! `run --listen` and `watch` as their users start them.

use crate::connection::{LONG, connect, get, next_json, wait_until};
use crate::recording::{Recording, lightcast, lists};
use lightcast::config::Config;
use lightcast::net::{Board, Client, ClientOptions, Server, ServerOptions};
use lightcast::rt::{Metrics, Shutdown};
use lightcast::service::{Ends, Output, Service};
use lightcast::wire::{Message, Subscription, binary, read_list, write_list};
use std::io::{self, BufRead, BufReader, Write};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

/// A program that was started with `--listen`, and its messages.
pub struct Running {
    pub child: Child,
    pub address: SocketAddr,
    /// Its messages so far; a thread keeps reading, so that the program can keep writing.
    said: Arc<Mutex<String>>,
    reader: Option<JoinHandle<()>>,
    /// Number of bytes of them that were examined.
    seen: usize,
}

impl Running {
    pub fn start(command: &mut Command) -> Self {
        let mut child = command.stdout(Stdio::null()).spawn().unwrap();
        let (said, messages) = (Arc::new(Mutex::new(String::new())), child.stderr.take().unwrap());
        let heard = said.clone();
        let listen = move || {
            for line in BufReader::new(messages).lines() {
                let mut heard = heard.lock().unwrap();
                heard.push_str(&line.unwrap());
                heard.push('\n');
            }
        };
        let reader = std::thread::Builder::new().name("messages".into()).spawn(listen).unwrap();
        let address = "127.0.0.1:0".parse().unwrap();
        let mut running = Self { child, address, said, reader: Some(reader), seen: 0 };
        let line = running.wait_for("listening on http://");
        let (_, rest) = line.split_once("http://").unwrap();
        running.address = rest.split('/').next().unwrap().parse().unwrap();
        running
    }

    /// Its messages so far.
    pub fn said(&self) -> String {
        self.said.lock().unwrap().clone()
    }

    /// Waits for the next line that contains `text`.
    #[track_caller]
    pub fn wait_for(&mut self, text: &str) -> String {
        let mut found = None;
        wait_until(|| {
            let said = self.said.lock().unwrap();
            while let Some(end) = said[self.seen..].find('\n') {
                let line = &said[self.seen..self.seen + end];
                self.seen += end + 1;
                if line.contains(text) {
                    found = Some(line.to_owned());
                    return true;
                }
            }
            let has_ended = self.reader.as_ref().is_none_or(JoinHandle::is_finished);
            assert!(!has_ended || self.seen < said.len(), "it ended without '{text}'; it said\n{said}");
            false
        });
        found.unwrap()
    }

    pub fn signal(&self, signal: &str) {
        let status = Command::new("sh").args(["-c", &format!("kill -{signal} {}", self.child.id())]).status();
        assert!(status.unwrap().success());
    }

    /// Ends it; returns its messages.
    pub fn end(mut self) -> String {
        self.signal("TERM");
        let code = self.child.wait().unwrap().code();
        self.reader.take().unwrap().join().unwrap();
        assert_eq!(code, Some(0), "{}", self.said());
        self.said()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // This is needed only where a test has failed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A writer whose contents others can read.
#[derive(Clone, Default)]
struct Shared(Arc<Mutex<Vec<u8>>>);

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The bundled sequence, as written by the service and as received by a client that was connected before the
/// first list.
fn whole_recording(is_binary: bool) -> (Vec<String>, Vec<Message>) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut config = Config::load(&root.join("config/replay.toml")).unwrap();
    config.pace = lightcast::config::Pace::RealTime;
    let (board, shutdown) = (Arc::new(Board::default()), Shutdown::new());
    let server = Server::start("127.0.0.1:0", &board, ServerOptions::default(), &shutdown).unwrap();
    let mut options = ClientOptions::new(&server.address().to_string()).unwrap();
    options.is_binary = is_binary;
    options.subscription = Subscription { queue: 64, ..Subscription::default() };
    let taken = Arc::new(Mutex::new(Vec::new()));
    let kept = taken.clone();
    let client = Client::start(options, &Metrics::new("client"), &shutdown, move |message| {
        let mut kept = kept.lock().unwrap();
        kept.push(message.clone());
        Ok(kept.len() < 100)
    });
    wait_until(|| get(server.address(), "/metrics", &[]).1.contains("\nlightcast_clients 1"));
    let written = Shared::default();
    let writer = written.clone();
    let ends = Ends { board: Some(board), output: Some(Output::new("memory", writer)), ..Ends::default() };
    let service = Service::start(&config, ends, &Shutdown::new()).unwrap();
    service.join(Duration::from_millis(10), || ()).unwrap();
    server.stop().unwrap();
    shutdown.request();
    client.unwrap().join(Duration::from_millis(10), || ()).unwrap();
    let text = String::from_utf8(written.0.lock().unwrap().clone()).unwrap();
    let messages = std::mem::take(&mut *taken.lock().unwrap());
    (text.lines().map(str::to_owned).collect(), messages)
}

#[test]
fn over_a_whole_recording_a_client_gets_what_the_service_writes() {
    let (lines, messages) = whole_recording(false);
    assert_eq!((lines.len(), messages.len()), (100, 100));
    let mut last_ns = 0;
    for (line, message) in lines.iter().zip(&messages) {
        let mut got = Vec::new();
        write_list(&message.list, &mut got).unwrap();
        assert_eq!(*line, String::from_utf8(got).unwrap());
        let delivery = message.delivery;
        let age_ns = delivery.sent_monotonic_ns - delivery.capture_monotonic_ns.unwrap();
        assert!(delivery.lost == 0 && (0..10_000_000_000).contains(&age_ns), "{delivery:?}");
        assert!(delivery.sent_monotonic_ns > last_ns);
        last_ns = delivery.sent_monotonic_ns;
    }
}

#[test]
fn as_bytes_every_list_of_a_recording_is_within_the_stated_precision() {
    let (lines, messages) = whole_recording(true);
    assert_eq!((lines.len(), messages.len()), (100, 100));
    for (line, message) in lines.iter().zip(&messages) {
        let mut exact = lightcast_core::light::LightList::default();
        read_list(line.as_bytes(), &mut exact).unwrap();
        let got = &message.list;
        assert_eq!((got.stamp, got.power, got.error), (exact.stamp, exact.power, exact.error));
        assert_eq!((&got.prefix_errors, got.lights.len()), (&exact.prefix_errors, exact.lights.len()));
        for (got, exact) in got.lights.iter().zip(&exact.lights) {
            assert_eq!(got.id, exact.id);
            let cross = glam::Vec3::from(got.direction)
                .as_dvec3()
                .cross(glam::Vec3::from(exact.direction).as_dvec3());
            assert!(cross.length().asin().to_degrees() < 0.01, "{got:?} {exact:?}");
            for (got, exact) in got.irradiance.into_iter().zip(exact.irradiance) {
                assert!((got - exact).abs() <= 1e-3 * exact, "{got} {exact}");
            }
            assert!((got.spread_rad - exact.spread_rad).abs() <= 0.05 * exact.spread_rad);
        }
        let mut body = Vec::new();
        binary::encode_list(&exact, &mut body).unwrap();
        assert!(body.len() <= 150 + 8 * exact.prefix_errors.len() + 14 * exact.lights.len());
    }
}

#[test]
fn watch_records_what_run_writes_and_tells_what_it_saw() {
    let recording = Recording::new(40);
    recording.configure("pace = \"real-time\"\nrepeat = true");
    let written = recording.path().join("run.jsonl");
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0", "--output"]).arg(&written);
    let running = Running::start(&mut command);
    let recorded = recording.path().join("watch.jsonl");
    let watch = lightcast()
        .args(["watch", &running.address.to_string(), "--record"])
        .arg(&recorded)
        .args(["--json", "--count", "20"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&watch.stderr).into_owned();
    assert_eq!(watch.status.code(), Some(0), "{said}");
    let summary = running.end();
    let (run, got) = (std::fs::read(&written).unwrap(), std::fs::read(&recorded).unwrap());
    assert_eq!(lists(&got).len(), 20);
    assert_eq!(watch.stdout, got, "--json prints what --record writes");
    let at = run.windows(got.len()).position(|part| part == got);
    assert!(at.is_some(), "20 lines of the run, one after the other");
    assert!(said.contains("connected to ws://") && said.contains("client "), "{said}");
    let peer = summary.lines().find(|line| line.contains("a client has left")).unwrap();
    assert!(peer.contains("peer=127.0.0.1:") && peer.contains("lists_lost=0"), "{peer}");
}

#[test]
fn watch_without_more_prints_a_line_a_second() {
    let recording = Recording::new(60);
    recording.configure("pace = \"real-time\"\nrepeat = true");
    let mut command = recording.command();
    let running = Running::start(command.args(["--listen", "127.0.0.1:0"]));
    let url = format!("http://{}/", running.address);
    let watch = lightcast()
        .args(["watch", &url, "--lights", "5", "--queue", "64", "--count", "55"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&watch.stderr);
    let is_line = |line: &str| {
        line.starts_with("sequence ") && line.contains("     5 lights") && line.ends_with(" 0 lost")
    };
    assert!(watch.stdout.is_empty() && said.lines().any(is_line), "{said}");
    running.end();
}

#[test]
fn the_token_stands_in_no_message() {
    let recording = Recording::new(10);
    recording.configure("pace = \"real-time\"\nrepeat = true");
    let token = "0123456789abcdef0123";
    let file = recording.path().join("token");
    std::fs::write(&file, token).unwrap();
    let text = std::fs::read_to_string(recording.configuration()).unwrap();
    std::fs::write(recording.configuration(), text + "\n[server]\ntoken_file = \"token\"\n").unwrap();
    let mut command = recording.command();
    command.env("RUST_LOG", "trace").args(["--listen", "127.0.0.1:0", "--log-format", "json"]);
    let running = Running::start(&mut command);
    let url = running.address.to_string();
    let watch = |more: &[&str]| {
        let watch =
            lightcast().env("RUST_LOG", "trace").args(["watch", &url, "--count", "3"]).args(more).output();
        let watch = watch.unwrap();
        (watch.status.code(), String::from_utf8(watch.stderr).unwrap())
    };
    let (code, refused) = watch(&[]);
    assert!(code == Some(2) && refused.contains("401"), "{code:?} {refused}");
    // The token as browsers send it, among the subprotocols.
    let mut request = format!("ws://{url}/ws").into_client_request().unwrap();
    let protocols = format!("lightcast.v1.json, lightcast.token.{token}");
    request.headers_mut().insert("sec-websocket-protocol", protocols.parse().unwrap());
    next_json(&mut connect(request, running.address).unwrap());
    let (code, let_in) = watch(&["--token-file", file.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{let_in}");
    let said = running.end();
    assert!(!said.contains(token) && !refused.contains(token) && !let_in.contains(token));
    // The summary follows the messages.
    let messages: Vec<&str> = said.lines().take_while(|line| line.starts_with('{')).collect();
    assert!(messages.iter().any(|line| line.contains("a client has come")), "no messages: {said}");
    for line in messages {
        let message: serde_json::Value = serde_json::from_str(line).unwrap();
        assert!(message["timestamp"].is_string() && message["level"].is_string(), "{line}");
    }
}

#[test]
fn a_run_that_cannot_listen_says_so_and_does_not_start() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let recording = Recording::new(2);
    let output = recording.path().join("lists.jsonl");
    let mut command = recording.command();
    command.args(["--listen", &taken.local_addr().unwrap().to_string(), "--output"]).arg(&output);
    let started = Instant::now();
    let ended = command.output().unwrap();
    assert_eq!(ended.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&ended.stderr).contains("is another program there?"));
    assert!(!output.exists() && started.elapsed() < LONG);
}

/// A second machine lights its own scene with the stream: the picture is the same as from the list in a file.
#[cfg(feature = "render")]
#[test]
fn watch_renders_what_a_file_of_the_same_list_gives() {
    let posting = crate::connection::Posting::new(ServerOptions::default());
    posting.post(3..4);
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut line = Vec::new();
    lightcast::wire::write_list_line(&crate::connection::list(3, 100), &mut line).unwrap();
    std::fs::write(at("list.jsonl"), line).unwrap();
    let options = ["--size", "48x36", "--samples", "1", "--output"];
    let mut render = lightcast();
    let rendered =
        render.arg("render").arg(at("list.jsonl")).args(options).arg(at("file.exr")).output().unwrap();
    let said = String::from_utf8_lossy(&rendered.stderr).into_owned();
    if said.contains("there is no graphics adapter") {
        // Not eprintln!, which the test harness swallows when a test passes.
        let _ = writeln!(io::stderr(), "skipped: watch --render: there is no graphics adapter");
        return;
    }
    assert!(rendered.status.success(), "{said}");
    let mut watch = lightcast();
    watch.args(["watch", &posting.address().to_string(), "--format", "json", "--render"]);
    let watched = watch.args(options).arg(at("stream.exr")).output().unwrap();
    assert!(watched.status.success(), "{}", String::from_utf8_lossy(&watched.stderr));
    let bytes = |name: &str| std::fs::read(at(name)).unwrap();
    assert!(bytes("stream.exr").len() > 1000 && bytes("stream.exr") == bytes("file.exr"));
}
