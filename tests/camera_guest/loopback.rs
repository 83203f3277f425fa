//! v4l2loopback: readers capture what is written to the device, byte for byte.

use crate::kernel::{Layout, Node};
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

/// The path where the guest's init script creates it.
pub fn path() -> PathBuf {
    PathBuf::from("/dev/video40")
}

/// The writing side.
pub struct Loopback(Node);

impl Loopback {
    /// Opens the device and fixes its format; readers get the same.
    pub fn open(layout: Layout) -> Self {
        let node = Node::open(&path()).unwrap();
        assert_eq!(node.set_output_format(layout).unwrap(), layout);
        Self(node)
    }

    /// Writes one picture.
    pub fn write(&mut self, picture: &[u8]) {
        self.0.file().write_all(picture).unwrap();
    }
}

/// Sleeps; nothing here has a shutdown to listen to.
#[expect(clippy::disallowed_methods, reason = "the pace of a scripted camera")]
pub fn wait(time: Duration) {
    std::thread::sleep(time);
}
