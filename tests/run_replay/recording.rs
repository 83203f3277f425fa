//! A short recorded panorama, its configuration, and the program that plays it.

use lightcast::files::write_exr;
use lightcast_core::image::{Frame, Pixels};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

/// A folder with `sky.0000.exr` and so on, and a configuration that plays them.
pub struct Recording {
    folder: TempDir,
}

impl Recording {
    /// `count` panoramas of 48 x 24: a rotating sun over a pulsing sky.
    pub fn new(count: u64) -> Self {
        let recording = Self { folder: tempfile::tempdir().unwrap() };
        for number in 0..count {
            write_exr(&recording.file(number), &panorama(48, 24, number), Some(25.0), false).unwrap();
        }
        recording.configure("pace = \"fast\"");
        recording
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    pub fn file(&self, number: u64) -> PathBuf {
        self.path().join(format!("sky.{number:04}.exr"))
    }

    pub fn configuration(&self) -> PathBuf {
        self.path().join("run.toml")
    }

    /// Writes the configuration with these lines in its section `[source]`.
    pub fn configure(&self, source_lines: &str) {
        let text = format!(
            "[source]\nkind = \"sequence\"\npath = \"sky.####.exr\"\n{source_lines}\n\n\
             [map]\ncolumns = 90\nrows = 23\n\n[lights]\ncount = 24\n"
        );
        fs::write(self.configuration(), text).unwrap();
    }

    /// `lightcast run --config` with this configuration; standard output and error are pipes.
    pub fn command(&self) -> Command {
        let mut command = lightcast();
        command.args(["run", "--config"]).arg(self.configuration());
        command
    }

    pub fn run(&self) -> Output {
        self.command().output().unwrap()
    }
}

/// A panorama of a given size at a time; also used for frames of the wrong size.
pub fn panorama(width: usize, height: usize, time: u64) -> Frame {
    let mut values = Vec::new();
    for row in 0..height {
        for column in 0..width {
            let is_sun = row == 5 && column as u64 == (7 * time) % width as u64;
            let sky = 1.0 + 0.2 * (0.9 * time as f32 + 0.1 * column as f32).sin();
            let radiance = if is_sun { 5e4 } else { sky * (height - row) as f32 / height as f32 };
            values.extend([radiance, 0.9 * radiance, 0.7 * radiance]);
        }
    }
    Frame { width, height, channels: 3, pixels: Pixels::Radiance(values), ..Frame::default() }
}

/// The program, without environment variables of the caller that change its messages.
pub fn lightcast() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lightcast"));
    command.env_remove("RUST_LOG").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// The light lists of an output; asserts that each is a complete line.
pub fn lists(stdout: &[u8]) -> Vec<serde_json::Value> {
    assert!(stdout.is_empty() || stdout.ends_with(b"\n"), "the last line is whole");
    String::from_utf8(stdout.to_vec())
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// The files of a folder, in order.
pub fn names(folder: &Path) -> Vec<String> {
    let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(name).collect();
    names.sort();
    names
}
