use crate::recording::{Recording, lists, panorama, stderr};
use lightcast::files::write_exr;
use lightcast_core::image::Pixels;
use std::fs;
use std::path::Path;

/// Checks that if frame 4, called `name`, is unusable, the others are delivered, and frame 5 reports one lost
/// frame.
fn frame_4_is_lost(recording: &Recording, expected: &str) {
    let output = recording.run();
    let messages = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{messages}");
    let stamps: Vec<(u64, u64)> = lists(&output.stdout)
        .iter()
        .map(|list| (list["sequence"].as_u64().unwrap(), list["lost_before"].as_u64().unwrap()))
        .collect();
    assert_eq!(stamps, [(0, 0), (1, 0), (2, 0), (3, 0), (5, 1), (6, 0), (7, 0), (8, 0), (9, 0)]);
    let named: Vec<&str> = messages.lines().filter(|line| line.contains("sky.0004.exr")).collect();
    assert_eq!(named.len(), 1, "named once: {messages}");
    assert!(named[0].contains(expected), "{}", named[0]);
    let source = messages.lines().find(|line| line.starts_with("source")).unwrap();
    assert_eq!(source.split_whitespace().nth(3), Some("1"), "counted: {messages}");
}

fn truncate(file: &Path) {
    let content = fs::read(file).unwrap();
    fs::write(file, &content[..content.len() / 2]).unwrap();
}

#[test]
fn a_truncated_file_in_the_middle_is_counted_and_named_and_the_run_goes_on() {
    let recording = Recording::new(10);
    truncate(&recording.file(4));
    frame_4_is_lost(&recording, "sky.0004.exr");
}

#[test]
fn a_file_that_is_no_openexr_in_the_middle_is_counted_and_named_and_the_run_goes_on() {
    let recording = Recording::new(10);
    fs::write(recording.file(4), "this is a text").unwrap();
    frame_4_is_lost(&recording, "neither OpenEXR");
}

#[test]
fn a_file_of_the_wrong_size_in_the_middle_is_counted_and_named_and_the_run_goes_on() {
    let recording = Recording::new(10);
    write_exr(&recording.file(4), &panorama(24, 12, 4), Some(25.0), false).unwrap();
    frame_4_is_lost(&recording, "24 x 12");
}

#[test]
fn nan_negative_and_overflowed_half_pixels_of_a_file_are_counted_and_never_leave() {
    let recording = Recording::new(6);
    let mut frame = panorama(48, 24, 3);
    let Pixels::Radiance(values) = &mut frame.pixels else { panic!("codes") };
    // Pixels of the upper half, which the map covers; 1e6 exceeds the range of half floats.
    for (row, column, value) in [(2, 7, f32::NAN), (3, 40, 1e6), (4, 0, -2.0), (11, 47, f32::NEG_INFINITY)] {
        values[3 * (row * 48 + column) + 1] = value;
    }
    write_exr(&recording.file(3), &frame, Some(25.0), true).unwrap();
    let output = recording.run();
    let summary = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{summary}");
    assert!(summary.contains("1 pixels NaN, 0 pixels infinite, 2 pixels negative"), "{summary}");
    assert!(summary.contains("frame 3: 2 pixels negative"), "{summary}");
    assert!(summary.contains("1 samples beyond the numbers of their files"), "{summary}");
    let found = lists(&output.stdout);
    assert_eq!(found.len(), 6);
    // JSON has no NaN: it would be written as null.
    assert!(!String::from_utf8(output.stdout).unwrap().contains("null"));
    for list in &found {
        assert!(list["power"][1].as_f64().unwrap() > 0.0, "{list}");
    }
}

#[test]
fn all_three_at_once_are_told_to_the_next_frame() {
    let recording = Recording::new(10);
    truncate(&recording.file(3));
    fs::write(recording.file(4), "this is a text").unwrap();
    fs::remove_file(recording.file(5)).unwrap();
    write_exr(&recording.file(6), &panorama(24, 12, 4), Some(25.0), false).unwrap();
    let output = recording.run();
    let found = lists(&output.stdout);
    assert_eq!(found.len(), 6);
    assert_eq!((found[3]["sequence"].as_u64(), found[3]["lost_before"].as_u64()), (Some(7), Some(4)));
}

#[test]
fn a_bad_file_of_a_repeated_sequence_is_named_once() {
    use std::io::{BufRead, BufReader, Read};
    let recording = Recording::new(4);
    truncate(&recording.file(2));
    recording.configure("pace = \"fast\"\nrepeat = true");
    let mut child = recording.command().spawn().unwrap();
    let mut reader = BufReader::new(child.stdout.take().unwrap());
    // 20 lists are more than six rounds of three good files.
    let mut line = String::new();
    for _ in 0..20 {
        assert!(reader.read_line(&mut line).unwrap() > 0);
    }
    drop(reader);
    let mut messages = String::new();
    child.stderr.take().unwrap().read_to_string(&mut messages).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(messages.matches("sky.0002.exr").count(), 1, "{messages}");
}

#[test]
fn a_sequence_without_a_readable_frame_names_its_pattern() {
    let recording = Recording::new(3);
    for number in 0..3 {
        fs::write(recording.file(number), "not a picture").unwrap();
    }
    let output = recording.run();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("sky.####.exr"), "{}", stderr(&output));
    assert!(output.stdout.is_empty());
}

#[test]
fn a_pattern_that_matches_nothing_is_named() {
    let recording = Recording::new(0);
    let output = recording.run();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("sky.####.exr"), "{}", stderr(&output));
}
