//! The table of commands by inputs in `docs/commands.md`: every cell is run on small inputs.

use crate::recording::{Recording, lightcast, panorama, stderr};
use crate::server::Server;
use lightcast::files::write_exr;
use lightcast::rt::Shutdown;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The kinds of input.
const INPUTS: [&str; 7] = [
    "panorama",
    "numbered panoramas",
    "light lists",
    "configuration",
    "server",
    "`-`, light lists",
    "`-`, panorama",
];

/// The expected result of a command on an input.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Cell {
    /// It succeeds and writes the output of the row.
    Yes,
    /// It does not end by itself: it is asked to end once it has written the output of the row, and succeeds.
    Endless,
    /// It accepts the input, but takes minutes: only tested by hand.
    Long,
    /// It is refused with an error that names the input and has these words.
    No(&'static str),
}

use Cell::{Endless, Long, No, Yes};

/// A command with an output.
struct Row {
    /// The command as shown in the documentation.
    shown: &'static str,
    /// `INPUT` and `OUT/` stand for an input and a folder.
    words: &'static str,
    /// File in `OUT/` that exists afterwards; empty: the command writes to standard output.
    made: &'static str,
    needs_gpu: bool,
    cells: [Cell; INPUTS.len()],
}

const MADE_ALREADY: Cell = No("its lights are made already");

const ROWS: &[Row] = &[
    Row {
        shown: "`run`: lists",
        words: "run INPUT --output OUT/lists.jsonl",
        made: "lists.jsonl",
        needs_gpu: false,
        cells: [
            No("`lightcast lights` makes the lights of one panorama"),
            No("whose section [source] has it as its path"),
            MADE_ALREADY,
            Yes,
            No("its lights are made there"),
            MADE_ALREADY,
            No("`lightcast lights` makes the lights of one panorama"),
        ],
    },
    Row {
        shown: "`record`: frames",
        words: "record INPUT --output OUT/recording",
        made: "recording/recording.json",
        needs_gpu: false,
        cells: [
            No("`lightcast record` does not take"),
            No("whose section [source] has it as its path"),
            No("`lightcast record` does not take"),
            Yes,
            No("`lightcast record` does not take"),
            No("`lightcast record` does not take"),
            No("`lightcast record` does not take"),
        ],
    },
    Row {
        shown: "`lights`: a list",
        words: "lights INPUT",
        made: "",
        needs_gpu: false,
        cells: [
            Yes,
            No("name one of the panoramas"),
            MADE_ALREADY,
            No("`lightcast run` makes the lights"),
            No("`lightcast watch` prints the lights"),
            MADE_ALREADY,
            Yes,
        ],
    },
    Row {
        shown: "`lights --picture`: the map with its lights",
        words: "lights INPUT --output OUT/list.jsonl --picture OUT/map.png",
        made: "map.png",
        needs_gpu: false,
        cells: [
            Yes,
            No("name one of the panoramas"),
            MADE_ALREADY,
            No("`lightcast run` makes the lights"),
            No("`lightcast watch` prints the lights"),
            MADE_ALREADY,
            Yes,
        ],
    },
    Row {
        shown: "`render --output FILE`: a picture",
        words: "render INPUT --output OUT/picture.png --size 48x36 --samples 1",
        made: "picture.png",
        needs_gpu: true,
        cells: [Yes, No("name one of the panoramas"), Yes, Yes, Yes, Yes, Yes],
    },
    Row {
        shown: "`render --output FOLDER`: a picture of every list",
        words: "render INPUT --output OUT/frames --size 48x36 --samples 1",
        made: "frames",
        needs_gpu: true,
        cells: [Yes, No("name one of the panoramas"), Yes, Yes, Endless, Yes, Yes],
    },
    Row {
        shown: "`watch`: what comes",
        words: "watch INPUT --count 3",
        made: "",
        needs_gpu: false,
        cells: WATCHED,
    },
    Row {
        shown: "`watch --json`: lists",
        words: "watch INPUT --count 3 --json --lights 4",
        made: "",
        needs_gpu: false,
        cells: WATCHED,
    },
    Row {
        shown: "`watch --record`: lists in a file",
        words: "watch INPUT --count 3 --record OUT/lists.jsonl",
        made: "lists.jsonl",
        needs_gpu: false,
        cells: WATCHED,
    },
    Row {
        shown: "`watch --render`: pictures",
        words: "watch INPUT --render --output OUT/picture.png --size 48x36 --samples 1",
        made: "picture.png",
        needs_gpu: true,
        cells: [Yes, No("name one of the panoramas"), Yes, Yes, Yes, Yes, Yes],
    },
    Row {
        shown: "`report`: tables, or a page",
        words: "report INPUT --tables --lights 4",
        made: "",
        needs_gpu: false,
        cells: [
            Yes,
            Yes,
            No("have no map to measure lights against"),
            Yes,
            No("come without a map to measure them against"),
            No("have no map to measure lights against"),
            Yes,
        ],
    },
    Row {
        shown: "`report-pictures`: tables",
        words: "report-pictures INPUT --size 32x24 --resolution 24x6 --shadow-maps 8",
        made: "",
        needs_gpu: true,
        cells: [
            Yes,
            No("name one of the panoramas"),
            MADE_ALREADY,
            No("name a panorama"),
            No("name a panorama"),
            MADE_ALREADY,
            Yes,
        ],
    },
    Row {
        shown: "`report-speed`: tables",
        words: "report-speed INPUT",
        made: "",
        needs_gpu: true,
        cells: [
            Long,
            No("name one of the panoramas"),
            MADE_ALREADY,
            No("name a panorama"),
            No("name a panorama"),
            MADE_ALREADY,
            Long,
        ],
    },
];

