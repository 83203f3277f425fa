//! The JavaScript client, `clients/lightcast.js`, in Node: its own tests, its example against the program,
//! and its package.
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

#[path = "clients/example.rs"]
mod example;
#[path = "clients/server.rs"]
mod server;

use example::Example;
use server::Server;
use std::io::Write;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Stdio};

/// The oldest version that runs the decoders.
const OLDEST: u32 = 18;

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
fn the_javascript_example_prints_lists_of_the_program_and_ends_with_its_reader() {
    let version = match version() {
        Ok(version) => version,
        Err(why) => return skip(&why),
    };
    let Some(way) = with_web_sockets() else {
        return skip(&format!("Node {version} has no WebSocket; 20.10 and later have"));
    };
    let server = Server::start();
    let start = || {
        let mut command = Command::new("node");
        Example::start(command.args(way).arg(root().join("clients/example.mjs")).arg(&server.url))
    };
    let example = start();
    let mut last = None;
    for _ in 0..8 {
        let line = example.line();
        // list 25: 16 lights, brightest: 3 at (0.458, 0.750, 0.477)
        let (sequence, rest) = line.strip_prefix("list ").unwrap().split_once(": ").unwrap();
        let sequence: u64 = sequence.parse().unwrap();
        assert!(last < Some(sequence), "{line}");
        last = Some(sequence);
        assert!(rest.starts_with("16 lights, brightest: "), "{line}");
    }
    let (status, said) = example.stop_reading();
    assert!(status.success(), "{said}");
    // The states, and of Node 20 that its WebSocket is an experiment.
    assert!(said.starts_with("connecting") && !said.contains("EPIPE"), "{said}");

    let example = start();
    example.line();
    let (status, said) = example.interrupt();
    assert_eq!(status.signal(), Some(2), "{said}");
    assert!(!said.contains("rror"), "{said}");
}

/// A program that prints the number of lights of a list, in the axes of another program.
const PROGRAM: &str = "\
import { LightcastClient, directionIn } from 'lightcast';
const client = new LightcastClient(process.argv[2], { subscription: { lights: 3 } });
client.addEventListener('state', ({ detail }) => console.error(detail));
client.addEventListener('list', ({ detail: { lights } }) => {
  console.log(lights.map(({ direction }) => directionIn(direction, 'three')).length);
  client.close();
});
client.connect();
";

#[test]
fn the_javascript_client_installs_from_its_folder() {
    match version() {
        // The events of the client.
        Ok(version) if !version.starts_with("v18.") && !version.starts_with("v19.") => {}
        Ok(version) => {
            return skip(&format!("its package needs Node 20, and `node --version` says: {version}"));
        }
        Err(why) => return skip(&why),
    }
    if let Err(why) = npm(Path::new("."), &["view", "ws", "version"]) {
        return skip(&format!("npm or its registry is not there: {why}"));
    }
    let server = Server::start();
    let clients = root().join("clients");
    let clients = clients.to_str().unwrap();
    // A copy with its package, and a link beside it.
    for arguments in [["--install-links", clients], [clients, "ws"]] {
        let folder = tempfile::tempdir().unwrap();
        npm(folder.path(), &[&["install", "--no-audit", "--no-fund"], &arguments[..]].concat()).unwrap();
        let program = folder.path().join("program.mjs");
        std::fs::write(&program, PROGRAM).unwrap();
        let address = server.url.strip_prefix("ws://").unwrap();
        let output = Command::new("node").arg(program).arg(address).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {said}");
        assert_eq!(String::from_utf8_lossy(&output.stdout), "3\n", "{arguments:?}: {said}");
    }
}

/// Runs npm in a folder; the error is the first line of its messages.
fn npm(folder: &Path, arguments: &[&str]) -> Result<(), String> {
    let output = Command::new("npm").args(arguments).current_dir(folder).stdin(Stdio::null()).output();
    let output = output.map_err(|error| format!("no npm can be started: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    Err(String::from_utf8_lossy(&output.stderr).lines().next().unwrap_or("it says nothing").to_owned())
}
