//! Frames and faults through real V4L2 drivers. The checks run inside the guest that `tests/camera_guest/boot` starts
//! (`make test-camera`): they load nothing and feed devices that nobody else may use.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod driver;
mod frames;
mod kernel;
mod loopback;
mod vivid;
