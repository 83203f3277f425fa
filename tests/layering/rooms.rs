//! The table of rooms in `ARCHITECTURE.md`: a room imports only from floors below its own, and siblings only
//! where the table says so.

use crate::source::Module;
use std::collections::BTreeMap;

/// The rules for a room, from its row of the table.
#[derive(Debug, PartialEq)]
pub struct Room {
    floor: u32,
    siblings: Vec<String>,
}

pub type Rooms = BTreeMap<String, Room>;

/// Reads the table `| floor | rooms | may also use |`; rooms are the names in backquotes.
pub fn parse_table(page: &str) -> Rooms {
    let quoted =
        |cell: &str| -> Vec<String> { cell.split('`').skip(1).step_by(2).map(str::to_owned).collect() };
    let mut rooms = Rooms::new();
    for line in page.lines().filter(|line| line.starts_with('|')) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [floor, names, siblings] = cells[..] else { continue };
        let Ok(floor) = floor.parse() else { continue };
        for name in quoted(names) {
            rooms.insert(name, Room { floor, siblings: quoted(siblings) });
        }
    }
    rooms
}

/// What is wrong with an import of `to` in `from`, if anything.
pub fn fault(rooms: &Rooms, from: &str, to: &str) -> Option<String> {
    if from == to {
        return None;
    }
    let Some(here) = rooms.get(from) else { return Some(format!("`{from}` is not in the table")) };
    let Some(there) = rooms.get(to) else {
        return Some(format!("`{from}` uses `{to}`, which is not in the table"));
    };
    let is_allowed =
        there.floor < here.floor || there.floor == here.floor && here.siblings.iter().any(|s| s == to);
    (!is_allowed).then(|| {
        format!(
            "`{from}` (floor {}) uses `{to}` (floor {}), which the table forbids",
            here.floor, there.floor
        )
    })
}

/// Names directly under the crate's root to which a module refers: those after `crate::`, or after enough
/// `super::` to reach the root. A glob import of the root, which would hide the actual rooms, is `*`.
pub fn used(module: &Module) -> Vec<String> {
    let from_root = |path: &Vec<String>| {
        let climbed = path.iter().take_while(|name| *name == "super").count();
        let start = if path[0] == "crate" { 1 } else { climbed };
        let is_root = path[0] == "crate" || climbed > 0 && climbed >= module.path.len();
        is_root.then(|| path.get(start).cloned().unwrap_or_else(|| "*".to_owned()))
    };
    module.used().filter_map(from_root).collect()
}

#[test]
fn the_table_decides_and_it_can_say_no() {
    let rooms = parse_table(
        "| floor | rooms | may also use |\n|---|---|---|\n| 0 | `error`, `math`, `rt` | `error` |\n| 1 | `image` | |\n",
    );
    assert_eq!(rooms.len(), 4);
    for (from, to) in [("image", "math"), ("rt", "error"), ("image", "image")] {
        assert_eq!(fault(&rooms, from, to), None);
    }
    for (from, to, says) in [
        ("math", "image", "`math` (floor 0) uses `image` (floor 1), which the table forbids"),
        ("rt", "math", "`rt` (floor 0) uses `math` (floor 0), which the table forbids"),
        ("image", "gpu", "`image` uses `gpu`, which is not in the table"),
        ("attic", "math", "`attic` is not in the table"),
    ] {
        assert_eq!(fault(&rooms, from, to).as_deref(), Some(says));
    }
}

#[test]
fn rooms_are_found_in_every_spelling() {
    let source = "
        use crate::error::{Error, Result};
        use crate::{image::{Frame, self}, math};
        use crate::*;
        use super::sibling::Thing;
        fn f() -> crate::service::Graph { println!(\"{}\", super::super::cli::NAME); super::super::super::deep::x() }
        mod inner { use super::super::super::config; use super::super::own; }
    ";
    let modules = crate::source::read(source, vec!["light".to_owned(), "list".to_owned()]);
    assert_eq!(
        used(&modules[0]),
        ["error", "error", "image", "image", "math", "*", "service", "cli", "deep"],
        "a super that does not reach the root is the room itself"
    );
    assert_eq!(used(&modules[1]), ["config"]);
}
