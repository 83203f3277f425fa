//! A device node of the kernel's V4L2 interface: its ioctls, its shared buffers, and nothing that can panic.
//!
//! The structures and request codes are those of the `v4l` crate; its own `Device` and `Stream` are not used,
//! because they panic on controls and colour spaces that they do not know and on errors while a device is
//! being removed, and their buffers can be read only through a call that loses track of them after a timeout
//! (v4l 0.14).
//!
//! All unsafe code of the capture is in this file.
#![expect(unsafe_code, reason = "V4L2 is ioctls on C structures, and memory that the driver shares")]

use std::fs::OpenOptions;
use std::io;
use std::mem;
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr::{self, NonNull};
use std::time::Duration;
use v4l::v4l_sys as sys;
use v4l::v4l2::{self, vidioc};

/// An open device node.
#[derive(Debug)]
pub(super) struct Node {
    file: OwnedFd,
}

impl Node {
    /// Opens a node for reading and writing in non-blocking mode.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).custom_flags(libc::O_NONBLOCK).open(path)?;
        Ok(Self { file: file.into() })
    }

    /// One ioctl, repeated when a signal interrupts it. `T` must be the structure that belongs to `request`.
    fn ioctl<T>(&self, request: vidioc::_IOC_TYPE, argument: &mut T) -> io::Result<()> {
        loop {
            // SAFETY: every caller in this file passes the structure that the request is defined with, and
            // pointers in it point to buffers that outlive the call.
            let outcome =
                unsafe { v4l2::ioctl(self.file.as_raw_fd(), request, ptr::from_mut(argument).cast()) };
            match outcome {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                outcome => return outcome,
            }
        }
    }

    /// Who made the device and what it can do.
    pub(super) fn capability(&self) -> io::Result<sys::v4l2_capability> {
        let mut capability: sys::v4l2_capability = zeroed();
        self.ioctl(vidioc::VIDIOC_QUERYCAP, &mut capability)?;
        Ok(capability)
    }

    /// The pixel format of this index; `None` after the last.
    pub(super) fn format_description(&self, index: u32) -> io::Result<Option<sys::v4l2_fmtdesc>> {
        let mut description = sys::v4l2_fmtdesc { index, type_: CAPTURE, ..zeroed() };
        end_of_list(self.ioctl(vidioc::VIDIOC_ENUM_FMT, &mut description).map(|()| description))
    }

    /// The frame size of this index; `None` after the last.
    pub(super) fn frame_size(&self, pixel_format: u32, index: u32) -> io::Result<Option<SizeRange>> {
        let mut size = sys::v4l2_frmsizeenum { index, pixel_format, ..zeroed() };
        let range = self.ioctl(vidioc::VIDIOC_ENUM_FRAMESIZES, &mut size).map(|()| {
            // SAFETY: the kernel reports in `type_` which member it has filled, and all bytes were set to
            // zero before.
            unsafe {
                if size.type_ == sys::v4l2_frmsizetypes_V4L2_FRMSIZE_TYPE_DISCRETE {
                    let one = size.__bindgen_anon_1.discrete;
                    SizeRange { least: [one.width, one.height], most: [one.width, one.height] }
                } else {
                    let range = size.__bindgen_anon_1.stepwise;
                    SizeRange {
                        least: [range.min_width, range.min_height],
                        most: [range.max_width, range.max_height],
                    }
                }
            }
        });
        end_of_list(range)
    }

    /// The frame interval, or the shortest of a range, of this index in seconds as (numerator, denominator);
    /// `None` after the last.
    pub(super) fn frame_interval(
        &self,
        pixel_format: u32,
        [width, height]: [u32; 2],
        index: u32,
    ) -> io::Result<Option<(u32, u32)>> {
        let mut interval = sys::v4l2_frmivalenum { index, pixel_format, width, height, ..zeroed() };
        let found = self.ioctl(vidioc::VIDIOC_ENUM_FRAMEINTERVALS, &mut interval).map(|()| {
            // SAFETY: as for sizes.
            let fraction = unsafe {
                if interval.type_ == sys::v4l2_frmivaltypes_V4L2_FRMIVAL_TYPE_DISCRETE {
                    interval.__bindgen_anon_1.discrete
                } else {
                    interval.__bindgen_anon_1.stepwise.min
                }
            };
            (fraction.numerator, fraction.denominator)
        });
        end_of_list(found)
    }

    /// The current capture format.
    pub(super) fn format(&self) -> io::Result<sys::v4l2_pix_format> {
        let mut format = sys::v4l2_format { type_: CAPTURE, ..zeroed() };
        self.ioctl(vidioc::VIDIOC_G_FMT, &mut format)?;
        // SAFETY: single-planar capture formats are in `pix`.
        Ok(unsafe { format.fmt.pix })
    }

    /// Requests a capture format; returns the format that the driver chose.
    pub(super) fn set_format(&self, pix: sys::v4l2_pix_format) -> io::Result<sys::v4l2_pix_format> {
        let mut format = sys::v4l2_format { type_: CAPTURE, ..zeroed() };
        format.fmt.pix = pix;
        self.ioctl(vidioc::VIDIOC_S_FMT, &mut format)?;
        // SAFETY: as in `format`.
        Ok(unsafe { format.fmt.pix })
    }

    /// Current time per frame in seconds as (numerator, denominator).
    pub(super) fn interval(&self) -> io::Result<(u32, u32)> {
        let mut parameters = sys::v4l2_streamparm { type_: CAPTURE, ..zeroed() };
        self.ioctl(vidioc::VIDIOC_G_PARM, &mut parameters)?;
        // SAFETY: capture parameters are in `capture`.
        let interval = unsafe { parameters.parm.capture.timeperframe };
        Ok((interval.numerator, interval.denominator))
    }

    /// Requests a time per frame; the driver takes the nearest that it supports.
    pub(super) fn set_interval(&self, (numerator, denominator): (u32, u32)) -> io::Result<()> {
        let mut parameters = sys::v4l2_streamparm { type_: CAPTURE, ..zeroed() };
        parameters.parm.capture.timeperframe = sys::v4l2_fract { numerator, denominator };
        self.ioctl(vidioc::VIDIOC_S_PARM, &mut parameters)
    }

    /// The control that follows `id`, controls of several values included; `None` after the last.
    pub(super) fn control_after(&self, id: u32) -> io::Result<Option<sys::v4l2_query_ext_ctrl>> {
        let next = sys::V4L2_CTRL_FLAG_NEXT_CTRL | sys::V4L2_CTRL_FLAG_NEXT_COMPOUND;
        let mut control = sys::v4l2_query_ext_ctrl { id: id | next, ..zeroed() };
        end_of_list(self.ioctl(vidioc::VIDIOC_QUERY_EXT_CTRL, &mut control).map(|()| control))
    }

    /// Name of a menu control's item, or its number as text; `None` where the menu has a gap.
    pub(super) fn menu_item(&self, id: u32, index: u32, is_integer: bool) -> io::Result<Option<String>> {
        let mut item = sys::v4l2_querymenu { id, index, ..zeroed() };
        let name = self.ioctl(vidioc::VIDIOC_QUERYMENU, &mut item).map(|()| {
            // The structure is packed: its members are copied, not borrowed.
            let content = item.__bindgen_anon_1;
            // SAFETY: integer menus have a value, the others a name.
            unsafe { if is_integer { { content.value }.to_string() } else { text(&{ content.name }) } }
        });
        end_of_list(name)
    }

    /// Value of an integer control of any width.
    pub(super) fn control(&self, id: u32, is_wide: bool) -> io::Result<i64> {
        let mut control = sys::v4l2_ext_control { id, ..zeroed() };
        let mut list = sys::v4l2_ext_controls { count: 1, controls: &raw mut control, ..zeroed() };
        self.ioctl(vidioc::VIDIOC_G_EXT_CTRLS, &mut list)?;
        let value = control.__bindgen_anon_1;
        // SAFETY: 64-bit controls are in `value64`, the others in `value`.
        Ok(unsafe { if is_wide { value.value64 } else { i64::from(value.value) } })
    }

    /// Sets an integer control; `value` must fit the control's range, which has 32 bits unless it is wide.
    pub(super) fn set_control(&self, id: u32, value: i64) -> io::Result<()> {
        let mut control = sys::v4l2_ext_control { id, ..zeroed() };
        // The low half of a little-endian 64-bit value is the 32-bit one; on big-endian machines it is not.
        #[cfg(target_endian = "big")]
        compile_error!("set 32-bit controls through `value` on big-endian machines");
        control.__bindgen_anon_1.value64 = value;
        let mut list = sys::v4l2_ext_controls { count: 1, controls: &raw mut control, ..zeroed() };
        self.ioctl(vidioc::VIDIOC_S_EXT_CTRLS, &mut list)
    }

    /// Waits for a buffer, an error or the end of `patience`; returns the events of `poll`, 0 for none.
    fn wait(&self, patience: Duration) -> io::Result<libc::c_short> {
        let mut poll = libc::pollfd { fd: self.file.as_raw_fd(), events: libc::POLLIN, revents: 0 };
        let patience_ms = i32::try_from(patience.as_millis()).unwrap_or(i32::MAX);
        // SAFETY: one structure, as the count says.
        match unsafe { libc::poll(&raw mut poll, 1, patience_ms) } {
            -1 => match io::Error::last_os_error() {
                error if error.kind() == io::ErrorKind::Interrupted => Ok(0),
                error => Err(error),
            },
            _ => Ok(poll.revents),
        }
    }
}

