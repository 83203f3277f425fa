//! The Python client, `clients/lightcast.py`: its own tests, its example and its package, in virtual
//! environments.
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

#[path = "clients/example.rs"]
mod example;
#[path = "clients/server.rs"]
mod server;

use example::Example;
use server::Server;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// This version runs on every Python that the client supports, 3.9 and later.
const WEBSOCKETS: &str = "websockets==15.0.1";

/// Python with the client's only dependency, set up once for all tests; the error says why it is not
/// available here.
fn python() -> Result<PathBuf, String> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    PYTHON.get_or_init(make_python).clone()
}

fn make_python() -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python_client");
    let python = folder.join("bin/python");
    if !has_websockets(&python) {
        let (system, folder) = (Path::new("python3"), folder.to_str().unwrap());
        run(system, &["-c", "import sys; sys.exit(sys.version_info < (3, 9))"])
            .map_err(|why| format!("no Python 3.9 or later: {why}"))?;
        run(system, &["-m", "venv", "--clear", folder])
            .map_err(|why| format!("no virtual environment can be made: {why}"))?;
        run(&python, &["-m", "pip", "install", "--quiet", "--disable-pip-version-check", WEBSOCKETS])
            .map_err(|why| format!("{WEBSOCKETS} cannot be installed: {why}"))?;
    }
    Ok(python)
}

fn has_websockets(python: &Path) -> bool {
    let version = WEBSOCKETS.split_once("==").unwrap().1;
    let check = format!("import sys, websockets; sys.exit(websockets.__version__ != '{version}')");
    run(python, &["-c", &check]).is_ok()
}

/// Runs a program to its end; the error is the last line of its messages.
fn run(program: &Path, arguments: &[&str]) -> Result<(), String> {
    let output = Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .map_err(|error| format!("{}: {error}", program.display()))?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(said.trim_end().lines().last().unwrap_or("it fails and says nothing").to_owned())
}

fn skip(why: &str) {
    // Not eprintln!, which the test harness swallows when a test passes.
    let _ = writeln!(std::io::stderr(), "skipped: Python client: {why}");
}

#[test]
fn the_python_client_passes_its_tests() {
    let python = match python() {
        Ok(python) => python,
        Err(why) => return skip(&why),
    };
    let output = Command::new(python)
        .args(["-W", "error::DeprecationWarning"])
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clients/test_lightcast.py"))
        // Caches are kept out of the sources; servers of the test are on this machine.
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("NO_PROXY", "*")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("\nOK"), "{said}");
}

#[test]
fn the_python_client_takes_lists_from_the_program() {
    let python = match python() {
        Ok(python) => python,
        Err(why) => return skip(&why),
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let server = Server::start();
    for kind in [&[][..], &["--json"]] {
        let output = Command::new(&python)
            .arg(root.join("tests/clients/test_lightcast.py"))
            .args(["--url", &server.url, "--count", "20", "--lights", "16", "--queue", "64"])
            .args(kind)
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .env("NO_PROXY", "*")
            .stdin(Stdio::null())
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).unwrap();
        let lists: Vec<serde_json::Value> =
            text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!(lists.len(), 20, "{text}");
        for pair in lists.windows(2) {
            let sequence = |list: &serde_json::Value| list["sequence"].as_u64().unwrap();
            assert_eq!(sequence(&pair[1]), sequence(&pair[0]) + 1, "{text}");
            assert_eq!((&pair[1]["lights"], &pair[1]["lost"]), (&16.into(), &0.into()));
            let age_s = pair[1]["age_s"].as_f64().unwrap();
            assert!((0.0..10.0).contains(&age_s), "{age_s}");
            assert!(pair[1]["power"][1].as_f64().unwrap() > 0.0);
        }
    }
}

#[test]
fn the_python_example_ends_quietly_with_its_reader_and_on_an_interrupt() {
    let python = match python() {
        Ok(python) => python,
        Err(why) => return skip(&why),
    };
    let server = Server::start();
    let start = || {
        let mut command = Command::new(&python);
        command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("clients/example.py"));
        let address = server.url.strip_prefix("ws://").unwrap();
        Example::start(command.arg(address).env("PYTHONDONTWRITEBYTECODE", "1").env("NO_PROXY", "*"))
    };
    for end in [Example::stop_reading, Example::interrupt] {
        let example = start();
        for _ in 0..2 {
            let line = example.line();
            assert!(line.starts_with("list ") && line.contains(": 64 lights, power "), "{line}");
            let line = example.line();
            assert!(line.starts_with("  brightest: Light(id="), "{line}");
        }
        let (status, said) = end(example);
        assert!(status.success() && said.is_empty(), "{status}: {said}");
    }
}

#[test]
fn the_python_client_installs_from_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (system, python) = (Path::new("python3"), folder.path().join("venv/bin/python"));
    let pip = |arguments: &[&str]| {
        let quiet = ["-m", "pip", "--quiet", "--disable-pip-version-check"];
        run(&python, &[&quiet[..], arguments].concat())
    };
    // What the package is built with, and what it needs.
    let needed = ["flit_core >= 3.12, < 4", "websockets >= 15"];
    let is_there = run(system, &["-m", "venv", &at("venv")])
        .and_then(|()| pip(&["download", "--no-deps", "--dest", &at("wheels"), needed[0], needed[1]]));
    if let Err(why) = is_there {
        return skip(&format!("pip or its registry is not there: {why}"));
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    pip(&["install", root.join("clients").to_str().unwrap()]).unwrap();
    // Away from the client's folder, so that the package is what it imports.
    std::fs::copy(root.join("clients/example.py"), at("example.py")).unwrap();
    let server = Server::start();
    let example =
        Example::start(Command::new(&python).args([&at("example.py"), &server.url]).env("NO_PROXY", "*"));
    let line = example.line();
    assert!(line.starts_with("list ") && line.contains(": 64 lights, power "), "{line}");
    let (status, said) = example.stop_reading();
    assert!(status.success() && said.is_empty(), "{status}: {said}");
}
