//! Holds the code of both packages to the tables of rooms in `ARCHITECTURE.md`: a room imports only from floors below its own, and
//! siblings only where the table says so.
//!
//! Sources are read as Rust tokens, so comments and strings do not count and paths inside macro calls do. Items
//! under `#[cfg(test)]` are free to import what they like.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// One row's worth of knowledge about a room.
#[derive(Debug, PartialEq)]
struct Room {
    floor: u32,
    siblings: Vec<String>,
}

type Rooms = BTreeMap<String, Room>;

/// Reads the table `| floor | rooms | may also use |`; rooms are the names in backquotes.
fn parse_table(page: &str) -> Rooms {
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
fn fault(rooms: &Rooms, from: &str, to: &str) -> Option<String> {
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

/// Names directly under the crate's root that the code refers to, and the modules that are only there for tests.
#[derive(Default)]
struct Found {
    rooms: Vec<String>,
    test_modules: Vec<String>,
}

/// Collects the names that follow `crate::`, or as many `super::` as lead to the root. `depth` is the number of
/// modules around the code: 1 for `src/light/mod.rs` and `src/light.rs`, 2 for `src/light/list.rs`.
fn read(source: &str, depth: usize) -> Found {
    let tokens: TokenStream = source.parse().expect("the sources compile");
    let mut found = Found::default();
    walk(tokens, depth, &mut found);
    found
}

fn walk(tokens: TokenStream, depth: usize, found: &mut Found) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut at = 0;
    while at < tokens.len() {
        if is_test_attribute(&tokens[at..]) {
            at = skip_item(&tokens, at + 2, found);
            continue;
        }
        match &tokens[at] {
            TokenTree::Ident(word) if word == "crate" && is_colons(&tokens, at + 1) => {
                heads(&tokens[at + 3..], &mut found.rooms);
            }
            TokenTree::Ident(word) if word == "super" && !after_super(&tokens, at) => {
                let mut climbed = 0;
                let mut next = at;
                while matches!(&tokens.get(next), Some(TokenTree::Ident(word)) if *word == "super")
                    && is_colons(&tokens, next + 1)
                {
                    climbed += 1;
                    next += 3;
                }
                if climbed >= depth {
                    heads(&tokens[next..], &mut found.rooms);
                }
            }
            // An inline module is one level deeper.
            TokenTree::Group(group) => {
                let is_module = group.delimiter() == Delimiter::Brace
                    && at >= 2
                    && matches!(&tokens[at - 2], TokenTree::Ident(word) if *word == "mod");
                walk(group.stream(), depth + usize::from(is_module), found);
            }
            _ => {}
        }
        at += 1;
    }
}

/// First names of what follows a `::`: one name, or those of a group in braces.
fn heads(tokens: &[TokenTree], rooms: &mut Vec<String>) {
    match tokens.first() {
        Some(TokenTree::Ident(name)) => rooms.push(name.to_string()),
        Some(TokenTree::Group(group)) => {
            let inner: Vec<TokenTree> = group.stream().into_iter().collect();
            for path in inner.split(|token| matches!(token, TokenTree::Punct(p) if p.as_char() == ',')) {
                heads(path, rooms);
            }
        }
        // A glob import of the root would hide which rooms are meant.
        Some(TokenTree::Punct(star)) if star.as_char() == '*' => rooms.push("*".to_owned()),
        _ => {}
    }
}

fn is_colons(tokens: &[TokenTree], at: usize) -> bool {
    let colon = |at: usize| matches!(tokens.get(at), Some(TokenTree::Punct(p)) if p.as_char() == ':');
    colon(at) && colon(at + 1)
}

fn after_super(tokens: &[TokenTree], at: usize) -> bool {
    at >= 3
        && is_colons(tokens, at - 2)
        && matches!(&tokens[at - 3], TokenTree::Ident(word) if *word == "super")
}

fn is_test_attribute(tokens: &[TokenTree]) -> bool {
    matches!(tokens, [TokenTree::Punct(hash), TokenTree::Group(group), ..]
        if hash.as_char() == '#' && group.stream().to_string().replace(' ', "") == "cfg(test)")
}

/// Index after the item that starts at `at`: its first `;` or group in braces.
fn skip_item(tokens: &[TokenTree], mut at: usize, found: &mut Found) -> usize {
    while let Some(token) = tokens.get(at) {
        if let (TokenTree::Ident(word), Some(TokenTree::Ident(name))) = (token, tokens.get(at + 1))
            && word == "mod"
        {
            found.test_modules.push(name.to_string());
        }
        at += 1;
        match token {
            TokenTree::Punct(semicolon) if semicolon.as_char() == ';' => break,
            // `use a::{b};` has braces too: go on to its semicolon.
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                if matches!(tokens.get(at), Some(TokenTree::Punct(p)) if p.as_char() == ';') {
                    at += 1;
                }
                break;
            }
            _ => {}
        }
    }
    at
}

