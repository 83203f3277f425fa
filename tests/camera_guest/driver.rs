//! Preconditions of the other checks: the drivers carry pictures unchanged, and every fault can be injected.
//! Only the `v4l` crate is used, so that a failure here is not one of the product.

use crate::frames::noise;
use crate::kernel::Layout;
use crate::loopback::{self, Loopback};
use crate::vivid::{self, Fault, Output};
use std::io;
use std::path::Path;
use std::time::Duration;
use v4l::buffer::{Flags, Metadata, Type};
use v4l::io::mmap::Stream;
use v4l::io::traits::CaptureStream;
use v4l::video::Capture;
use v4l::{Device, Format, FourCC};

/// Long for 60 frames per second, even emulated on a busy machine.
const PATIENCE: Duration = Duration::from_secs(2);

const ENODEV: i32 = 19;
const EINVAL: i32 = 22;
const EIO: i32 = 5;

fn stream(device: &Device) -> io::Result<Stream<'static>> {
    let mut stream = Stream::with_buffers(device, Type::VideoCapture, 8)?;
    stream.set_timeout(PATIENCE);
    Ok(stream)
}

/// A fresh vivid, capturing its own test pattern.
fn pattern() -> Device {
    vivid::fresh();
    let device = Device::with_path(vivid::capture_path().unwrap()).unwrap();
    let format = device.set_format(&Format::new(640, 480, FourCC::new(b"Y12 "))).unwrap();
    assert_eq!((format.width, format.height, format.stride), (640, 480, 1280));
    device
}

