//! Frames and faults through real V4L2 drivers. The checks run inside the guest that
//! `tests/camera_guest/boot` starts (`make test-camera`): they load no modules, and feed devices that nobody
//! else may use.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod capture;
mod driver;
mod faults;
mod frames;
mod kernel;
mod lists;
mod live;
mod loopback;
mod messages;
mod program;
mod vivid;
