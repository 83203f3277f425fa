//! The server that streams lists to clients, and the client that takes them: the only asynchronous code.
//!
//! The service posts lists and maps on a [`Board`]; a [`Server`], which outlives a service that is restarted
//! with a new configuration, has one thread for all its clients and takes from the board what each of them
//! wants. So no client blocks the service or another client: a slow client gets the newest list when it is
//! ready, and is told how many it missed.

mod access;
mod board;
mod burst;
mod client;
mod frames;
mod metrics;
mod options;
mod page;
mod places;
mod posting;
mod requests;
mod room;
mod server;
mod session;
mod shared;
mod stages;
mod turn;
mod upgrade;
mod watched;

pub use board::Board;
pub use client::{Client, ClientOptions};
pub use options::{ServerOptions, Token};
pub use posting::{PostLists, PostMaps};
pub use server::Server;
