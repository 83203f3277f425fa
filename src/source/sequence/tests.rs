use super::*;
use crate::error::Kind;
use crate::files::{write_exr, write_png8, write_png16};
use std::fs;
use tempfile::TempDir;

/// A picture whose samples all equal its number.
fn picture(number: u64, width: usize, channels: usize) -> Frame {
    let values = vec![number as f32; width * 2 * channels];
    Frame { width, height: 2, channels, pixels: Pixels::Radiance(values), ..Frame::default() }
}

fn folder(numbers: &[u64], frame_rate_hz: Option<f64>) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for &number in numbers {
        let path = folder.path().join(format!("a.{number:04}.exr"));
        write_exr(&path, &picture(number, 4, 3), frame_rate_hz, true).unwrap();
    }
    folder
}

fn options(folder: &TempDir) -> SequenceOptions {
    SequenceOptions { path: folder.path().join("a.####.exr"), ..SequenceOptions::default() }
}

/// The results: (file number in the pixels, sequence, time in ms, lost before) or the message of an error.
fn play(options: &SequenceOptions, calls: usize) -> Vec<std::result::Result<(u64, u64, i64, u64), String>> {
    let mut sequence = Sequence::open(options).unwrap();
    let mut frame = Frame::default();
    let mut played = Vec::new();
    for _ in 0..calls {
        match sequence.next(&mut frame) {
            Ok(Next::End) => break,
            Ok(Next::Frame) => {
                let Pixels::Radiance(values) = &frame.pixels else { panic!("codes") };
                let stamp = frame.stamp;
                assert_eq!(stamp.capture_time_ns % 1_000_000, 0);
                let ms = stamp.capture_time_ns / 1_000_000;
                played.push(Ok((values[0] as u64, stamp.sequence, ms, stamp.lost_before)));
            }
            Err(error) => {
                assert_eq!(error.kind(), Kind::BadFrame);
                played.push(Err(error.to_string()));
            }
        }
    }
    played
}

fn refusal(options: &SequenceOptions, kind: Kind) -> String {
    let error = Sequence::open(options).unwrap_err();
    assert_eq!(error.kind(), kind, "{error}");
    error.to_string()
}

#[test]
fn gaps_are_lost_frames_and_time_follows_the_file_number() {
    let folder = folder(&[1001, 1002, 1005, 1006], Some(25.0));
    let expected =
        [Ok((1001, 1001, 0, 0)), Ok((1002, 1002, 40, 0)), Ok((1005, 1005, 160, 2)), Ok((1006, 1006, 200, 0))];
    assert_eq!(play(&options(&folder), 100), expected);
    let cut = SequenceOptions { first: Some(1002), last: Some(1005), ..options(&folder) };
    assert_eq!(play(&cut, 100), [Ok((1002, 1002, 0, 0)), Ok((1005, 1005, 120, 2))]);
    let by_folder = SequenceOptions { path: folder.path().to_owned(), ..SequenceOptions::default() };
    assert_eq!(play(&by_folder, 100), expected);
}

#[test]
fn end_stays_the_end() {
    let folder = folder(&[1], Some(25.0));
    let mut sequence = Sequence::open(&options(&folder)).unwrap();
    let mut frame = Frame::default();
    assert_eq!(sequence.next(&mut frame).unwrap(), Next::Frame);
    for _ in 0..3 {
        assert_eq!(sequence.next(&mut frame).unwrap(), Next::End);
    }
}

#[test]
fn corrupt_files_in_the_middle_are_named_counted_and_passed_over() {
    let folder = folder(&[1, 2, 3, 4, 5, 6, 7], Some(25.0));
    let file = |number: u64| folder.path().join(format!("a.{number:04}.exr"));
    let whole = fs::read(file(2)).unwrap();
    fs::write(file(2), &whole[..whole.len() - 3]).unwrap();
    fs::write(file(3), b"This is not a picture.").unwrap();
    write_exr(&file(5), &picture(5, 7, 3), None, true).unwrap();
    // Of the same size, but grey.
    write_exr(&file(6), &picture(6, 4, 1), None, true).unwrap();
    let played = play(&options(&folder), 100);
    assert_eq!(played.len(), 7);
    assert_eq!(played[0], Ok((1, 1, 0, 0)));
    assert!(played[1].as_ref().unwrap_err().contains("a.0002.exr: cannot be decoded as OpenEXR"));
    assert!(played[2].as_ref().unwrap_err().contains("a.0003.exr: is neither OpenEXR"));
    assert_eq!(played[3], Ok((4, 4, 120, 2)));
    let error = played[4].as_ref().unwrap_err();
    assert!(error.ends_with("a.0005.exr: is 7 x 2, and not 4 x 2 as the other frames"), "{error}");
    let error = played[5].as_ref().unwrap_err();
    assert!(error.contains("a.0006.exr: is 4 x 2 x 1 radiance, but "), "{error}");
    assert!(error.contains("a.0001.exr is 4 x 2 x 3 radiance"), "{error}");
    assert_eq!(played[6], Ok((7, 7, 240, 2)));
}

