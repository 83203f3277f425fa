//! The driver's side of a video device: the few ioctls that a test needs to feed frames and to inject faults.
//!
//! Nothing here belongs to the product: the capturing side is tested, the feeding side only has to be simple.

#![expect(
    unsafe_code,
    reason = "ioctls have no safe form; each is one call with a structure that lives on the stack"
)]

use std::ffi::{CStr, c_int, c_ulong, c_void};
use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::AsRawFd;
use std::path::Path;
use v4l::v4l_sys::{
    v4l2_buffer, v4l2_control, v4l2_format, v4l2_pix_format, v4l2_query_ext_ctrl, v4l2_requestbuffers,
};
use v4l::v4l2::{ioctl, vidioc};

/// `V4L2_BUF_TYPE_VIDEO_OUTPUT`.
const VIDEO_OUTPUT: u32 = 2;
/// `V4L2_MEMORY_USERPTR`: the driver reads the test's own memory, so nothing has to be mapped.
const USER_POINTER: u32 = 2;
/// `V4L2_FIELD_NONE`.
const PROGRESSIVE: u32 = 1;
/// `V4L2_CTRL_FLAG_NEXT_CTRL`.
const NEXT_CONTROL: u32 = 0x8000_0000;

/// A picture format, as requested and as returned by the driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    pub four_cc: [u8; 4],
    pub width: u32,
    pub height: u32,
    /// Bytes from one row to the next; 0 lets the driver choose.
    pub stride: u32,
    /// Bytes of a picture, as reported by the driver; 0 before.
    pub size: u32,
}

impl Layout {
    /// A format with unpadded rows of two bytes per pixel, like all formats in the checks.
    pub fn two_bytes(four_cc: &[u8; 4], width: u32, height: u32) -> Self {
        Self { four_cc: *four_cc, width, height, stride: 2 * width, size: 2 * width * height }
    }
}

/// An open video device.
pub struct Node(File);

impl Node {
    /// Opens a node such as `/dev/video0`; its calls block.
    pub fn open(path: &Path) -> io::Result<Self> {
        OpenOptions::new().read(true).write(true).open(path).map(Self)
    }

    /// The file, for plain reads and writes.
    pub fn file(&mut self) -> &mut File {
        &mut self.0
    }

    fn call<T>(&self, request: c_ulong, argument: &mut T) -> io::Result<()> {
        // SAFETY: every caller passes the structure that belongs to `request`; the kernel does not write
        // beyond it.
        unsafe { ioctl(self.0.as_raw_fd(), request, std::ptr::from_mut(argument).cast::<c_void>()) }
    }

    /// Sets the format of the output side and returns the format that the driver chose.
    pub fn set_output_format(&self, layout: Layout) -> io::Result<Layout> {
        let mut format: v4l2_format = zeroed();
        format.type_ = VIDEO_OUTPUT;
        format.fmt.pix = v4l2_pix_format {
            width: layout.width,
            height: layout.height,
            pixelformat: u32::from_le_bytes(layout.four_cc),
            field: PROGRESSIVE,
            bytesperline: layout.stride,
            sizeimage: layout.size,
            ..zeroed()
        };
        self.call(vidioc::VIDIOC_S_FMT, &mut format)?;
        // SAFETY: the kernel filled this member, since the type is the single-planar one.
        let given = unsafe { format.fmt.pix };
        Ok(Layout {
            four_cc: given.pixelformat.to_le_bytes(),
            width: given.width,
            height: given.height,
            stride: given.bytesperline,
            size: given.sizeimage,
        })
    }

    /// Names of all plain controls, in the driver's order.
    pub fn controls(&self) -> Vec<(u32, String)> {
        let mut controls = Vec::new();
        let mut query: v4l2_query_ext_ctrl = zeroed();
        loop {
            query.id |= NEXT_CONTROL;
            if self.call(vidioc::VIDIOC_QUERY_EXT_CTRL, &mut query).is_err() {
                return controls;
            }
            // SAFETY: the kernel terminates the name with a zero inside the array.
            let name = unsafe { CStr::from_ptr(query.name.as_ptr()) };
            controls.push((query.id, name.to_string_lossy().into_owned()));
        }
    }

    /// Sets a control, or presses a button, by its name.
    pub fn set_control(&self, name: &str, value: i32) -> io::Result<()> {
        let controls = self.controls();
        let id = controls.iter().find(|(_, known)| known == name).map(|(id, _)| *id);
        let id = id.ok_or_else(|| io::Error::other(format!("no control '{name}' among {controls:?}")))?;
        self.call(vidioc::VIDIOC_S_CTRL, &mut v4l2_control { id, value })
    }

    /// Allocates `count` buffers of the output side; 0 frees them.
    pub fn request_output_buffers(&self, count: u32) -> io::Result<u32> {
        let mut request =
            v4l2_requestbuffers { count, type_: VIDEO_OUTPUT, memory: USER_POINTER, ..zeroed() };
        self.call(vidioc::VIDIOC_REQBUFS, &mut request)?;
        Ok(request.count)
    }

    /// Passes `picture` to the driver as buffer `index`. It must remain valid until that index is dequeued or
    /// the stream ends.
    pub fn queue_output(&self, index: u32, picture: &'static [u8]) -> io::Result<()> {
        let length = u32::try_from(picture.len()).map_err(io::Error::other)?;
        let mut buffer = v4l2_buffer {
            index,
            type_: VIDEO_OUTPUT,
            memory: USER_POINTER,
            field: PROGRESSIVE,
            bytesused: length,
            length,
            ..zeroed()
        };
        buffer.m.userptr = picture.as_ptr() as c_ulong;
        self.call(vidioc::VIDIOC_QBUF, &mut buffer)
    }

    /// Waits for a buffer with which the driver has finished; returns its index.
    pub fn dequeue_output(&self) -> io::Result<u32> {
        let mut buffer = v4l2_buffer { type_: VIDEO_OUTPUT, memory: USER_POINTER, ..zeroed() };
        self.call(vidioc::VIDIOC_DQBUF, &mut buffer)?;
        Ok(buffer.index)
    }

    /// Starts the output side, or stops it.
    pub fn stream_output(&self, on: bool) -> io::Result<()> {
        let mut kind = VIDEO_OUTPUT as c_int;
        self.call(if on { vidioc::VIDIOC_STREAMON } else { vidioc::VIDIOC_STREAMOFF }, &mut kind)
    }
}

/// A structure of the kernel's with all bytes zero.
fn zeroed<T: Copy>() -> T {
    // SAFETY: used only for the kernel's plain C structures of integers, arrays and unions of them.
    unsafe { std::mem::zeroed() }
}
