//! Inputs as others' programs write them, read by the program as its users run it: small files of the data
//! folder (`faults`), and their right values.
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod calibrations;
mod marks;
mod pictures;
#[cfg(feature = "render")]
mod scenes;
mod sequences;

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A file of the folder of faults; `None`, after a message, where there is no such folder.
fn fault(name: &str) -> Option<PathBuf> {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let data = std::env::var_os("LIGHTCAST_DATA").map_or(default, PathBuf::from);
    let folder = data.join("faults");
    if folder.is_dir() {
        return Some(folder.join(name));
    }
    let test = std::thread::current().name().unwrap_or_default().to_owned();
    // Not eprintln!, which the test harness swallows when a test passes.
    let _ = std::io::stderr()
        .write_all(format!("skipped: {test}: no real data in {}\n", folder.display()).as_bytes());
    None
}

fn lightcast(arguments: &[&str], path: &Path) -> Output {
    let (command, rest) = arguments.split_first().unwrap();
    Command::new(env!("CARGO_BIN_EXE_lightcast")).arg(command).arg(path).args(rest).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}
