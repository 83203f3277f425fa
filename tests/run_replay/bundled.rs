use crate::recording::{lightcast, lists, stderr};
use std::path::Path;

#[test]
fn the_bundled_sequence_plays_once_and_ends() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let output = lightcast().args(["run", "--config"]).arg(root.join("config/replay.toml")).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let found = lists(&output.stdout);
    assert!(found.len() >= 75, "at least 3 s at 25 Hz: {}", found.len());
    assert!(found.iter().all(|list| list["frame_rate_hz"] == 25.0 && list["lost_before"] == 0));
}