/// Smallest and largest frame size, in columns and rows, that one entry of a driver's list stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SizeRange {
    pub(super) least: [u32; 2],
    pub(super) most: [u32; 2],
}

const CAPTURE: u32 = sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE;
const MAPPED: u32 = sys::v4l2_memory_V4L2_MEMORY_MMAP;

/// A C structure of zeros, which the kernel requires of unused members.
fn zeroed<T: Kernel>() -> T {
    // SAFETY: `Kernel` is implemented for structures of plain numbers and null pointers only.
    unsafe { mem::zeroed() }
}

/// Marks the kernel's structures for which all bytes zero is a valid value.
trait Kernel {}
impl Kernel for sys::v4l2_capability {}
impl Kernel for sys::v4l2_fmtdesc {}
impl Kernel for sys::v4l2_frmsizeenum {}
impl Kernel for sys::v4l2_frmivalenum {}
impl Kernel for sys::v4l2_format {}
impl Kernel for sys::v4l2_pix_format {}
impl Kernel for sys::v4l2_streamparm {}
impl Kernel for sys::v4l2_query_ext_ctrl {}
impl Kernel for sys::v4l2_querymenu {}
impl Kernel for sys::v4l2_ext_control {}
impl Kernel for sys::v4l2_ext_controls {}
impl Kernel for sys::v4l2_requestbuffers {}
impl Kernel for sys::v4l2_buffer {}

