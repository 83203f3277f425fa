//! The runtime, which is independent of images: [`Clock`], [`Shutdown`], [`link`]s between threads, a
//! [`fan_out`] to several of them, [`Metrics`], named [`Threads`], and the one loop, [`stage::run`], that
//! runs every stage.

mod back_off;
mod clock;
mod contained;
pub mod fan_out;
mod handles;
mod histogram;
pub mod link;
mod metrics;
mod shutdown;
pub mod stage;
mod stoppable_writer;
mod threads;
mod waits;

pub use back_off::BackOff;
pub use clock::{CaptureEpoch, Clock, monotonic_ns, utc_from_monotonic_ns};
pub use contained::contained;
pub use handles::{handle_limit, is_out_of_handles, raise_handle_limit};
pub use histogram::Histogram;
pub use metrics::{Counter, Metrics};
pub use shutdown::Shutdown;
pub use stoppable_writer::StoppableWriter;
pub use threads::Threads;
pub use waits::WAITS;
