//! The command line as its users type it: every command with every input, and former spellings.
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod aliases;
#[expect(dead_code, reason = "not all of it is needed here")]
#[path = "../run_replay/recording.rs"]
mod recording;
#[path = "../clients/server.rs"]
mod server;
mod table;
