//! The product's camera alone: it captures what was written, and its description of the device is correct.

use crate::frames::{codes, lamp};
use crate::kernel::{Layout, Node};
use crate::live::{LOOPBACK, VIVID};
use crate::loopback::Loopback;
use crate::vivid::{self, Output};
use lightcast::error::Kind;
use lightcast::source::v4l2::{ControlKind, ControlValue, V4l2Camera, V4l2Options, devices};
use lightcast::source::{Captured, LiveCamera, Mark};
use lightcast_core::image::{Bayer, Frame, Pixels};
use std::time::Duration;

fn options(device: &str, format: &str, [width, height]: [u32; 2]) -> V4l2Options {
    V4l2Options {
        device: device.to_owned(),
        format: Some(format.to_owned()),
        size: Some([width, height]),
        ..V4l2Options::default()
    }
}

/// The next frame; a camera that delivers none within this time delivers none at all.
fn next(camera: &mut V4l2Camera, frame: &mut Frame) -> Mark {
    match camera.capture(Duration::from_secs(10), frame).unwrap() {
        Captured::Frame(mark) => mark,
        other => panic!("{other:?}"),
    }
}

fn codes_of(frame: &Frame) -> &[u16] {
    let Pixels::Codes(codes) = &frame.pixels else { panic!("radiance") };
    codes
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn capture_of_16_bits_is_what_was_written() {
    let layout = Layout::two_bytes(b"Y16 ", 1024, 1024);
    let mut writer = Loopback::open(layout);
    writer.write(lamp(layout, 0, 0xffff));
    let mut camera = V4l2Camera::open(options(LOOPBACK, "Y16", [1024, 1024])).unwrap();
    assert_eq!(camera.format().frame_rate_hz, 30.0);
    camera.start().unwrap();
    let mut frame = Frame::default();
    for number in 0..5 {
        let written = lamp(layout, number, 0xffff);
        if number > 0 {
            writer.write(written);
        }
        let mark = next(&mut camera, &mut frame);
        assert_eq!(mark.sequence, number);
        assert_eq!((frame.width, frame.height, frame.channels, frame.bayer), (1024, 1024, 1, None));
        assert!(codes_of(&frame) == codes(written, layout), "picture {number} is another one");
    }
    let nothing = camera.capture(Duration::from_millis(50), &mut frame).unwrap();
    assert_eq!(nothing, Captured::Nothing, "the writer rests");
}

/// Shows pictures one by one, each until it is captured.
fn capture_is_shown(layout: Layout, bayer: Option<Bayer>) {
    vivid::fresh();
    let mut output = Output::open(layout);
    let pictures: Vec<_> = (0..5).map(|number| lamp(layout, number, 0x0fff)).collect();
    output.show(pictures[0]);
    let format = std::str::from_utf8(&layout.four_cc).unwrap().trim_end();
    let mut camera = V4l2Camera::open(options(VIVID, format, [layout.width, layout.height])).unwrap();
    assert_eq!((camera.format().bayer, camera.format().frame_rate_hz), (bayer, 60.0));
    camera.start().unwrap();
    let mut frame = Frame::default();
    for number in 1..pictures.len() {
        output.show(pictures[number]);
        loop {
            next(&mut camera, &mut frame);
            assert_eq!((frame.channels, frame.bayer), (1, bayer));
            if codes_of(&frame) == codes(pictures[number], layout) {
                break;
            }
            assert!(
                codes_of(&frame) == codes(pictures[number - 1], layout),
                "neither picture {number} nor the one before"
            );
        }
    }
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn capture_of_12_bits_is_what_was_shown() {
    capture_is_shown(Layout::two_bytes(b"Y12 ", 1280, 720), None);
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn capture_of_a_mosaic_is_what_was_shown_with_the_right_colours() {
    capture_is_shown(Layout::two_bytes(b"RG12", 1280, 720), Some(Bayer::Rggb));
    let orders = [("BA12", Bayer::Grbg), ("GB12", Bayer::Gbrg), ("BG12", Bayer::Bggr), ("RG10", Bayer::Rggb)];
    for (format, bayer) in orders {
        let camera = V4l2Camera::open(options(VIVID, format, [160, 120])).unwrap();
        assert_eq!(camera.format().bayer, Some(bayer), "{format}");
    }
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn devices_are_listed_with_names_formats_and_controls() {
    vivid::fresh();
    let devices = devices();
    let device = devices.iter().find(|device| device.name == VIVID).unwrap();
    assert_eq!((device.card.as_str(), device.driver.as_str()), ("vivid", "vivid"));
    assert_eq!((&device.node, &device.unsupported), (&vivid::capture_path().unwrap(), &None));
    for (name, is_supported) in
        [("Y12", true), ("RG12", true), ("Y16-BE", true), ("YUYV", true), ("RGB3", false)]
    {
        let format = device.formats.iter().find(|format| format.name == name).unwrap();
        assert_eq!(format.is_supported, is_supported, "{name}");
        assert_eq!((format.sizes[0].least, format.sizes[0].most), ([16, 16], [16_384, 8640]), "{name}");
    }
    let control = |name: &str| device.controls.iter().find(|control| control.name == name).unwrap();
    let brightness = control("brightness");
    assert_eq!((brightness.minimum, brightness.maximum, brightness.value), (0, 255, Some(128)));
    assert_eq!(control("gain_automatic").kind, ControlKind::Switch);
    assert_eq!(control("osd_text_mode").items.values().collect::<Vec<_>>(), ["All", "Counters Only", "None"]);
    assert!(devices.iter().any(|device| device.name == LOOPBACK));
    // vivid has two devices; the output side of the first delivers no frames.
    assert_eq!(devices.iter().filter(|device| device.driver == "vivid").count(), 2);
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn a_camera_with_several_planes_only_is_named_as_unsupported() {
    vivid::fresh();
    let devices = devices();
    let device = devices.iter().find(|device| device.name == "platform:vivid-001").unwrap();
    assert!(device.unsupported.as_ref().is_some_and(|why| why.contains("multi-planar")), "{device:?}");
    let error = V4l2Camera::open(options("platform:vivid-001", "Y12", [160, 120])).unwrap_err();
    assert_eq!(error.kind(), Kind::Usage);
    assert!(error.to_string().contains("several planes only"), "{error}");
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn controls_are_set_and_wrong_wishes_refused_with_what_there_is() {
    vivid::fresh();
    let with = |name: &str, value| {
        let controls = [(name.to_owned(), value)].into();
        V4l2Options { controls, ..options(VIVID, "Y12", [160, 120]) }
    };
    V4l2Camera::open(with("brightness", ControlValue::Number(77))).unwrap();
    V4l2Camera::open(with("osd_text_mode", ControlValue::Item("none".to_owned()))).unwrap();
    V4l2Camera::open(with("gain_automatic", ControlValue::Switch(false))).unwrap();
    // A mask with the highest of 32 bits set.
    V4l2Camera::open(with("bitmask", ControlValue::Number(0x8000_0010))).unwrap();
    let device = devices().into_iter().find(|device| device.name == VIVID).unwrap();
    for (name, value) in
        [("brightness", 77), ("osd_text_mode", 2), ("gain_automatic", 0), ("bitmask", 0x8000_0010)]
    {
        let control = device.controls.iter().find(|control| control.name == name).unwrap();
        assert_eq!(control.value, Some(value), "{name}");
    }

    for (wrong, expected) in [
        (
            with("brihgtness", ControlValue::Number(7)),
            ["controls.brihgtness = 7: the camera has only", "brightness, "],
        ),
        (
            with("brightness", ControlValue::Number(256)),
            ["controls.brightness = 256: is not possible", "give 0 to 255"],
        ),
        (
            with("osd_text_mode", ControlValue::Item("some".into())),
            ["controls.osd_text_mode = \"some\": is not possible", "\"Counters Only\""],
        ),
        (
            options(VIVID, "Y13", [160, 120]),
            ["format = \"Y13\": cannot be captured", "the camera has YUYV, "],
        ),
        (options(VIVID, "MJPG", [160, 120]), ["format = \"MJPG\"", "it has YUYV, "]),
        (
            options(VIVID, "Y12", [8, 120]),
            ["size = [8, 120]: was made 16 x 120", "`lightcast devices` lists the sizes"],
        ),
        (
            V4l2Options { frame_rate_hz: Some(31.0), ..options(VIVID, "Y12", [160, 120]) },
            ["frame_rate_hz = 31", "60"],
        ),
    ] {
        let error = V4l2Camera::open(wrong).unwrap_err();
        assert_eq!(error.kind(), Kind::Usage, "{error}");
        let message = error.to_string();
        assert!(message.starts_with(VIVID), "{message}");
        for words in expected {
            assert!(message.contains(words), "'{words}' is not in: {message}");
        }
    }
    let error = V4l2Camera::open(options("no-such-camera", "Y12", [160, 120])).unwrap_err();
    assert_eq!(error.kind(), Kind::LostDevice);
    assert!(error.to_string().contains(VIVID), "{error}");
}

#[test]
#[ignore = "needs the guest: make test-camera"]
fn a_camera_in_use_is_a_lost_device() {
    vivid::fresh();
    let mut first = V4l2Camera::open(options(VIVID, "Y12", [160, 120])).unwrap();
    let mut second = V4l2Camera::open(options(VIVID, "Y12", [160, 120])).unwrap();
    first.start().unwrap();
    for error in
        [V4l2Camera::open(options(VIVID, "Y12", [160, 120])).unwrap_err(), second.start().unwrap_err()]
    {
        assert_eq!(error.kind(), Kind::LostDevice, "{error}");
        assert!(error.to_string().contains("another program"), "{error}");
        assert!(error.to_string().contains("os error 16"), "EBUSY, not: {error}");
    }
    first.stop();
    second.start().unwrap();
    next(&mut second, &mut Frame::default());
    // The number of the node is not used.
    assert!(Node::open(&vivid::capture_path().unwrap()).is_ok());
}
