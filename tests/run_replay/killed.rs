//! A program that is killed in the middle of a recording.

use crate::recording::{Recording, lightcast, lists, names, stderr};
use lightcast::rt::Shutdown;
use std::fs;
use std::time::Duration;

#[test]
fn a_recording_plays_to_the_last_whole_frame_before_its_program_was_killed() {
    let source = Recording::new(20);
    source.configure("pace = \"real-time\"\nrepeat = true");
    // Beside the frames that are recorded.
    let replay = Recording::new(0);
    let folder = replay.path().join("frames");
    let frames = || {
        let is_frame = |name: &String| name.starts_with("frame.") && name.ends_with(".exr");
        if folder.exists() { names(&folder).into_iter().filter(is_frame).count() } else { 0 }
    };
    let mut command = lightcast();
    command.arg("record").arg(source.configuration()).arg("--output").arg(&folder);
    let mut child = command.spawn().unwrap();
    while frames() < 8 {
        assert!(child.try_wait().unwrap().is_none(), "the sequence has no end");
        Shutdown::new().wait(Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let written = frames();
    let sidecar: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.join("recording.json")).unwrap()).unwrap();
    assert_eq!(sidecar["is_complete"], false, "{sidecar}");

    let text = fs::read_to_string(replay.configuration()).unwrap();
    fs::write(replay.configuration(), text.replace("sky.####.exr", "frames/")).unwrap();
    let run = replay.run();
    assert!(run.status.success(), "{}", stderr(&run));
    let found = lists(&run.stdout);
    assert_eq!(found.len(), written, "{}", stderr(&run));
    for (number, list) in found.iter().enumerate() {
        assert_eq!((&list["sequence"], &list["lost_before"]), (&number.into(), &0.into()), "{list}");
    }
}
