//! The JavaScript client, `clients/lightcast.js`, in Node: its own tests, and its example against the
//! program.
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

#[path = "clients/server.rs"]
mod server;

use server::{Guard, Server};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::sync_channel;
use std::time::Duration;

/// The oldest version that runs the decoders.
const OLDEST: u32 = 18;
/// A list that takes longer does not come; the machine may be busy with other work.
const PATIENCE: Duration = Duration::from_secs(60);

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn skip(why: &str) {
    // Not eprintln!, which the test harness swallows when a test passes.
    let _ = writeln!(std::io::stderr(), "skipped: JavaScript client: {why}");
}

/// Node's version, such as `v20.10.0`; the error says why there is none that is new enough.
fn version() -> Result<String, String> {
    let output = Command::new("node").arg("--version").output();
    let output = output.map_err(|error| format!("no node can be started: {error}"))?;
    let version = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    let major = version.strip_prefix('v').and_then(|rest| rest.split('.').next()?.parse::<u32>().ok());
    match major {
        Some(major) if major >= OLDEST => Ok(version),
        _ => Err(format!("it needs Node {OLDEST} or later, and `node --version` says: {version}")),
    }
}

/// The arguments with which this Node has WebSockets; `None` when it has none.
fn with_web_sockets() -> Option<&'static [&'static str]> {
    const WAYS: [&[&str]; 2] = [&[], &["--experimental-websocket"]];
    WAYS.into_iter().find(|way| {
        let check = "process.exit(typeof WebSocket === 'undefined' ? 1 : 0)";
        let output = Command::new("node").args(*way).args(["--eval", check]).output();
        output.unwrap().status.success()
    })
}

#[test]
fn the_javascript_client_passes_its_tests() {
    if let Err(why) = version() {
        return skip(&why);
    }
    let output = Command::new("node")
        .arg(root().join("tests/clients/test_lightcast.mjs"))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    assert!(said.contains(" fail 0\n") && !said.contains(" pass 0\n"), "{said}");
}

#[test]
fn the_javascript_example_prints_lists_of_the_program() {
    let version = match version() {
        Ok(version) => version,
        Err(why) => return skip(&why),
    };
    let Some(way) = with_web_sockets() else {
        return skip(&format!("Node {version} has no WebSocket; 20.10 and later have"));
    };
    let server = Server::start();

    let example = Command::new("node")
        .args(way)
        .arg(root().join("clients/example.mjs"))
        .arg(&server.url)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::inherit())
        .spawn();
    let mut example = Guard(example.unwrap());
    let lines = BufReader::new(example.0.stdout.take().unwrap()).lines();
    let (sender, receiver) = sync_channel(1);
    let reader = std::thread::Builder::new().spawn(move || {
        for line in lines {
            if sender.send(line.unwrap()).is_err() {
                break;
            }
        }
    });
    let mut last = None;
    for _ in 0..8 {
        let line = receiver.recv_timeout(PATIENCE).unwrap();
        // list 25: 16 lights, brightest: 3 at (0.458, 0.750, 0.477)
        let (sequence, rest) = line.strip_prefix("list ").unwrap().split_once(": ").unwrap();
        let sequence: u64 = sequence.parse().unwrap();
        assert!(last < Some(sequence), "{line}");
        last = Some(sequence);
        assert!(rest.starts_with("16 lights, brightest: "), "{line}");
    }
    drop(receiver);
    drop(example);
    reader.unwrap().join().unwrap();
}
