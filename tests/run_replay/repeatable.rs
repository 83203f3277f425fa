use crate::recording::{Recording, lists, names, stderr};
use std::fs;
use std::io::{BufRead, BufReader, Read};

#[test]
fn replay_gives_the_same_bytes_on_every_run() {
    let recording = Recording::new(30);
    let first = recording.run();
    assert!(first.status.success(), "{}", stderr(&first));
    let found = lists(&first.stdout);
    assert_eq!(found.len(), 30);
    for (index, list) in found.iter().enumerate() {
        assert_eq!(list["sequence"], index);
        assert_eq!(list["capture_time_ns"], index as u64 * 40_000_000);
        assert_eq!(list["lost_before"], 0);
        assert_eq!(list["lights"].as_array().unwrap().len(), 24);
    }
    assert_ne!(found[10]["lights"], found[20]["lights"], "the sun moves");
    for _ in 0..2 {
        assert!(recording.run().stdout == first.stdout, "the bytes differ");
    }
}

#[test]
fn replay_gives_the_same_bytes_whatever_the_timing_of_the_threads() {
    let recording = Recording::new(30);
    let fast = recording.run().stdout;

    // Paced by the real clock, every stage waits for the previous one; the frame rate in the lists is still
    // 25 Hz.
    recording.configure("pace = \"real-time\"");
    let paced = recording.run();
    assert!(paced.stdout == fast, "the bytes differ at the sequence's own rate");
    assert_eq!(lists(&fast).len(), 30);

    // With a reader that takes one line at a time every stage waits for the next one.
    recording.configure("pace = \"fast\"");
    let mut child = recording.command().spawn().unwrap();
    let mut reader = BufReader::with_capacity(64, child.stdout.take().unwrap());
    let mut slow = Vec::new();
    while reader.read_until(b'\n', &mut slow).unwrap() > 0 {
        std::thread::yield_now();
    }
    assert!(child.wait().unwrap().success());
    assert!(slow == fast, "the bytes differ behind a slow reader");
}

#[test]
fn live_links_drop_frames_but_account_for_them() {
    let recording = Recording::new(30);
    recording.configure("pace = \"fast\"\nlinks = \"live\"");
    let output = recording.run();
    assert!(output.status.success(), "{}", stderr(&output));
    let found = lists(&output.stdout);
    let mut next = 0;
    for list in &found {
        let (sequence, lost) = (list["sequence"].as_u64().unwrap(), list["lost_before"].as_u64().unwrap());
        assert_eq!(sequence, next + lost, "every gap is told");
        next = sequence + 1;
    }
    assert_eq!(next, 30, "the last frame always arrives");
}

#[test]
fn a_file_gets_what_standard_output_would() {
    let recording = Recording::new(6);
    let expected = recording.run().stdout;
    let file = recording.path().join("lists.jsonl");
    let output = recording.command().arg("--output").arg(&file).output().unwrap();
    assert!(output.status.success() && output.stdout.is_empty());
    assert!(fs::read(&file).unwrap() == expected);
    let summary = stderr(&output);
    for stage in ["source", "calibrate", "light", "filter", "publish"] {
        let line = summary.lines().find(|line| line.starts_with(stage)).unwrap();
        let columns: Vec<&str> = line.split_whitespace().collect();
        assert_eq!(columns[1..4], ["6", "0", "0"], "frames, drops, bad frames of {stage}");
    }
    assert!(
        summary.contains(
            "0 pixels saturated, 0 pixels black-clipped, 0 pixels NaN, 0 pixels infinite, 0 pixels negative"
        ),
        "{summary}"
    );
}

#[test]
fn a_reader_that_goes_ends_the_run_without_an_error() {
    let recording = Recording::new(6);
    recording.configure("pace = \"fast\"\nrepeat = true");
    let mut child = recording.command().spawn().unwrap();
    let mut reader = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    reader.read_line(&mut line).unwrap();
    drop(reader);
    let mut messages = String::new();
    child.stderr.take().unwrap().read_to_string(&mut messages).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{messages}");
    assert!(!messages.contains("ERROR"), "{messages}");
}

#[test]
fn pictures_are_drawn_of_every_so_many_maps() {
    let recording = Recording::new(12);
    let expected = recording.run().stdout;
    let folder = recording.path().join("pictures");
    let output =
        recording.command().args(["--picture-every", "4", "--pictures"]).arg(&folder).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(output.stdout == expected, "pictures change nothing in the lists");
    // Maps 0 and 4; the list of map 8 would come 4 frames later, as list 12, which does not exist.
    let summary = stderr(&output);
    let line = summary.lines().find(|line| line.starts_with("picture")).unwrap();
    assert!(line.split_whitespace().nth(1) == Some("12"), "it looks at every list: {summary}");
    // The numbers are those of the lists that describe these maps, four frames later, and of the frames that
    // `render` draws from them.
    assert_eq!(names(&folder), ["map_00004.png", "map_00008.png", "scene_00004.png", "scene_00008.png"]);
}
