//! The server and its clients over real connections on localhost: the contents of streams, misbehaving
//! clients, and the program as a service.
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod connection;
mod faults;
mod program;
#[expect(dead_code, reason = "not all of it is needed here")]
#[path = "../run_replay/recording.rs"]
mod recording;
mod scarce;
mod service;
mod soak;
mod stopped;
mod streams;
