//! Requirements of a service that runs for weeks: reloading its configuration, notifications to systemd, no
//! growth.

use crate::connection::{connect, get, next_json, wait_until};
use crate::program::Running;
use crate::recording::Recording;
use std::fs;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::path::Path;
use std::time::Duration;
use tokio_tungstenite::tungstenite::WebSocket;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

fn endless() -> Recording {
    let recording = Recording::new(10);
    recording.configure("pace = \"real-time\"\nrepeat = true");
    recording
}

fn client(running: &Running) -> WebSocket<std::net::TcpStream> {
    client_with(running, "")
}

fn client_with(running: &Running, query: &str) -> WebSocket<std::net::TcpStream> {
    let mut request = format!("ws://{}/ws?{query}", running.address).into_client_request().unwrap();
    request.headers_mut().insert("sec-websocket-protocol", "lightcast.v1.json".parse().unwrap());
    connect(request, running.address).unwrap()
}

fn light_count(socket: &mut WebSocket<std::net::TcpStream>) -> usize {
    next_json(socket)["lights"].as_array().unwrap().len()
}

#[test]
fn sighup_takes_a_good_configuration_and_clients_stay() {
    let recording = endless();
    let output = recording.path().join("lists.jsonl");
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0", "--output"]).arg(&output);
    // Files of others in the folder are not touched.
    let recorded = |name: &str| recording.path().join(name);
    fs::create_dir(recorded("frames-2")).unwrap();
    command.arg("--record").arg(recorded("frames"));
    let mut running = Running::start(&mut command);
    let mut socket = client(&running);
    assert_eq!(light_count(&mut socket), 24);
    let text = fs::read_to_string(recording.configuration()).unwrap();
    for bad in [
        text.replace("count = 24", "count = 0"),
        text.replace("count = 24", "cuont = 12"),
        text.replace("sky.####.exr", "none.####.exr"),
        text.clone() + "[server]\ntoken_file = \"none\"\n",
    ] {
        fs::write(recording.configuration(), bad).unwrap();
        running.signal("HUP");
        let told = running.wait_for("the configuration is not taken, the old one stays");
        assert!(told.contains("run.toml") || told.contains("none"), "{told}");
        assert_eq!(light_count(&mut socket), 24);
    }
    fs::write(recording.configuration(), text.replace("count = 24", "count = 12")).unwrap();
    running.signal("HUP");
    running.wait_for("taken anew");
    wait_until(|| light_count(&mut socket) == 12);
    assert_eq!(get(running.address, "/readyz", &[]).0, 200);
    running.end();
    for (name, is_recording) in
        [("frames", true), ("frames-2", false), ("frames-3", true), ("frames-4", false)]
    {
        assert_eq!(recorded(name).join("recording.json").exists(), is_recording, "{name}");
    }
    let lines = fs::read_to_string(&output).unwrap();
    let counts: Vec<usize> = lines.lines().map(|line| line.matches("\"id\"").count()).collect();
    assert!(counts.contains(&24) && counts.ends_with(&[12]), "one file for both: {counts:?}");
}

/// The next notification of a service to systemd.
fn told(socket: &UnixDatagram) -> Option<String> {
    let mut bytes = [0; 4096];
    let length = socket.recv(&mut bytes).ok()?;
    Some(String::from_utf8_lossy(&bytes[..length]).trim_end().to_owned())
}

#[test]
fn systemd_is_told_and_its_watchdog_is_fed_by_lists_alone() {
    let recording = endless();
    let path = recording.path().join("notify");
    let systemd = UnixDatagram::bind(&path).unwrap();
    systemd.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0"]).env("NOTIFY_SOCKET", &path).env("WATCHDOG_USEC", "400000");
    let running = Running::start(&mut command);
    let first = told(&systemd).unwrap();
    assert!(first.contains("READY=1") && first.contains("STATUS=lists flow"), "{first}");
    for _ in 0..5 {
        assert_eq!(told(&systemd).unwrap(), "WATCHDOG=1");
    }
    // A frame that is a pipe is passed over.
    let pipe = recording.path().join("pipe");
    make_pipe(&pipe);
    fs::rename(&pipe, recording.file(3)).unwrap();
    wait_until(|| get(running.address, "/metrics", &[]).1.contains("bad_frames_total{stage=\"source\"} 1"));
    drop(running);
}

#[test]
fn the_watchdog_is_not_fed_by_time_alone() {
    let recording = endless();
    recording.configure("pace = \"real-time\"\nrepeat = true\nframe_rate_hz = 0.1");
    let path = recording.path().join("notify");
    let systemd = UnixDatagram::bind(&path).unwrap();
    systemd.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0"]).env("NOTIFY_SOCKET", &path).env("WATCHDOG_USEC", "400000");
    let running = Running::start(&mut command);
    assert!(told(&systemd).unwrap().contains("READY=1"));
    assert_eq!(told(&systemd).unwrap(), "WATCHDOG=1");
    // The next list comes after ten seconds.
    systemd.set_read_timeout(Some(Duration::from_secs(2))).unwrap();
    assert_eq!(told(&systemd), None, "it is fed although nothing gets on");
    drop(running);
}