#[test]
fn bad_files_in_front_count_and_the_first_good_one_sets_the_format() {
    let folder = folder(&[1, 2, 3, 4], Some(50.0));
    fs::write(folder.path().join("a.0001.exr"), b"").unwrap();
    write_exr(&folder.path().join("a.0002.exr"), &picture(2, 4, 1), Some(50.0), false).unwrap();
    let format = Sequence::open(&options(&folder)).unwrap().format();
    assert_eq!((format.width, format.height, format.channels), (4, 2, 1));
    let played = play(&options(&folder), 100);
    assert!(played[0].as_ref().unwrap_err().ends_with("a.0001.exr: is empty"));
    assert_eq!(played[1], Ok((2, 2, 20, 1)));
    assert!(played[2].is_err() && played[3].is_err());
}

#[test]
fn repeated_sequences_go_on_counting() {
    let folder = folder(&[10, 11, 13], Some(25.0));
    fs::write(folder.path().join("a.0013.exr"), b"").unwrap();
    let looped = SequenceOptions { repeat: true, ..options(&folder) };
    let played = play(&looped, 6);
    assert_eq!(played[..2], [Ok((10, 10, 0, 0)), Ok((11, 11, 40, 0))]);
    // 12 is missing and 13 is bad: both are lost before the second pass begins at 14.
    assert!(played[2].is_err());
    assert_eq!(played[3..5], [Ok((10, 14, 160, 2)), Ok((11, 15, 200, 0))]);
    assert!(played[5].is_err());
}

#[test]
fn every_pass_of_a_loop_over_files_that_vanish_is_waited_for() {
    let folder = folder(&[1, 2], Some(25.0));
    let mut sequence = Sequence::open(&SequenceOptions { repeat: true, ..options(&folder) }).unwrap();
    let mut frame = Frame::default();
    sequence.next(&mut frame).unwrap();
    for number in [1, 2] {
        fs::remove_file(folder.path().join(format!("a.{number:04}.exr"))).unwrap();
    }
    let kinds: Vec<Kind> = (0..6).map(|_| sequence.next(&mut frame).unwrap_err().kind()).collect();
    let pass = [Kind::BadFrame, Kind::BadFrame, Kind::NotNow];
    assert_eq!(kinds, [pass, pass].concat());
}

#[test]
fn frame_rate_comes_from_the_configuration_then_the_file_and_is_never_guessed() {
    let silent = folder(&[1, 2], None);
    let error = refusal(&options(&silent), Kind::Usage);
    assert!(error.contains("a.####.exr") && error.contains("set frame_rate_hz"), "{error}");
    let set = SequenceOptions { frame_rate_hz: Some(10.0), ..options(&silent) };
    assert_eq!(play(&set, 9), [Ok((1, 1, 0, 0)), Ok((2, 2, 100, 0))]);
    let speaking = folder(&[1, 2], Some(50.0));
    let set = SequenceOptions { frame_rate_hz: Some(10.0), ..options(&speaking) };
    assert_eq!(Sequence::open(&set).unwrap().format().frame_rate_hz, 10.0);
    assert_eq!(Sequence::open(&options(&speaking)).unwrap().format().frame_rate_hz, 50.0);
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let set = SequenceOptions { frame_rate_hz: Some(rate), ..options(&speaking) };
        assert!(refusal(&set, Kind::Usage).contains("frame_rate_hz = "));
    }
}

#[test]
fn one_picture_needs_no_rate_unless_it_is_repeated() {
    let folder = folder(&[7], None);
    let still = SequenceOptions { path: folder.path().join("a.0007.exr"), ..SequenceOptions::default() };
    assert_eq!(play(&still, 9), [Ok((7, 7, 0, 0))]);
    assert_eq!(Sequence::open(&still).unwrap().format().frame_rate_hz, 0.0);
    let looped = SequenceOptions { repeat: true, ..still };
    assert!(refusal(&looped, Kind::Usage).contains("set frame_rate_hz"));
    let looped = SequenceOptions { frame_rate_hz: Some(20.0), ..looped };
    assert_eq!(play(&looped, 3), [Ok((7, 7, 0, 0)), Ok((7, 8, 50, 0)), Ok((7, 9, 100, 0))]);
}

