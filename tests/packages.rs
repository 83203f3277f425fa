//! The contents of `cargo package` for both packages: everything that the build reads and the texts, but no
//! test data, no recordings and nothing for continuous integration.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::path::Path;
use std::process::Command;

fn packed(package: &str) -> Vec<String> {
    let output = Command::new(env!("CARGO"))
        .args(["package", "--list", "--allow-dirty", "--offline", "--package", package])
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

fn check(package: &str, needed: &[&str], folders: &[&str]) {
    let files = packed(package);
    for name in
        ["Cargo.toml", "LICENSE-APACHE", "LICENSE-MIT", "README.md", "src/lib.rs"].iter().chain(needed)
    {
        assert!(files.iter().any(|file| file == name), "{package} lacks {name}");
    }
    for file in &files {
        let (folder, rest) = file.split_once('/').unwrap_or(("", file));
        assert!(folder.is_empty() || folders.contains(&folder), "{package}: {file}");
        let is_hidden = rest.starts_with('.') && file != ".cargo_vcs_info.json";
        assert!(!is_hidden && file != "Makefile", "{package}: {file}");
        // Clients are files in one folder; what package managers put below it stays out.
        assert!(folder != "clients" || !rest.contains('/'), "{package}: {file}");
    }
}

#[test]
fn the_core_packs_sources_examples_and_texts() {
    check("lightcast-core", &["examples/panorama.rs"], &["examples", "src"]);
}

#[test]
fn the_program_packs_what_is_compiled_in_and_what_its_texts_name() {
    let needed = [
        "ARCHITECTURE.md",
        "clients/example.mjs",
        "clients/example.py",
        "clients/lightcast.js",
        "clients/lightcast.py",
        "clients/lightcast_node.js",
        "clients/package.json",
        "clients/pyproject.toml",
        "config/replay.toml",
        "src/main.rs",
        "src/net/page/page.js",
    ];
    check("lightcast", &needed, &["clients", "config", "docs", "shaders", "src"]);
}

#[test]
fn the_clients_packages_have_the_version_and_licence_of_the_program() {
    let clients = Path::new(env!("CARGO_MANIFEST_DIR")).join("clients");
    let read = |name: &str| std::fs::read_to_string(clients.join(name)).unwrap();
    let npm: serde_json::Value = serde_json::from_str(&read("package.json")).unwrap();
    let python: toml::Table = read("pyproject.toml").parse().unwrap();
    let own = [
        ("version", env!("CARGO_PKG_VERSION")),
        ("license", env!("CARGO_PKG_LICENSE")),
        ("name", env!("CARGO_PKG_NAME")),
    ];
    for (key, expected) in own {
        assert_eq!(npm[key].as_str(), Some(expected), "package.json: {key}");
        assert_eq!(python["project"][key].as_str(), Some(expected), "pyproject.toml: {key}");
    }
}