fn make_pipe(path: &Path) {
    assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// Makes a pipe; its reader, once somebody opens it to write.
fn reader_of_pipe(path: &Path) -> std::thread::JoinHandle<fs::File> {
    make_pipe(path);
    let path = path.to_owned();
    let open = move || fs::File::open(path).unwrap();
    std::thread::Builder::new().name("pipe".into()).spawn(open).unwrap()
}

#[test]
fn a_reader_of_the_output_that_has_stopped_holds_up_no_client_no_reload_and_no_end() {
    let recording = endless();
    let pipe = recording.path().join("lists");
    let reader = reader_of_pipe(&pipe);
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0", "--output"]).arg(&pipe);
    let mut running = Running::start(&mut command);
    let stalled = reader.join().unwrap();
    // The test may wait for the processor, among others.
    let mut socket = client_with(&running, "queue=64");
    // More than the pipe (64 kB) and its queue (128 lists) hold.
    let lists: Vec<_> = (0..200).map(|_| next_json(&mut socket)).collect();
    let lost: u64 = lists.iter().map(|list| list["stream"]["lost"].as_u64().unwrap()).sum();
    assert_eq!(lost, 0);
    let captured_ns = |list: &serde_json::Value| list["stream"]["capture_monotonic_ns"].as_i64().unwrap();
    let rate_hz = 199e9 / (captured_ns(&lists[199]) - captured_ns(&lists[0])) as f64;
    println!("{rate_hz:.2} lists a second beside a stalled reader of --output");
    assert!((24.9..25.1).contains(&rate_hz), "{rate_hz}");
    assert!(drops(&running, "publish") > 0, "what the reader misses is counted");
    let text = fs::read_to_string(recording.configuration()).unwrap();
    fs::write(recording.configuration(), text.replace("count = 24", "count = 12")).unwrap();
    running.signal("HUP");
    running.wait_for("its reader takes nothing any more");
    wait_until(|| light_count(&mut socket) == 12);
    running.signal("TERM");
    let code = running.child.wait().unwrap().code();
    assert_eq!(code, Some(1), "what was not written is told: {}", running.said());
    drop(stalled);
}

/// The drops of a stage, as `/metrics` has them.
fn drops(running: &Running, stage: &str) -> u64 {
    let metrics = get(running.address, "/metrics", &[]).1;
    let is_of_stage =
        |line: &&str| line.starts_with("lightcast_stage_drops") && line.contains(&format!("\"{stage}\""));
    let line = metrics.lines().find(is_of_stage).unwrap_or_else(|| panic!("{metrics}"));
    line.rsplit(' ').next().unwrap().parse().unwrap()
}

#[test]
fn an_output_whose_reader_has_gone_ends_alone_and_says_so() {
    let recording = endless();
    let pipe = recording.path().join("lists");
    let reader = reader_of_pipe(&pipe);
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0", "--output"]).arg(&pipe);
    let mut running = Running::start(&mut command);
    drop(reader.join().unwrap());
    running.wait_for("publish is done, or has no reader any more; all else goes on");
    let mut socket = client(&running);
    assert_eq!(light_count(&mut socket), 24);
    running.end();
}

#[test]
fn systemd_is_told_of_a_reload_and_of_the_end() {
    let recording = endless();
    let path = recording.path().join("notify");
    let systemd = UnixDatagram::bind(&path).unwrap();
    systemd.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0"]).env("NOTIFY_SOCKET", &path);
    let running = Running::start(&mut command);
    assert!(told(&systemd).unwrap().contains("READY=1"));
    running.signal("HUP");
    let reloading = told(&systemd).unwrap();
    assert!(reloading.contains("RELOADING=1") && reloading.contains("MONOTONIC_USEC="), "{reloading}");
    assert!(told(&systemd).unwrap().contains("READY=1"));
    running.end();
    assert_eq!(told(&systemd).unwrap(), "STOPPING=1");
}

#[test]
fn systemd_is_told_by_an_abstract_name_as_well() {
    let recording = endless();
    let name = format!("lightcast-test-{}", std::process::id());
    let address = SocketAddr::from_abstract_name(&name).unwrap();
    let systemd = UnixDatagram::bind_addr(&address).unwrap();
    systemd.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    let mut command = recording.command();
    command.args(["--listen", "127.0.0.1:0"]).env("NOTIFY_SOCKET", format!("@{name}"));
    let running = Running::start(&mut command);
    assert!(told(&systemd).unwrap().contains("READY=1"));
    running.end();
    assert_eq!(told(&systemd).unwrap(), "STOPPING=1");
}
