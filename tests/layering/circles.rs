//! Circular dependencies between files. A parent and its own child may use each other.

use crate::source::Module;
use std::collections::{BTreeMap, BTreeSet};

/// Path of a module from the root.
type Name = Vec<String>;

/// Number of re-exports that are followed before a chain of them is taken to be endless.
const REEXPORTS_MAX: usize = 16;

/// The circles of a crate: each is the set of files that reach each other, given by the modules' names.
pub fn circles(modules: &[Module]) -> Vec<Vec<String>> {
    let by_name: BTreeMap<&[String], &Module> =
        modules.iter().map(|module| (&module.path[..], module)).collect();
    let mut edges: BTreeMap<Name, BTreeSet<Name>> = BTreeMap::new();
    for module in modules {
        let from = file(module);
        for path in module.used() {
            let target = resolve(&by_name, &module.path, path, 0).and_then(|name| by_name.get(&name[..]));
            let Some(to) = target.map(|module| file(module)) else { continue };
            if to != from && !is_own_child(&from, &to) && !is_own_child(&to, &from) {
                edges.entry(from.clone()).or_default().insert(to);
            }
        }
    }
    let reached: BTreeMap<&Name, BTreeSet<&Name>> =
        edges.keys().map(|from| (from, reach(&edges, from))).collect();
    let reaches = |from: &Name, to: &Name| reached.get(from).is_some_and(|reached| reached.contains(to));
    let mut found: Vec<Vec<String>> = Vec::new();
    for name in edges.keys().filter(|name| reaches(name, name)) {
        let circle: Vec<String> = edges
            .keys()
            .filter(|other| reaches(name, other) && reaches(other, name))
            .map(|name| name.join("::"))
            .collect();
        if !found.contains(&circle) {
            found.push(circle);
        }
    }
    found
}

/// The module whose file contains `module`.
fn file(module: &Module) -> Name {
    module.path[..module.file_depth].to_vec()
}

fn is_own_child(parent: &Name, child: &Name) -> bool {
    child.len() == parent.len() + 1 && child.starts_with(parent)
}

/// All files that are reachable from a file; itself only through a circle.
fn reach<'a>(edges: &'a BTreeMap<Name, BTreeSet<Name>>, from: &Name) -> BTreeSet<&'a Name> {
    let mut reached: BTreeSet<&Name> = BTreeSet::new();
    let mut open: Vec<&Name> = edges[from].iter().collect();
    while let Some(name) = open.pop() {
        if reached.insert(name) {
            open.extend(edges.get(name).into_iter().flatten());
        }
    }
    reached
}

/// The module of the item to which `path` refers in the module `from`: re-exports are followed to the item's
/// definition. `None` for items of another crate.
fn resolve(
    modules: &BTreeMap<&[String], &Module>,
    from: &[String],
    path: &[String],
    followed: usize,
) -> Option<Name> {
    let mut here = from.to_vec();
    let mut is_ours = false;
    for (at, name) in path.iter().enumerate() {
        match name.as_str() {
            "crate" => here.clear(),
            "super" => drop(here.pop()),
            "self" => {}
            _ => {
                let module = modules.get(&here[..])?;
                if module.children.contains(name) {
                    here.push(name.clone());
                } else {
                    let import = module.imports.iter().find(|(import, _)| import == name);
                    let Some((_, target)) = import else { return is_ours.then_some(here) };
                    if followed == REEXPORTS_MAX {
                        return None;
                    }
                    let target: Name = target.iter().chain(&path[at + 1..]).cloned().collect();
                    return resolve(modules, &here, &target, followed + 1);
                }
            }
        }
        is_ours = true;
    }
    Some(here)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::read;

    /// Circles of a crate whose files are given by module and content.
    fn circles_of(files: &[(&str, &str)]) -> Vec<String> {
        let modules: Vec<Module> = files
            .iter()
            .flat_map(|(name, source)| {
                read(source, name.split("::").filter(|name| !name.is_empty()).map(str::to_owned).collect())
            })
            .collect();
        circles(&modules).into_iter().map(|circle| circle.join(" ")).collect()
    }

    #[test]
    fn a_circle_is_found_through_reexports_aliases_and_inline_modules() {
        let root = ("", "mod a; mod b; mod c;");
        let c = ("c", "pub struct C;");
        assert_eq!(circles_of(&[root, ("a", "use crate::b::B;"), ("b", "use super::a::A;"), c]), ["a b"]);
        let third = ("c", "fn f() { mine::go() } mod inner { use crate::a::A; } use super::b as mine;");
        let files = [root, ("a", "use crate::b;"), ("b", "fn go() { crate::c::x() }"), third];
        assert_eq!(circles_of(&files), ["a b c"]);
        let room = ("", "mod room;");
        let parent = ("room", "mod one; mod two; pub use two::{Two as Second}; pub use one::One;");
        let two = ("room::two", "struct Two; impl Two { fn f() -> crate::room::One }");
        assert_eq!(
            circles_of(&[room, parent, ("room::one", "use super::Second;"), two]),
            ["room::one room::two"]
        );
    }

    #[test]
    fn a_parent_with_its_child_other_crates_and_tests_are_no_circle() {
        let root = ("", "mod a; mod b;");
        let a = ("a", "mod child; use child::Child; use b::Other; #[cfg(test)] use crate::b::B;");
        let child = ("a::child", "use super::A; use super::super::b::B;");
        let b = ("b", "use crate::a::A; use ::a::X; fn f() { Vec::<u8>::a::A; }");
        assert!(circles_of(&[root, a, child, b]).is_empty());
        // A grandchild is not its own child.
        let deep = ("a::child", "mod deep; use crate::b::B;");
        let b = ("b", "use crate::a::child::deep::D;");
        assert_eq!(
            circles_of(&[root, a, deep, ("a::child::deep", "use crate::b::B;"), b]),
            ["a::child::deep b"]
        );
    }
}
