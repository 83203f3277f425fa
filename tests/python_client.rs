//! The Python client, `clients/lightcast.py`: its own tests, in a virtual environment.
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Runs on every Python that the client is for, 3.9 and later.
const WEBSOCKETS: &str = "websockets==15.0.1";

/// Python with the client's one dependency; the error says why it cannot be had here.
fn python() -> Result<PathBuf, String> {
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

/// Runs a program to its end; the error is the last line that it said.
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

#[test]
fn the_python_client_passes_its_tests() {
    let python = match python() {
        Ok(python) => python,
        Err(why) => {
            eprintln!("skipped: {why}");
            return;
        }
    };
    let output = Command::new(python)
        .args(["-W", "error::DeprecationWarning"])
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clients/test_lightcast.py"))
        // Caches stay out of the sources; servers of the test are on this machine.
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("NO_PROXY", "*")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("\nOK"), "{said}");
}