/// A pixel format to request; everything else is left to the driver.
pub(super) fn pix_format(fourcc: [u8; 4], [width, height]: [u32; 2]) -> sys::v4l2_pix_format {
    sys::v4l2_pix_format { width, height, pixelformat: u32::from_le_bytes(fourcc), ..zeroed() }
}

/// Lists end with EINVAL; drivers that have no such list return ENOTTY.
fn end_of_list<T>(entry: io::Result<T>) -> io::Result<Option<T>> {
    match entry {
        Ok(entry) => Ok(Some(entry)),
        Err(error) if matches!(error.raw_os_error(), Some(libc::EINVAL | libc::ENOTTY)) => Ok(None),
        Err(error) => Err(error),
    }
}

/// A C string in an array that may lack the terminating zero.
pub(super) fn text<T: Copy + Into<i64>>(chars: &[T]) -> String {
    let bytes: Vec<u8> = chars.iter().map(|&char| char.into() as u8).take_while(|&byte| byte != 0).collect();
    String::from_utf8_lossy(&bytes).trim().to_owned()
}

/// Buffers of a device, shared with it, while it streams. Dropping ends the streaming and returns the
/// buffers, whatever the driver answers.
#[derive(Debug)]
pub(super) struct Stream {
    node: Node,
    mappings: Vec<Mapping>,
}

/// A filled buffer; we own its bytes until it is queued again, which consumes it.
#[derive(Debug)]
pub(super) struct Buffer {
    index: u32,
    bytes_used: usize,
    /// The driver says that the content is damaged.
    pub(super) is_faulty: bool,
    /// The driver's count of frames.
    pub(super) sequence: u32,
    /// Time of capture on the kernel's monotonic clock; `None` when the driver uses another clock.
    pub(super) time_ns: Option<i64>,
}

impl Stream {
    /// Requests `count` buffers, queues all that the driver allocates and starts the stream.
    pub(super) fn start(node: Node, count: u32) -> io::Result<Self> {
        let mut request = sys::v4l2_requestbuffers { count, type_: CAPTURE, memory: MAPPED, ..zeroed() };
        node.ioctl(vidioc::VIDIOC_REQBUFS, &mut request)?;
        let mut stream = Self { node, mappings: Vec::new() };
        for index in 0..request.count {
            let mut buffer = description(index);
            stream.node.ioctl(vidioc::VIDIOC_QUERYBUF, &mut buffer)?;
            stream.mappings.push(Mapping::new(&stream.node, &buffer)?);
        }
        for index in 0..request.count {
            stream.node.ioctl(vidioc::VIDIOC_QBUF, &mut description(index))?;
        }
        stream.node.ioctl(vidioc::VIDIOC_STREAMON, &mut { CAPTURE })?;
        Ok(stream)
    }

