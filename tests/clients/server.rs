//! The program as a server of the bundled sequence, for clients in other languages.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};

/// A program that is ended with the test.
pub struct Guard(pub Child);

impl Drop for Guard {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A running server.
pub struct Server {
    /// Address of its stream, `ws://127.0.0.1:PORT/ws`.
    pub url: String,
    _guard: Guard,
    /// Kept open as long as it runs: with a few clients it writes so few messages that they fit into the
    /// pipe.
    _messages: BufReader<ChildStderr>,
}

impl Server {
    pub fn start() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_lightcast"));
        command.args(["run", "--listen", "127.0.0.1:0", "--config"]).arg(root.join("config/stream.toml"));
        let child = command.env_remove("RUST_LOG").stdin(Stdio::null()).stderr(Stdio::piped()).spawn();
        let mut guard = Guard(child.unwrap());
        let mut messages = BufReader::new(guard.0.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains("listening on http://") {
            line.clear();
            assert!(messages.read_line(&mut line).unwrap() > 0, "the server has ended");
        }
        let address = line.split_once("http://").unwrap().1.trim_end().trim_end_matches('/');
        Self { url: format!("ws://{address}/ws"), _guard: guard, _messages: messages }
    }
}
