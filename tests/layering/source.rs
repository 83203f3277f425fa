//! Declarations and uses in Rust files. Sources are parsed as tokens, so comments and strings do not count,
//! but paths inside macro calls do. Items under `#[cfg(test)]` are left out.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::fs;
use std::path::{Path, PathBuf};

/// A module: a file, or the block in braces after `mod name`.
#[derive(Debug, Default)]
pub struct Module {
    /// Path from the crate's root, such as `["light", "list"]`; empty for the root.
    pub path: Vec<String>,
    /// Length of the path of its file, in which it is nested if it is an inline module; `path.len()` for a
    /// file.
    pub file_depth: usize,
    /// Modules that it declares.
    pub children: Vec<String>,
    /// Modules that it declares for tests.
    pub test_children: Vec<String>,
    /// Imports by `use`: the name here, and its path as written.
    pub imports: Vec<(String, Vec<String>)>,
    /// Other paths of two or more names, as written.
    pub paths: Vec<Vec<String>>,
}

impl Module {
    /// Every path in the module, as written.
    pub fn used(&self) -> impl Iterator<Item = &Vec<String>> {
        self.imports.iter().map(|(_, path)| path).chain(&self.paths)
    }
}

/// The modules of the crate whose files lie in `folder`, except those that exist only for tests.
pub fn read_crate(folder: &Path) -> Vec<Module> {
    let mut files = Vec::new();
    rust_files(folder, &mut files);
    files.sort();
    let mut modules = Vec::new();
    for file in files {
        let relative = file.strip_prefix(folder).expect("it was found there");
        // A program next to a library uses the library's rooms through the library's name.
        if relative != Path::new("main.rs") || !folder.join("lib.rs").exists() {
            modules.extend(read(&fs::read_to_string(&file).unwrap(), module_path(relative)));
        }
    }
    let tests: Vec<Vec<String>> = modules
        .iter()
        .flat_map(|module| module.test_children.iter().map(|child| join(&module.path, child)))
        .collect();
    modules.retain(|module| !tests.iter().any(|test| module.path.starts_with(test)));
    modules
}

/// Reads the file of the module `path`: the module itself, then its inline modules.
pub fn read(source: &str, path: Vec<String>) -> Vec<Module> {
    let tokens: TokenStream = source.parse().expect("the sources compile");
    let file_depth = path.len();
    let mut modules = vec![Module { path, file_depth, ..Module::default() }];
    walk(tokens, 0, &mut modules);
    modules
}

fn walk(tokens: TokenStream, module: usize, modules: &mut Vec<Module>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut at = 0;
    while let Some(token) = tokens.get(at) {
        if is_test_attribute(&tokens[at..]) {
            at = skip_item(&tokens, at + 2, &mut modules[module].test_children);
            continue;
        }
        at += 1;
        match token {
            TokenTree::Group(group) => walk(group.stream(), module, modules),
            TokenTree::Ident(word) if word == "mod" => {
                let Some(TokenTree::Ident(name)) = tokens.get(at) else { continue };
                modules[module].children.push(name.to_string());
                if let Some(TokenTree::Group(body)) = tokens.get(at + 1) {
                    let Module { path, file_depth, .. } = &modules[module];
                    let inner = Module {
                        path: join(path, &name.to_string()),
                        file_depth: *file_depth,
                        ..Module::default()
                    };
                    modules.push(inner);
                    let inner = modules.len() - 1;
                    walk(body.stream(), inner, modules);
                    at += 2;
                }
            }
            // `use<'a>` of an opaque type imports nothing.
            TokenTree::Ident(word) if word == "use" && !is_punct(tokens.get(at), '<') => {
                let end = (at..tokens.len()).find(|&end| is_punct(tokens.get(end), ';'));
                let end = end.unwrap_or(tokens.len());
                imports(&tokens[at..end], &[], &mut modules[module].imports);
                at = end;
            }
            // `pub(in path)` is a visibility, not a use.
            TokenTree::Ident(word) if word == "in" && at == 1 => break,
            TokenTree::Ident(word) => {
                let mut path = vec![word.to_string()];
                while let (true, Some(TokenTree::Ident(name))) = (is_colons(&tokens, at), tokens.get(at + 2))
                {
                    path.push(name.to_string());
                    at += 3;
                }
                if path.len() > 1 {
                    modules[module].paths.push(path);
                }
            }
            // A leading `::` is followed by the name of a crate, `Type::<T>` and `<T>` by an item of the
            // type.
            TokenTree::Punct(_) if is_colons(&tokens, at - 1) => {
                at += 1;
                while let Some(TokenTree::Ident(_)) = tokens.get(at) {
                    at += if is_colons(&tokens, at + 1) { 3 } else { 1 };
                }
            }
            _ => {}
        }
    }
}

