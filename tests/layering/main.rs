//! Checks the code of both packages against the tables of rooms in `ARCHITECTURE.md`, and finds circular
//! dependencies between files.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod circles;
mod rooms;
mod source;

use rooms::{fault, parse_table};
use std::fs;
use std::path::{Path, PathBuf};

#[test]
fn every_import_is_one_that_the_tables_allow() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    let (program, core) = page.split_once("**Rooms of `lightcast-core`.**").expect("the core has a table");
    let mut faults = faults_of(&root.join("src"), program, 10);
    faults.extend(faults_of(&root.join("crates/core/src"), core, 4));
    assert!(faults.is_empty(), "{}\nThe tables are in ARCHITECTURE.md.", faults.join("\n"));
}

/// Imports of the files in `source` that violate the table in `page`, which has more than `least` rooms.
fn faults_of(source: &Path, page: &str, least: usize) -> Vec<String> {
    let rooms = parse_table(page);
    assert!(rooms.len() > least, "the table was not understood: {rooms:?}");

    let modules = source::read_crate(source);
    let mut faults: Vec<String> = rooms
        .keys()
        .filter(|room| !modules.iter().any(|module| module.path.first() == Some(room)))
        .map(|room| format!("the table has `{room}`, {} has not", source.display()))
        .collect();
    for module in &modules {
        let Some(room) = module.path.first() else { continue };
        let name = module.path.join("::");
        if !rooms.contains_key(room) {
            faults.push(format!("{name}: `{room}` is not in the table"));
        }
        let found = rooms::used(module);
        faults.extend(
            found.iter().filter_map(|used| fault(&rooms, room, used)).map(|fault| format!("{name}: {fault}")),
        );
    }
    faults
}

/// Folders with a `main.rs` under `folder`: benches and tests of several files.
fn programs(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.join("main.rs").is_file()).collect()
}

#[test]
fn no_files_need_each_other() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut crates = vec![root.join("src")];
    crates.extend(programs(&root.join("benches")));
    crates.extend(programs(&root.join("tests")));
    let members = fs::read_dir(root.join("crates")).unwrap();
    crates.extend(members.map(|member| member.unwrap().path().join("src")));
    let mut found: Vec<String> = Vec::new();
    for folder in crates {
        let name = folder.strip_prefix(root).unwrap().display();
        let circles = circles::circles(&source::read_crate(&folder));
        found.extend(circles.iter().map(|circle| format!("{name}: {}", circle.join(" "))));
    }
    println!("circles of files: {}", found.len());
    assert!(found.is_empty(), "circles of files, which must go:\n{}", found.join("\n"));
}
