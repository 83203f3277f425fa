use crate::recording::{Recording, lists};
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command};

fn send(signal: &str, child: &Child) {
    let status = Command::new("sh").args(["-c", &format!("kill -{signal} {}", child.id())]).status();
    assert!(status.unwrap().success());
}

/// Sends a signal to an endless run after ten lists: the run must end with code 0, and every list must be
/// complete.
fn ends_cleanly_on(signal: &str, source_lines: &str) {
    let recording = Recording::new(5);
    recording.configure(source_lines);
    let mut child = recording.command().spawn().unwrap();
    let mut reader = BufReader::new(child.stdout.take().unwrap());
    let mut bytes = Vec::new();
    for _ in 0..10 {
        reader.read_until(b'\n', &mut bytes).unwrap();
    }
    send(signal, &child);
    reader.read_to_end(&mut bytes).unwrap();
    let mut messages = String::new();
    child.stderr.take().unwrap().read_to_string(&mut messages).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{messages}");
    let found = lists(&bytes);
    assert!(found.len() >= 10);
    for (index, list) in found.iter().enumerate() {
        assert_eq!(list["sequence"], index, "nothing under way was lost");
        assert_eq!(list["lights"].as_array().unwrap().len(), 24);
    }
    let published = messages.lines().find(|line| line.starts_with("publish")).unwrap();
    assert_eq!(published.split_whitespace().nth(1), Some(found.len().to_string().as_str()), "{messages}");
}

#[test]
fn sigint_ends_an_endless_run_with_whole_lists() {
    ends_cleanly_on("INT", "pace = \"fast\"\nrepeat = true");
}

#[test]
fn sigterm_ends_a_run_that_waits_for_its_next_frame() {
    ends_cleanly_on("TERM", "pace = \"real-time\"\nrepeat = true");
}

#[test]
fn sigterm_ends_a_live_run() {
    let recording = Recording::new(5);
    recording.configure("pace = \"real-time\"\nrepeat = true\nlinks = \"live\"");
    let mut child = recording.command().spawn().unwrap();
    let mut reader = BufReader::new(child.stdout.take().unwrap());
    let mut bytes = Vec::new();
    reader.read_until(b'\n', &mut bytes).unwrap();
    send("TERM", &child);
    reader.read_to_end(&mut bytes).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert!(!lists(&bytes).is_empty());
}

#[test]
fn a_second_signal_ends_a_run_at_once_that_cannot_end_by_itself() {
    let recording = Recording::new(2);
    recording.configure("pace = \"fast\"");
    let text = std::fs::read_to_string(recording.configuration()).unwrap();
    std::fs::write(recording.configuration(), text.replace("count = 24", "count = 2000")).unwrap();
    let mut child = recording.command().spawn().unwrap();
    // A list of 2000 lights does not fit into a pipe: if only one byte is read, the writer blocks for ever.
    let mut reader = child.stdout.take().unwrap();
    reader.read_exact(&mut [0]).unwrap();
    send("INT", &child);
    let mut messages = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("a second signal stops at once") {
        line.clear();
        assert!(messages.read_line(&mut line).unwrap() > 0, "the run ended by itself");
    }
    send("INT", &child);
    assert_eq!(child.wait().unwrap().code(), Some(130));
    drop(reader);
}
