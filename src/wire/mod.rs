//! Messages between the server and its clients, as text and as bytes (`docs/protocol.md`).
//!
//! The server sends one list a message: in the subprotocol [`JSON`] the list as [`write_list`] writes it with
//! one more key, `stream`; in [`BINARY`] the layout of [`binary`]. A client requests lists by a
//! [`Subscription`].

pub mod binary;
pub mod json;
mod limits;
mod list;
mod list_file;
mod quantity;
mod subscription;

pub use list::{read_list, write_list, write_list_line};
pub use list_file::ListFile;
pub use subscription::{Demand, QUEUE_MAX, Subscription};

use lightcast_core::light::LightList;
use serde::{Deserialize, Serialize};

/// WebSocket subprotocol of lists as JSON.
pub const JSON: &str = "lightcast.v1.json";
/// WebSocket subprotocol of lists as bytes.
pub const BINARY: &str = "lightcast.v1.bin";
/// Most bytes of a message from a client; the longest useful one has a hundred.
pub const DEMAND_MAX_BYTES: usize = 4096;
/// Most bytes of a message to a client: [`lightcast_core::light::MAX_LIGHTS`] lights of some 150 bytes each,
/// twice over.
pub const MESSAGE_MAX_BYTES: usize = 1 << 23;

/// The data of every message beside its list: times, and the number of lists that the client has missed.
/// Monotonic times are those of the server's clock `CLOCK_MONOTONIC`; UTC in nanoseconds since 1970.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Delivery {
    /// Lists that this client should have had since its last message and was too slow for.
    pub lost: u64,
    /// When the frame was captured, or would have been: a replay captures its frames as it plays them. `None`
    /// for a replay as fast as possible.
    pub capture_monotonic_ns: Option<i64>,
    /// The same in UTC.
    pub capture_utc_ns: Option<i64>,
    /// When the message was handed to the connection.
    pub sent_monotonic_ns: i64,
    /// The same in UTC.
    pub sent_utc_ns: i64,
}

/// A decoded message.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Message {
    /// The list.
    pub list: LightList,
    /// The data that goes with it.
    pub delivery: Delivery,
}
