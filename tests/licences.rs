//! Every package that the program is built from carries a permissive licence.

use std::process::Command;

/// Licences that require no more than their notice.
const PERMISSIVE: [&str; 12] = [
    "MIT",
    "MIT-0",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "Zlib",
    "0BSD",
    "Unicode-3.0",
    "BSL-1.0",
    "NCSA",
];

/// Whether an SPDX expression (also the old `A/B` form) can be satisfied by permissive licences alone. AND
/// has precedence over OR.
fn is_permissive(expression: &str) -> bool {
    let expression = expression.trim();
    if let Some(inner) = expression.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'))
        && !inner.contains('(')
    {
        return is_permissive(inner);
    }
    let parts = |separator: &str| -> Option<Vec<String>> {
        let (mut parts, mut depth, mut start) = (Vec::new(), 0i32, 0);
        for (at, character) in expression.char_indices() {
            depth += i32::from(character == '(') - i32::from(character == ')');
            if depth == 0 && at >= start && expression[at..].starts_with(separator) {
                parts.push(expression[start..at].to_owned());
                start = at + separator.len();
            }
        }
        parts.push(expression[start..].to_owned());
        (parts.len() > 1).then_some(parts)
    };
    if let Some(parts) = parts(" OR ").or_else(|| parts("/")) {
        return parts.iter().any(|part| is_permissive(part));
    }
    if let Some(parts) = parts(" AND ") {
        return parts.iter().all(|part| is_permissive(part));
    }
    PERMISSIVE.contains(&expression)
}

#[test]
fn expressions_are_read_as_spdx_reads_them() {
    assert!(is_permissive("MIT OR Apache-2.0"));
    assert!(is_permissive("MIT/Apache-2.0"));
    assert!(is_permissive("(MIT OR GPL-3.0) AND Unicode-3.0"));
    assert!(is_permissive("GPL-2.0 OR MIT"));
    assert!(!is_permissive("MIT AND GPL-2.0"));
    assert!(!is_permissive("MPL-2.0"));
    assert!(!is_permissive(""));
}

#[test]
fn every_dependency_is_permissive() {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo runs: it started this test");
    // Packages for other platforms may not have been downloaded; `--offline` cannot describe them then.
    let output = if output.status.success() {
        output
    } else {
        Command::new(env!("CARGO"))
            .args(["metadata", "--format-version", "1", "--locked"])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .expect("cargo runs: it started this test")
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("cargo prints JSON");
    let packages = metadata["packages"].as_array().expect("a list of packages");
    assert!(packages.len() > 20, "the list is not complete: {}", packages.len());
    let bad: Vec<String> = packages
        .iter()
        .filter(|package| !is_permissive(package["license"].as_str().unwrap_or("")))
        .map(|package| format!("{} {}: {}", package["name"], package["version"], package["license"]))
        .collect();
    assert!(bad.is_empty(), "not permissive: {bad:#?}");
}