    /// The device, for its controls.
    pub(super) fn node(&self) -> &Node {
        &self.node
    }

    /// Gives a buffer back to the driver.
    pub(super) fn queue(&mut self, buffer: Buffer) -> io::Result<()> {
        self.node.ioctl(vidioc::VIDIOC_QBUF, &mut description(buffer.index))
    }

    /// Waits at most `patience` for a filled buffer; `None`: there was none.
    pub(super) fn dequeue(&mut self, patience: Duration) -> io::Result<Option<Buffer>> {
        let events = self.node.wait(patience)?;
        if events == 0 {
            return Ok(None);
        }
        let mut buffer = description(0);
        match self.node.ioctl(vidioc::VIDIOC_DQBUF, &mut buffer) {
            Ok(()) => {}
            // A spurious wake-up; but a stream that only reports an error would wake us without end.
            Err(error) if error.kind() == io::ErrorKind::WouldBlock && events & libc::POLLERR == 0 => {
                return Ok(None);
            }
            Err(error) => return Err(error),
        }
        if self.mappings.get(buffer.index as usize).is_none() {
            return Err(io::Error::other(format!(
                "the driver gave buffer {}, which it never had",
                buffer.index
            )));
        }
        let is_monotonic =
            buffer.flags & sys::V4L2_BUF_FLAG_TIMESTAMP_MASK == sys::V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
        // A driver may report any time.
        let microseconds =
            buffer.timestamp.tv_sec.saturating_mul(1_000_000).saturating_add(buffer.timestamp.tv_usec);
        let time_ns = microseconds.saturating_mul(1000);
        Ok(Some(Buffer {
            index: buffer.index,
            bytes_used: buffer.bytesused as usize,
            is_faulty: buffer.flags & sys::V4L2_BUF_FLAG_ERROR != 0,
            sequence: buffer.sequence,
            time_ns: is_monotonic.then_some(time_ns),
        }))
    }

    /// What the driver has filled of a buffer.
    pub(super) fn bytes(&self, buffer: &Buffer) -> &[u8] {
        let bytes = self.mappings[buffer.index as usize].bytes();
        &bytes[..buffer.bytes_used.min(bytes.len())]
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        // The device may be gone. Buffers can be returned only when they are not mapped; closing the node
        // frees them in any case.
        let _ = self.node.ioctl(vidioc::VIDIOC_STREAMOFF, &mut { CAPTURE });
        self.mappings.clear();
        let mut none = sys::v4l2_requestbuffers { type_: CAPTURE, memory: MAPPED, ..zeroed() };
        let _ = self.node.ioctl(vidioc::VIDIOC_REQBUFS, &mut none);
    }
}

fn description(index: u32) -> sys::v4l2_buffer {
    sys::v4l2_buffer { index, type_: CAPTURE, memory: MAPPED, ..zeroed() }
}

/// Memory of a buffer.
#[derive(Debug)]
struct Mapping {
    start: NonNull<u8>,
    length: usize,
}

// SAFETY: the memory belongs to the process, not to a thread.
unsafe impl Send for Mapping {}

impl Mapping {
    fn new(node: &Node, buffer: &sys::v4l2_buffer) -> io::Result<Self> {
        let length = buffer.length as usize;
        // SAFETY: a new mapping at an address of the kernel's choice; buffers for mapping are described by
        // `offset`.
        let start = unsafe {
            let offset = libc::off_t::from(buffer.m.offset);
            v4l2::mmap(
                ptr::null_mut(),
                length,
                libc::PROT_READ,
                libc::MAP_SHARED,
                node.file.as_raw_fd(),
                offset,
            )?
        };
        let start = NonNull::new(start.cast()).ok_or_else(|| io::Error::other("a buffer at address 0"))?;
        Ok(Self { start, length })
    }

    fn bytes(&self) -> &[u8] {
        // SAFETY: mapped in `new` and unmapped in `drop`; by V4L2's rules the driver does not write to a
        // dequeued buffer, and only dequeued buffers are read. Readers rely on the length only, so a driver
        // that breaks the rule (v4l2loopback, when its writer is faster than the reader) causes no more than
        // a torn picture.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), self.length) }
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: this is what `new` mapped. `munmap` can fail only for addresses that were never mapped.
        let _ = unsafe { v4l2::munmap(self.start.as_ptr().cast(), self.length) };
    }
}