/// Reads a tree of imports after the path `head`.
fn imports(tokens: &[TokenTree], head: &[String], found: &mut Vec<(String, Vec<String>)>) {
    let mut path = head.to_vec();
    let mut at = 0;
    while let Some(token) = tokens.get(at) {
        match token {
            TokenTree::Ident(word) if word == "as" => {
                if let Some(TokenTree::Ident(name)) = tokens.get(at + 1) {
                    found.push((name.to_string(), path));
                }
                return;
            }
            TokenTree::Ident(word) => path.push(word.to_string()),
            TokenTree::Group(group) => {
                let inner: Vec<TokenTree> = group.stream().into_iter().collect();
                for tree in inner.split(|token| is_punct(Some(token), ',')).filter(|tree| !tree.is_empty()) {
                    imports(tree, &path, found);
                }
                return;
            }
            // The names that a glob imports are unknown, but it does use the module.
            TokenTree::Punct(star) if star.as_char() == '*' => {
                found.push(("*".to_owned(), path));
                return;
            }
            _ => {}
        }
        at += 1;
    }
    path.pop_if(|last| last == "self" && !head.is_empty());
    found.extend(path.last().cloned().map(|name| (name, path)));
}

fn is_punct(token: Option<&TokenTree>, sign: char) -> bool {
    matches!(token, Some(TokenTree::Punct(p)) if p.as_char() == sign)
}

fn is_colons(tokens: &[TokenTree], at: usize) -> bool {
    is_punct(tokens.get(at), ':') && is_punct(tokens.get(at + 1), ':')
}

fn is_test_attribute(tokens: &[TokenTree]) -> bool {
    matches!(tokens, [TokenTree::Punct(hash), TokenTree::Group(group), ..]
        if hash.as_char() == '#' && group.stream().to_string().replace(' ', "") == "cfg(test)")
}

/// Index after the item that starts at `at`: its first `;` or group in braces.
fn skip_item(tokens: &[TokenTree], mut at: usize, test_children: &mut Vec<String>) -> usize {
    while let Some(token) = tokens.get(at) {
        if let (TokenTree::Ident(word), Some(TokenTree::Ident(name))) = (token, tokens.get(at + 1))
            && word == "mod"
        {
            test_children.push(name.to_string());
        }
        at += 1;
        match token {
            TokenTree::Punct(semicolon) if semicolon.as_char() == ';' => break,
            // `use a::{b};` has braces too: go on to its semicolon.
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                at += usize::from(is_punct(tokens.get(at), ';'));
                break;
            }
            _ => {}
        }
    }
    at
}

fn join(path: &[String], name: &str) -> Vec<String> {
    path.iter().cloned().chain([name.to_owned()]).collect()
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

/// Module path of a file of a crate, such as `["light", "list"]`; empty for `lib.rs` and `main.rs`.
fn module_path(relative: &Path) -> Vec<String> {
    let mut path: Vec<String> =
        relative.with_extension("").iter().map(|part| part.to_str().unwrap().to_owned()).collect();
    if path.last().is_some_and(|last| last == "mod") || path == ["lib"] || path == ["main"] {
        path.pop();
    }
    path
}

#[test]
fn declarations_imports_and_paths_are_read_and_tests_are_not() {
    let source = r#"
        //! [`crate::doc_link`] and "crate::string" do not count.
        mod child;
        use crate::error::{Error, Result as R};
        use crate::{image::{Frame, self}, math::*};
        fn inline() -> crate::service::Graph { println!("{}", super::super::cli::NAME); ::image::open() }
        mod inner { pub(in crate::light) use super::own; const A: u8 = Vec::<u8>::new().f(<T as child::B>::C); }
        #[cfg(test)]
        use crate::only_in_tests::{a};
        #[cfg(test)]
        mod tests { use crate::report::Table; }
        #[cfg(test)]
        mod oracle;
        fn last() -> impl Fn() + use<> { let s = "use crate::string;"; crate::temporal::f() /* crate::comment */ }
    "#;
    let modules = read(source, vec!["light".to_owned()]);
    let text = |path: &Vec<String>| path.join("::");
    let used = |module: &Module| -> Vec<String> { module.used().map(text).collect() };
    assert_eq!(modules.len(), 2);
    assert_eq!(modules[0].children, ["child", "inner"]);
    assert_eq!(modules[0].test_children, ["tests", "oracle"]);
    let names: Vec<&str> = modules[0].imports.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["Error", "R", "Frame", "image", "*"]);
    assert_eq!(
        used(&modules[0]),
        [
            "crate::error::Error",
            "crate::error::Result",
            "crate::image::Frame",
            "crate::image",
            "crate::math",
            "crate::service::Graph",
            "super::super::cli::NAME",
            "crate::temporal::f"
        ]
    );
    assert_eq!((text(&modules[1].path), modules[1].file_depth), ("light::inner".to_owned(), 1));
    assert_eq!(used(&modules[1]), ["super::own", "child::B"]);
}
