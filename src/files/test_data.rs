//! Real pictures for tests of any room.

use std::io::Write;
use std::path::{Path, PathBuf};

/// A folder of real data: `LIGHTCAST_DATA`, by default `../shared/data`, and `name` below it. `None` where it
/// is missing, after a line that names the running test and says so.
pub(crate) fn real_folder(name: &str) -> Option<PathBuf> {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let folder = std::env::var_os("LIGHTCAST_DATA").map_or(default, PathBuf::from).join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    say_skipped(&format!("no real data in {}", folder.display()));
    None
}

/// Names the running test as skipped, and why.
pub(crate) fn say_skipped(reason: &str) {
    let test = std::thread::current().name().unwrap_or_default().to_owned();
    // Not eprintln!, which the test harness swallows when a test passes; in one piece, as tests run side by
    // side.
    let line = format!("skipped: {test}: {reason}\n");
    let _ = std::io::stderr().write_all(line.as_bytes());
}
