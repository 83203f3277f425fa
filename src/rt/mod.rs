//! What a running program needs and no picture knows of: [`Clock`], [`Shutdown`], [`link`]s between threads,
//! [`Metrics`], named [`Threads`], and the one loop, [`stage::run`], that runs every stage.

mod clock;
mod histogram;
pub mod link;
mod metrics;
mod shutdown;
pub mod stage;
mod threads;

pub use clock::{CaptureEpoch, Clock, monotonic_ns, utc_from_monotonic_ns};
pub use histogram::Histogram;
pub use metrics::{Counter, Metrics};
pub use shutdown::Shutdown;
pub use threads::Threads;