fn next(stream: &mut Stream) -> io::Result<Metadata> {
    CaptureStream::next(stream).map(|(_, metadata)| *metadata)
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn loopback_carries_16_bits() {
    let layout = Layout::two_bytes(b"Y16 ", 1024, 1024);
    let mut camera = Loopback::open(layout);
    let device = Device::with_path(loopback::path()).unwrap();
    // The driver has no format for readers before the first picture.
    assert_eq!(device.format().unwrap_err().raw_os_error(), Some(EINVAL));
    let first = noise(layout, 0, 0xffff);
    camera.write(first);
    let format = device.format().unwrap();
    assert_eq!((format.stride, format.size), (layout.stride, layout.size));
    let mut stream = stream(&device).unwrap();
    for number in 0..6 {
        let written = noise(layout, number, 0xffff);
        if number > 0 {
            camera.write(written);
        }
        let (bytes, metadata) = stream.next().unwrap();
        assert_eq!((metadata.sequence, metadata.bytesused), (number, layout.size));
        assert!(&bytes[..layout.size as usize] == written, "picture {number} is another one");
    }
    // A picture that is too short is passed on unchanged.
    camera.write(&first[..1000]);
    assert_eq!(next(&mut stream).unwrap().bytesused, 1000);
}

/// Shows pictures one by one, each until it is captured.
fn loop_carries(layout: Layout, mask: u16) {
    vivid::fresh();
    let mut output = Output::open(layout);
    let device = Device::with_path(vivid::capture_path().unwrap()).unwrap();
    let asked = Format {
        stride: layout.stride,
        ..Format::new(layout.width, layout.height, FourCC::new(&layout.four_cc))
    };
    let format = device.set_format(&asked).unwrap();
    assert_eq!(
        (format.fourcc.repr, format.stride, format.size),
        (layout.four_cc, layout.stride, layout.size)
    );
    let pictures: Vec<_> = (0..6).map(|seed| noise(layout, seed, mask)).collect();
    output.show(pictures[0]);
    let mut stream = stream(&device).unwrap();
    for number in 1..pictures.len() {
        output.show(pictures[number]);
        loop {
            let (bytes, metadata) = stream.next().unwrap();
            assert_eq!(metadata.bytesused, layout.size);
            if rows_equal(bytes, pictures[number], layout) {
                break;
            }
            assert!(
                rows_equal(bytes, pictures[number - 1], layout),
                "neither picture {number} nor the one before"
            );
        }
    }
}

/// Whether two pictures have the same pixels; padding after the end of a row is ignored.
fn rows_equal(one: &[u8], other: &[u8], layout: Layout) -> bool {
    let stride = layout.stride as usize;
    let row = 2 * layout.width as usize;
    (0..layout.height as usize).all(|y| one[y * stride..][..row] == other[y * stride..][..row])
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn loop_carries_grey_of_12_bits() {
    loop_carries(Layout::two_bytes(b"Y12 ", 1280, 720), 0x0fff);
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn loop_carries_bayer_of_12_bits() {
    loop_carries(Layout::two_bytes(b"RG12", 1280, 720), 0x0fff);
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn loop_carries_padded_rows() {
    let tight = Layout::two_bytes(b"RG12", 1280, 720);
    loop_carries(Layout { stride: 2624, size: 2624 * 720, ..tight }, 0x0fff);
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn fault_of_one_buffer_is_flagged() {
    let device = pattern();
    let mut stream = stream(&device).unwrap();
    assert!(!next(&mut stream).unwrap().flags.contains(Flags::ERROR));
    vivid::inject(Fault::BufferError);
    let flagged: Vec<bool> =
        (0..24).map(|_| next(&mut stream).unwrap().flags.contains(Flags::ERROR)).collect();
    assert_eq!(flagged.iter().filter(|flagged| **flagged).count(), 1, "{flagged:?}");
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn fault_of_dropping_shows_in_the_numbers() {
    let device = pattern();
    vivid::inject(Fault::DroppedPercent(50));
    let mut stream = stream(&device).unwrap();
    let numbers: Vec<u32> = (0..24).map(|_| next(&mut stream).unwrap().sequence).collect();
    assert!(numbers[23] - numbers[0] > 30, "{numbers:?}");
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn fault_of_silence_runs_into_the_timeout() {
    let device = pattern();
    let mut stream = stream(&device).unwrap();
    next(&mut stream).unwrap();
    vivid::inject(Fault::DroppedPercent(100));
    let error = (0..24).find_map(|_| next(&mut stream).err()).unwrap();
    assert_eq!(error.kind(), io::ErrorKind::TimedOut);
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn faults_of_starting_are_over_with_a_new_stream() {
    let device = pattern();
    vivid::inject(Fault::RequestBuffers);
    assert_eq!(stream(&device).err().unwrap().raw_os_error(), Some(EINVAL));
    for fault in [Fault::StreamOn, Fault::Queue] {
        vivid::inject(fault);
        assert_eq!(
            next(&mut stream(&device).unwrap()).err().unwrap().raw_os_error(),
            Some(EINVAL),
            "{fault:?}"
        );
        next(&mut stream(&device).unwrap()).unwrap();
    }
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn fatal_fault_lasts_until_a_new_stream() {
    let device = pattern();
    let mut broken = stream(&device).unwrap();
    next(&mut broken).unwrap();
    vivid::inject(Fault::Fatal);
    let error = (0..24).find_map(|_| next(&mut broken).err()).unwrap();
    assert_eq!(error.raw_os_error(), Some(EIO));
    assert_eq!(next(&mut broken).err().unwrap().raw_os_error(), Some(EIO));
    drop(broken);
    next(&mut stream(&device).unwrap()).unwrap();
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn disconnected_device_keeps_its_node() {
    let device = pattern();
    let path = vivid::capture_path().unwrap();
    let mut broken = stream(&device).unwrap();
    next(&mut broken).unwrap();
    vivid::inject(Fault::Disconnect);
    let error = (0..24).find_map(|_| next(&mut broken).err()).unwrap();
    assert_eq!(error.raw_os_error(), Some(ENODEV));
    assert_eq!(Device::with_path(&path).err().unwrap().raw_os_error(), Some(ENODEV));
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn unplugged_device_comes_back_under_another_number() {
    let device = pattern();
    let path = vivid::capture_path().unwrap();
    let bus = device.query_caps().unwrap().bus;
    let mut broken = stream(&device).unwrap();
    next(&mut broken).unwrap();
    vivid::unplug();
    let error = (0..24).find_map(|_| next(&mut broken).err()).unwrap();
    assert_eq!(error.raw_os_error(), Some(ENODEV));
    assert!(!Path::exists(&path));
    // The number is in use as long as the old device is open.
    vivid::plug();
    let new = vivid::capture_path().unwrap();
    assert_ne!(new, path);
    assert_eq!(Device::with_path(&new).unwrap().query_caps().unwrap().bus, bus);
}