#[test]
fn nothing_to_play_is_an_error_that_names_the_pattern() {
    let folder = folder(&[5, 6], Some(25.0));
    let missing = SequenceOptions { path: folder.path().join("b.####.exr"), ..SequenceOptions::default() };
    assert!(refusal(&missing, Kind::Usage).contains("b.####.exr: no file"));
    let outside = SequenceOptions { first: Some(7), last: Some(9), ..options(&folder) };
    assert!(refusal(&outside, Kind::Usage).contains("within first = 7 last = 9; they have 5 to 6"));
    for number in [5, 6] {
        fs::write(folder.path().join(format!("a.{number:04}.exr")), b"v/1\x01").unwrap();
    }
    let error = refusal(&options(&folder), Kind::Failed);
    assert!(error.contains("a.####.exr: none of 2 files can be used: "), "{error}");
    assert!(error.contains("a.0005.exr: cannot be decoded"), "{error}");
}

#[test]
fn sensor_codes_play_and_a_picture_of_another_kind_among_them_does_not() {
    let folder = tempfile::tempdir().unwrap();
    for number in [0_u16, 1] {
        let frame = Frame {
            width: 2,
            height: 1,
            channels: 1,
            pixels: Pixels::Codes(vec![number, 4095]),
            ..Frame::default()
        };
        write_png16(&folder.path().join(format!("raw_{number}.png")), &frame).unwrap();
    }
    write_png8(&folder.path().join("raw_2.png"), 2, 1, &[0; 6]).unwrap();
    let options = SequenceOptions {
        path: folder.path().to_owned(),
        frame_rate_hz: Some(1000.0),
        ..SequenceOptions::default()
    };
    let mut sequence = Sequence::open(&options).unwrap();
    let expected = FrameFormat {
        width: 2,
        height: 1,
        channels: 1,
        bayer: None,
        is_codes: true,
        latlong_centres: LatLongCentres::Half,
        frame_rate_hz: 1000.0,
    };
    assert_eq!((sequence.format(), sequence.file_count()), (expected, 3));
    let mut frame = Frame::default();
    for number in [0, 1] {
        sequence.next(&mut frame).unwrap();
        assert_eq!(frame.pixels, Pixels::Codes(vec![number, 4095]));
    }
    assert_eq!(sequence.next(&mut frame).unwrap_err().kind(), Kind::BadFrame);
    assert_eq!(sequence.next(&mut frame).unwrap(), Next::End);
}

#[test]
fn grey_codes_are_a_mosaic_where_the_options_say_so_and_nothing_else_is() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |channels: usize| Frame {
        width: 2,
        height: 2,
        channels,
        pixels: Pixels::Codes(vec![7; 4 * channels]),
        ..Frame::default()
    };
    for (number, channels) in [(0, 1), (1, 3), (2, 1)] {
        write_png16(&folder.path().join(format!("raw_{number}.png")), &picture(channels)).unwrap();
    }
    let options = SequenceOptions {
        path: folder.path().to_owned(),
        frame_rate_hz: Some(25.0),
        bayer: Some(Bayer::Gbrg),
        ..SequenceOptions::default()
    };
    let mut sequence = Sequence::open(&options).unwrap();
    assert_eq!(sequence.format().bayer, Some(Bayer::Gbrg));
    let mut frame = Frame::default();
    assert_eq!(sequence.next(&mut frame).unwrap(), Next::Frame);
    assert_eq!((frame.bayer, frame.channels), (Some(Bayer::Gbrg), 1));
    let message = sequence.next(&mut frame).unwrap_err().to_string();
    assert!(message.contains("raw_1.png: is no mosaic of colours GBRG"), "{message}");
    assert_eq!(sequence.next(&mut frame).unwrap(), Next::Frame);
    assert_eq!(frame.bayer, Some(Bayer::Gbrg));

    let radiance = self::folder(&[1], Some(25.0));
    let options = SequenceOptions { bayer: Some(Bayer::Rggb), ..self::options(&radiance) };
    let message = refusal(&options, Kind::Failed);
    assert!(message.contains("none of 1 files can be used") && message.contains("no mosaic"), "{message}");
}
