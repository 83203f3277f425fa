//! `lightcast-core` remains usable as a library: it has few dependencies, none that belongs to the program,
//! uses no files or threads, and a package outside of this workspace that depends on it by path compiles.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Most lines of `cargo tree`, the crate included: what a user of the crate has to trust and to compile.
const MOST_PACKAGES: usize = 40;

/// Dependencies that a library of algorithms does not need: files, threads, a GPU, tasks, a command line,
/// logs.
const REFUSED: [&str; 14] = [
    "clap",
    "crossbeam-channel",
    "env_logger",
    "exr",
    "image",
    "libc",
    "log",
    "rayon",
    "rustix",
    "tokio",
    "toml",
    "tracing",
    "wgpu",
    "winit",
];

/// Modules of the standard library that do input or output or start threads or processes.
const REFUSED_MODULES: [&str; 6] = ["env", "fs", "io", "net", "process", "thread"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn it_brings_few_packages_and_none_that_does_the_programs_work() {
    let tree = Command::new(env!("CARGO"))
        .args(["tree", "--locked", "--offline", "--package", "lightcast-core"])
        .args(["--edges", "normal", "--prefix", "none", "--no-dedupe"])
        .current_dir(root())
        .output()
        .unwrap();
    let text = String::from_utf8(tree.stdout).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    lines.sort_unstable();
    lines.dedup();
    println!("{}", lines.join("\n"));
    assert!(lines.iter().any(|line| line.starts_with("glam ")), "{}", String::from_utf8_lossy(&tree.stderr));
    assert!(lines.len() <= MOST_PACKAGES, "{} packages", lines.len());
    for line in lines {
        let name = line.split(' ').next().unwrap();
        assert!(!REFUSED.contains(&name), "{line}");
    }
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else {
            found.push(path);
        }
    }
}

#[test]
fn its_algorithms_do_no_input_or_output_and_start_nothing() {
    let mut files = Vec::new();
    sources(&root().join("crates/core/src"), &mut files);
    assert!(files.len() > 40, "{} files", files.len());
    for file in files {
        let name = file.file_name().unwrap().to_str().unwrap();
        if name.ends_with("tests.rs") || name == "test_data.rs" {
            continue;
        }
        let text = fs::read_to_string(&file).unwrap();
        let product = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        for (number, line) in product.lines().enumerate() {
            let code = line.split("//").next().unwrap();
            let mut words = code.split(|c: char| !c.is_alphanumeric() && c != '_' && c != ':');
            let is_group = code.contains("std::{");
            let refused = words.find(|word| {
                let (of_std, module) = match word.strip_prefix("std::") {
                    Some(path) => (true, path),
                    None => (is_group, *word),
                };
                of_std && REFUSED_MODULES.contains(&module.split("::").next().unwrap())
            });
            assert_eq!(refused, None, "{}:{}", file.display(), number + 1);
        }
    }
}

#[test]
fn a_package_outside_of_the_workspace_that_names_it_by_path_compiles() {
    let folder = tempfile::tempdir().unwrap();
    let core = root().join("crates/core");
    let manifest = format!(
        "[package]\nname = \"outside\"\nversion = \"0.0.0\"\nedition = \"2024\"\n\n[workspace]\n\n\
         [dependencies]\nlightcast-core = {{ path = {core:?} }}\n"
    );
    fs::write(folder.path().join("Cargo.toml"), manifest).unwrap();
    // The same versions as here, so that nothing has to be downloaded.
    fs::copy(root().join("Cargo.lock"), folder.path().join("Cargo.lock")).unwrap();
    fs::create_dir(folder.path().join("src")).unwrap();
    fs::copy(core.join("examples/filtered_lights.rs"), folder.path().join("src/main.rs")).unwrap();
    let built = Command::new(env!("CARGO"))
        .args(["run", "--offline", "--quiet"])
        .current_dir(folder.path())
        .env("CARGO_TARGET_DIR", folder.path().join("target"))
        .output()
        .unwrap();
    let (output, messages) = (String::from_utf8_lossy(&built.stdout), String::from_utf8_lossy(&built.stderr));
    assert!(built.status.success(), "{messages}");
    assert_eq!(output.lines().count(), 20, "{output}");
}