/// The inputs of `watch`.
const WATCHED: [Cell; INPUTS.len()] = [
    No("of one panorama no lists come"),
    No("its lists have yet to be made"),
    Yes,
    No("its lists have yet to be made"),
    Yes,
    Yes,
    No("of one panorama no lists come"),
];

#[test]
fn the_documentation_has_the_table() {
    let yes = |cell: &Cell| if matches!(cell, No(_)) { "no" } else { "yes" };
    let mut table = format!("| | {} |\n|---|{}\n", INPUTS.join(" | "), "---|".repeat(INPUTS.len()));
    for row in ROWS {
        let cells: Vec<&str> = row.cells.iter().map(yes).collect();
        table += &format!("| {} | {} |\n", row.shown, cells.join(" | "));
    }
    println!("{table}");
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/commands.md")).unwrap();
    assert!(page.contains(&table), "docs/commands.md has another table than this:\n{table}");
}

#[test]
fn every_command_takes_every_input_or_refuses_it_by_name() {
    let given = Given::new();
    let mut is_gpu_there = true;
    for row in ROWS {
        for (index, (&cell, input)) in row.cells.iter().zip(INPUTS).enumerate() {
            if cfg!(not(feature = "render")) && (row.needs_gpu || row.words.contains("report-")) {
                continue;
            }
            if cell == Long || (row.needs_gpu && !is_gpu_there && !matches!(cell, No(_))) {
                continue;
            }
            let out = tempfile::tempdir().unwrap();
            let mut command = given.command(row.words, index, out.path());
            let made = out.path().join(row.made);
            if cell == Endless {
                end_when_made(&mut command, &made);
                continue;
            }
            let run = command.output().unwrap();
            let (place, said) = (format!("{} of {input}", row.words), stderr(&run));
            if row.needs_gpu && said.contains("there is no graphics adapter") {
                is_gpu_there = false;
                // Not eprintln!, which the test harness swallows when a test passes.
                let _ = writeln!(std::io::stderr(), "skipped: {place}: there is no graphics adapter");
                continue;
            }
            match cell {
                No(words) => {
                    assert_eq!(run.status.code(), Some(2), "{place}: {said}");
                    assert!(said.contains(&given.name(index)) && said.contains(words), "{place}: {said}");
                    assert!(run.stdout.is_empty(), "{place}");
                    assert_eq!(size(out.path()), 0, "{place}: something is made");
                }
                _ => {
                    assert_eq!(run.status.code(), Some(0), "{place}: {said}");
                    let is_watch = row.words == "watch INPUT --count 3";
                    if is_watch {
                        assert!(run.stdout.is_empty() && said.contains("lists/s"), "{place}: {said}");
                    } else if row.made.is_empty() {
                        assert!(!run.stdout.is_empty(), "{place}: {said}");
                    } else {
                        assert!(size(&made) > 0, "{place}: nothing is made; {said}");
                    }
                }
            }
        }
    }
}

/// Bytes of a file, or number of entries of a folder.
fn size(path: &Path) -> u64 {
    match fs::read_dir(path) {
        Ok(entries) => entries.count() as u64,
        Err(_) => fs::metadata(path).map_or(0, |metadata| metadata.len()),
    }
}

/// Ends a command by a signal once it has written something; it must succeed.
fn end_when_made(command: &mut Command, made: &Path) {
    let mut child = command.stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    let started = Instant::now();
    while size(made) == 0 && child.try_wait().unwrap().is_none() {
        assert!(started.elapsed() < Duration::from_secs(120), "{command:?} makes nothing");
        Shutdown::new().wait(Duration::from_millis(20));
    }
    // It may have ended by itself already.
    assert!(child.try_wait().unwrap().is_none(), "{command:?} has ended by itself");
    let _ = Command::new("sh").args(["-c", &format!("kill -TERM {}", child.id())]).status();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{command:?}");
}

/// Small inputs of every kind.
struct Given {
    recording: Recording,
    server: Server,
}

impl Given {
    fn new() -> Self {
        let recording = Recording::new(12);
        let given = Self { recording, server: Server::start() };
        write_exr(&given.at("garden.exr"), &panorama(64, 32, 3), None, false).unwrap();
        let lists = given.recording.run();
        assert!(lists.status.success(), "{}", stderr(&lists));
        fs::write(given.at("lists.jsonl"), lists.stdout).unwrap();
        given
    }

    fn at(&self, name: &str) -> PathBuf {
        self.recording.path().join(name)
    }

    /// An input as written on the command line.
    fn word(&self, index: usize) -> String {
        let path = match index {
            0 => self.at("garden.exr"),
            1 => self.at("sky.####.exr"),
            2 => self.at("lists.jsonl"),
            3 => self.recording.configuration(),
            4 => return self.server.url.clone(),
            _ => return "-".to_owned(),
        };
        path.to_str().unwrap().to_owned()
    }

    /// Its name in messages.
    fn name(&self, index: usize) -> String {
        if index < 5 { self.word(index) } else { "standard input".to_owned() }
    }

    fn command(&self, words: &str, index: usize, out: &Path) -> Command {
        let mut command = lightcast();
        command.args(words.split(' ').map(|word| match word.strip_prefix("OUT/") {
            Some(name) => out.join(name).to_str().unwrap().to_owned(),
            None if word == "INPUT" => self.word(index),
            None => word.to_owned(),
        }));
        let open = |name: &str| Stdio::from(File::open(self.at(name)).unwrap());
        match index {
            5 => command.stdin(open("lists.jsonl")),
            6 => command.stdin(open("garden.exr")),
            _ => command.stdin(Stdio::null()),
        };
        command
    }
}
