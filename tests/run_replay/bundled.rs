use crate::recording::{lightcast, lists, stderr};
use serde_json::Value;
use std::path::Path;

#[test]
fn the_bundled_sequence_plays_once_and_gives_the_lists_that_it_always_gave() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let output = lightcast().args(["run", "--config"]).arg(root.join("config/replay.toml")).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let found = lists(&output.stdout);
    assert_eq!(found.len(), 100, "4 s at 25 Hz");
    assert!(found.iter().all(|list| list["frame_rate_hz"] == 25.0 && list["lost_before"] == 0));
    let golden = lists(&std::fs::read(root.join("tests/golden/replay.jsonl")).unwrap());
    assert_eq!(golden.len(), 5);
    for expected in golden {
        let sequence = expected["sequence"].as_u64().unwrap();
        let list = found.iter().find(|list| list["sequence"] == sequence).unwrap();
        let mut place = format!("list {sequence}");
        assert_alike(list, &expected, &mut place);
    }
}

/// Asserts that numbers agree within 1e-6, relative where they are above 1: another C library may round
/// logarithms and sines differently.
fn assert_alike(found: &Value, expected: &Value, place: &mut String) {
    let length = place.len();
    match (found, expected) {
        (Value::Object(found), Value::Object(expected)) => {
            assert!(found.keys().eq(expected.keys()), "{place}: {found:?}");
            for (key, expected) in expected {
                place.push_str(&format!(".{key}"));
                assert_alike(&found[key], expected, place);
                place.truncate(length);
            }
        }
        (Value::Array(found), Value::Array(expected)) => {
            assert_eq!(found.len(), expected.len(), "{place}");
            for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
                place.push_str(&format!("[{index}]"));
                assert_alike(found, expected, place);
                place.truncate(length);
            }
        }
        (Value::Number(found), Value::Number(expected)) => {
            let (found, expected) = (found.as_f64().unwrap(), expected.as_f64().unwrap());
            let tolerance = 1e-6 * expected.abs().max(1.0);
            assert!((found - expected).abs() <= tolerance, "{place}: {found}, not {expected}");
        }
        _ => assert_eq!(found, expected, "{place}"),
    }
}
