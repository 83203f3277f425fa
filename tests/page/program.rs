//! The program as a server of the bundled sequence.

use crate::browser::Guard;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::JoinHandle;
use tempfile::TempDir;

/// A server, which is killed when it is dropped.
pub struct Program {
    /// Address at which it listens, such as `127.0.0.1:40000`.
    pub address: String,
    guard: Option<Guard>,
    /// Keeps reading, so that the program can keep writing.
    messages: Option<JoinHandle<()>>,
    _folder: TempDir,
}

impl Program {
    /// Serves the bundled sequence in a loop at `address`, where port 0 means any free port, to clients with
    /// the token.
    pub fn start(address: &str, token: Option<&str>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let replay = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/day");
        let replay = replay.display();
        let mut config = format!(
            "[source]\nkind = \"sequence\"\npath = \"{replay}\"\nframe_rate_hz = 25.0\nrepeat = true\n\
             [camera]\nprojection = \"fisheye\"\ncalibration = \"{replay}/calibration.json\"\n"
        );
        if let Some(token) = token {
            std::fs::write(folder.path().join("token"), token).unwrap();
            config += "[server]\ntoken_file = \"token\"\n";
        }
        let file = folder.path().join("config.toml");
        std::fs::write(&file, config).unwrap();
        let child = Command::new(env!("CARGO_BIN_EXE_lightcast"))
            .env_remove("RUST_LOG")
            .args(["run", "--listen", address, "--config"])
            .arg(&file)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
        let mut guard = Guard(child.unwrap());
        let mut lines = BufReader::new(guard.0.stderr.take().unwrap()).lines();
        let mut said = String::new();
        let address = loop {
            let line = lines.next().unwrap_or_else(|| panic!("it does not listen: {said}")).unwrap();
            said += &line;
            if let Some((_, rest)) = line.split_once("listening on http://") {
                break rest.trim_end_matches('/').to_owned();
            }
        };
        let messages = std::thread::Builder::new().spawn(move || lines.for_each(drop)).unwrap();
        Self { address, guard: Some(guard), messages: Some(messages), _folder: folder }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        drop(self.guard.take());
        if let Some(messages) = self.messages.take() {
            let _ = messages.join();
        }
    }
}
