//! vivid, the kernel's own test driver: its HDMI output looped to its HDMI input, and the faults that can be
//! injected into it.

use crate::kernel::{Layout, Node};
use crate::loopback::wait;
use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Faults, each of which is a control of the capture side.
#[derive(Clone, Copy, Debug)]
pub enum Fault {
    /// The next buffer carries the error flag.
    BufferError,
    /// This percentage of the buffers is lost.
    DroppedPercent(i32),
    /// The next STREAMON fails.
    StreamOn,
    /// The next REQBUFS fails.
    RequestBuffers,
    /// The next QBUF fails.
    Queue,
    /// The stream ends until it is started again.
    Fatal,
    /// The device disappears as if it were unplugged.
    Disconnect,
    /// From the next start on the sequence numbers wrap around after 128 frames.
    WrapSequence,
}

/// Path of the device node with this name in sysfs, such as `vivid-000-vid-cap`.
fn find(name: &str) -> Option<PathBuf> {
    fs::read_dir("/sys/class/video4linux").ok()?.flatten().find_map(|entry| {
        let known = fs::read_to_string(entry.path().join("name")).ok()?;
        (known.trim() == name).then(|| PathBuf::from("/dev").join(entry.file_name()))
    })
}

/// The capturing node.
pub fn capture_path() -> Option<PathBuf> {
    find("vivid-000-vid-cap")
}

/// The node that feeds it.
pub fn output_path() -> Option<PathBuf> {
    find("vivid-000-vid-out")
}

/// Unbinds the driver from its device; readers see the device disappear.
pub fn unplug() {
    fs::write("/sys/bus/platform/drivers/vivid/unbind", "vivid.0").unwrap();
}

/// Binds the driver to the device again, with all controls at their defaults.
pub fn plug() {
    fs::write("/sys/bus/platform/drivers/vivid/bind", "vivid.0").unwrap();
    let start = Instant::now();
    while capture_path().is_none_or(|path| Node::open(&path).is_err()) {
        assert!(start.elapsed() < Duration::from_secs(5), "vivid.0 did not come back");
        wait(Duration::from_millis(10));
    }
}

/// Resets the device to its initial state.
pub fn fresh() {
    if capture_path().is_some() {
        unplug();
    }
    plug();
}

/// Injects `fault` into the capture side.
pub fn inject(fault: Fault) {
    let node = Node::open(&capture_path().unwrap()).unwrap();
    let (name, value) = match fault {
        Fault::BufferError => ("Inject V4L2_BUF_FLAG_ERROR", 1),
        Fault::DroppedPercent(percent) => ("Percentage of Dropped Buffers", percent),
        Fault::StreamOn => ("Inject VIDIOC_STREAMON Error", 1),
        Fault::RequestBuffers => ("Inject VIDIOC_REQBUFS Error", 1),
        Fault::Queue => ("Inject VIDIOC_QBUF Error", 1),
        Fault::Fatal => ("Inject Fatal Streaming Error", 1),
        Fault::Disconnect => ("Disconnect", 1),
        Fault::WrapSequence => ("Wrap Sequence Number", 1),
    };
    node.set_control(name, value).unwrap();
}

/// The output side, streaming.
pub struct Output {
    node: Node,
    /// Buffers that were queued so far.
    queued: u32,
    count: u32,
}

impl Output {
    /// Loops output to input without an overlay, and fixes the format. The capturing side sets the same.
    pub fn open(layout: Layout) -> Self {
        let capture = Node::open(&capture_path().unwrap()).unwrap();
        capture.set_control("Loop Video", 1).unwrap();
        capture.set_control("OSD Text Mode", 2).unwrap();
        let node = Node::open(&output_path().unwrap()).unwrap();
        assert_eq!(node.set_output_format(layout).unwrap(), layout);
        let count = node.request_output_buffers(4).unwrap();
        Self { node, queued: 0, count }
    }

    /// Shows `picture` until the next one: the driver keeps its last buffer.
    pub fn show(&mut self, picture: &'static [u8]) {
        if self.queued == 0 {
            // The driver requires two buffers before it starts.
            for index in 0..2 {
                self.node.queue_output(index, picture).unwrap();
            }
            self.node.stream_output(true).unwrap();
            self.queued = 2;
        } else if self.queued < self.count {
            self.node.queue_output(self.queued, picture).unwrap();
            self.queued += 1;
        } else {
            let index = self.node.dequeue_output().unwrap();
            self.node.queue_output(index, picture).unwrap();
        }
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // A device that was unplugged has already ended its stream.
        let _gone = self.node.stream_output(false);
    }
}
