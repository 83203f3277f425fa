//! The server that streams lists to clients, and the client that takes them: the only asynchronous code.
//!
//! The service posts lists and maps on a [`Board`]; a [`Server`], which outlives a service that is configured
//! anew, has one thread for all its clients and takes from the board what each of them wants. So no client
//! holds up the service or another client: whoever is slow finds the newest list when they are ready, and is
//! told what they missed.

mod access;
mod board;
mod client;
mod metrics;
mod options;
mod page;
mod posting;
mod requests;
mod server;
mod session;
mod shared;
mod stages;
mod turn;

pub use board::Board;
pub use client::{Client, ClientOptions};
pub use options::{ServerOptions, Token};
pub use posting::{PostLists, PostMaps};
pub use server::Server;