fn rust_files(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
}

/// Module path of a file below `src`, as in `["light", "list"]`; empty for `lib.rs` and `main.rs`.
fn module_path(relative: &Path) -> Vec<String> {
    let mut path: Vec<String> =
        relative.with_extension("").iter().map(|part| part.to_str().unwrap().to_owned()).collect();
    if path.last().is_some_and(|last| last == "mod") || path == ["lib"] || path == ["main"] {
        path.pop();
    }
    path
}

#[test]
fn every_import_is_one_that_the_table_allows() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    let (program, core) = page.split_once("**Rooms of `lightcast-core`.**").expect("the core has a table");
    let mut faults = faults_of(&root.join("src"), program, 10);
    faults.extend(faults_of(&root.join("crates/core/src"), core, 4));
    assert!(faults.is_empty(), "{}\nThe tables are in ARCHITECTURE.md.", faults.join("\n"));
}

/// What the files in `source` import against the table in `page`, which has more than `least` rooms.
fn faults_of(source: &Path, page: &str, least: usize) -> Vec<String> {
    let rooms = parse_table(page);
    assert!(rooms.len() > least, "the table was not understood: {rooms:?}");

    let mut files = Vec::new();
    rust_files(source, &mut files);
    files.sort();
    let modules: Vec<Vec<String>> =
        files.iter().map(|file| module_path(file.strip_prefix(source).unwrap())).collect();
    let mut faults: Vec<String> = rooms
        .keys()
        .filter(|room| !modules.iter().any(|module| module.first() == Some(room)))
        .map(|room| format!("the table has `{room}`, {} has not", source.display()))
        .collect();
    let contents: Vec<Found> = files
        .iter()
        .zip(&modules)
        .map(|(file, module)| read(&fs::read_to_string(file).unwrap(), module.len()))
        .collect();
    let is_test_only = |module: &[String]| {
        (1..module.len()).any(|length| {
            let (parent, child) = (&module[..length], &module[length]);
            modules.iter().zip(&contents).any(|(m, found)| m == parent && found.test_modules.contains(child))
        })
    };
    for ((file, module), found) in files.iter().zip(&modules).zip(&contents) {
        let Some(room) = module.first() else { continue };
        if is_test_only(module) {
            continue;
        }
        if !rooms.contains_key(room) {
            faults.push(format!("{}: `{room}` is not in the table", file.display()));
        }
        faults.extend(
            found
                .rooms
                .iter()
                .filter_map(|used| fault(&rooms, room, used))
                .map(|fault| format!("{}: {fault}", file.display())),
        );
    }
    faults
}

#[test]
fn forbidden_imports_are_found_in_every_spelling() {
    let source = r#"
        //! [`crate::doc_link`] and "crate::string" do not count.
        use crate::error::{Error, Result};
        use crate::{image::{Frame, self}, math};
        use super::sibling::Thing;
        fn inline() -> crate::service::Graph { println!("{}", super::super::cli::NAME); super::super::super::deep::x() }
        mod inner { use super::super::super::config; use super::super::own; }
        #[cfg(test)]
        use crate::only_in_tests::{a};
        #[cfg(test)]
        mod tests { use crate::report::Table; use super::super::wire; }
        #[cfg(test)]
        mod oracle;
        fn last() { let s = "use crate::string;"; crate::temporal::f() /* crate::comment */ }
    "#;
    let found = read(source, 2);
    assert_eq!(
        found.rooms,
        ["error", "image", "math", "service", "cli", "deep", "config", "temporal"],
        "a super that does not reach the root is the room itself"
    );
    assert_eq!(found.test_modules, ["tests", "oracle"]);
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
