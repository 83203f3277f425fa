//! Sequences named as others' programs name them.

use super::{fault, said};
use serde_json::Value;
use std::process::Command;

/// The lists of a sequence of the data folder.
fn lists(name: &str) -> Option<Vec<Value>> {
    let path = fault(&format!("seq/{name}/c.toml"))?;
    let output = Command::new(env!("CARGO_BIN_EXE_lightcast")).arg("run").arg(path).output().unwrap();
    assert!(output.status.success(), "{name}: {}", said(&output));
    let lines = String::from_utf8(output.stdout).unwrap();
    Some(lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect())
}

fn numbers(lists: &[Value]) -> Vec<(u64, u64)> {
    lists
        .iter()
        .map(|list| (list["sequence"].as_u64().unwrap(), list["lost_before"].as_u64().unwrap()))
        .collect()
}

#[test]
fn signs_of_places_and_cases_in_names_and_numbers_below_zero() {
    let Some(plain) = lists("plain") else { return };
    assert_eq!(numbers(&plain), [(1, 0), (2, 0), (3, 0)]);
    assert_eq!(numbers(&lists("pct2").unwrap()), [(1, 0), (2, 0)]);
    assert_eq!(numbers(&lists("mixedext").unwrap()), [(1, 0), (2, 0)]);
    assert_eq!(numbers(&lists("neg").unwrap()), [(0, 0), (1, 0), (2, 0), (3, 0)]);
}

#[test]
fn frames_of_cameras_without_huffman_tables_are_decoded() {
    let Some(lists) = lists("mjpg") else { return };
    assert_eq!(numbers(&lists), [(1, 0), (2, 0), (3, 0), (4, 0), (5, 0), (6, 0)]);
    let green = |frame: usize| lists[frame]["power"][1].as_f64().unwrap();
    for same in [1, 2, 5] {
        // Their lights lie elsewhere, as those of later frames do, and add up within rounding.
        assert!((green(same) / green(0) - 1.0).abs() < 1e-6, "frame {}: {}", same + 1, green(same));
    }
}
