//! `lightcast report`: its page, and the page of an interrupted report.

use crate::recording::{Recording, lightcast, panorama, stderr};
use lightcast::files::write_exr;
use roxmltree::{Document, ParsingOptions};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Panoramas in a folder, one for each name.
fn panoramas(folder: &Path, names: &[&str]) -> Vec<PathBuf> {
    let write = |(time, name): (u64, &&str)| {
        let path = folder.join(name);
        write_exr(&path, &panorama(64, 32, time), None, false).unwrap();
        path
    };
    (1..).zip(names).map(write).collect()
}

fn json(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("report.json")).unwrap()).unwrap()
}

/// Parses the page, which must be valid XML, and passes it to `look`.
fn with_page<T>(folder: &Path, look: impl FnOnce(&Document) -> T) -> T {
    let html = fs::read_to_string(folder.join("index.html")).unwrap();
    look(
        &Document::parse_with_options(&html, ParsingOptions { allow_dtd: true, ..Default::default() })
            .unwrap(),
    )
}

#[test]
fn the_page_has_every_input_and_beside_each_table_the_command_that_prints_it() {
    let folder = tempfile::tempdir().unwrap();
    let maps = panoramas(folder.path(), &["it's <b>&.exr", "plain.exr"]);
    let sequence = Recording::new(12);
    fs::remove_file(sequence.configuration()).unwrap();
    let output = folder.path().join("out/report");
    let mut command = lightcast();
    command
        .arg("report")
        .args(&maps)
        .arg(sequence.path())
        .args(["--lights", "16,4,16", "--frames", "11", "--frame-rate", "25", "--output"])
        .arg(&output);
    let run = command.output().unwrap();
    assert!(run.status.success(), "{}", stderr(&run));
    assert!(String::from_utf8(run.stdout).unwrap().trim_end().ends_with("out/report/index.html"));

    let report = json(&output);
    assert_eq!((&report["complete"], &report["lights"]), (&Value::Bool(true), &serde_json::json!([4, 16])));
    let tables = with_page(&output, |page| {
        let text: Vec<&str> = page.descendants().filter_map(|node| node.text()).collect();
        assert!(text.iter().any(|text| text.contains("it's <b>&.exr")), "{text:?}");
        page.descendants().filter(|node| node.has_tag_name("table")).count()
    });
    assert!(tables >= 4, "two maps, their means, a sequence: {tables}");
    for name in ["maps_time.svg", "maps_lights.svg", "map_2.svg", "sequence_1.svg"] {
        assert!(Document::parse(&fs::read_to_string(output.join(name)).unwrap()).is_ok(), "{name}");
    }

    // Errors, unlike times, do not vary from run to run: the command prints exactly these figures.
    for (table, first) in [(&report["maps"][0], "irradiance"), (&report["sequences"][0], "error")] {
        let command = table["command"].as_str().unwrap();
        let program = command.replacen("lightcast", env!("CARGO_BIN_EXE_lightcast"), 1);
        let again = Command::new("sh").args(["-c", &program]).output().unwrap();
        assert!(again.status.success(), "{command}: {}", stderr(&again));
        let printed = String::from_utf8(again.stdout).unwrap();
        for row in table["rows"].as_array().unwrap() {
            let (method, lights) = (row["method"].as_str().unwrap(), row["lights"].to_string());
            let found = printed.lines().find_map(|line| {
                let cells: Vec<&str> = line.trim_start().strip_prefix(method)?.split_whitespace().collect();
                (cells.first() == Some(&lights.as_str())).then(|| cells[2].trim_end_matches('*').to_owned())
            });
            let found: f64 = found.unwrap_or_else(|| panic!("{row} is not in\n{printed}")).parse().unwrap();
            let expected = row[first].as_f64().unwrap();
            assert!((found - expected).abs() <= 0.006 * expected.abs(), "{found} {expected}");
        }
    }
}

/// Runs a report with these arguments until it prints `message`, and then interrupts it; it must end cleanly.
/// If it ends by itself before that, without the message, its messages are the error.
fn interrupted(mut command: Command, message: &str) -> Result<(), String> {
    let mut child = command.spawn().unwrap();
    let mut messages = BufReader::new(child.stderr.take().unwrap());
    let mut said = String::new();
    let mut line_start = 0;
    while !said[line_start..].contains(message) {
        line_start = said.len();
        if messages.read_line(&mut said).unwrap() == 0 {
            child.wait().unwrap();
            return Err(said);
        }
    }
    let interrupt = format!("kill -INT {}", child.id());
    assert!(Command::new("sh").args(["-c", &interrupt]).status().unwrap().success());
    let mut rest = String::new();
    messages.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{rest}");
    assert!(rest.contains("not complete"), "{rest}");
    Ok(())
}

#[test]
fn ctrl_c_keeps_what_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let names: Vec<String> = (0..30).map(|number| format!("map{number}x.exr")).collect();
    let maps = panoramas(folder.path(), &names.iter().map(String::as_str).collect::<Vec<_>>());
    let output = folder.path().join("report");
    let mut command = lightcast();
    command.arg("report").args(&maps).args(["--lights", "4,64", "--output"]).arg(&output);
    interrupted(command, "map0x.exr: measured").unwrap();

    let report = json(&output);
    let done = report["maps"].as_array().unwrap();
    assert!((1..30).contains(&done.len()), "{}", done.len());
    for (map, name) in done.iter().zip(&names) {
        assert_eq!(map["name"].as_str(), Some(name.as_str()));
        let rows = map["rows"].as_array().unwrap();
        assert!(rows.len() >= 6 && rows.iter().all(|row| row["shadow"].is_f64()), "{map}");
    }
    assert_eq!(report["complete"], Value::Bool(false));
    with_page(&output, |page| {
        assert!(page.descendants().any(|node| node.attribute("class") == Some("notice")));
        assert!(page.descendants().any(|node| node.has_tag_name("table")));
    });
    let left: Vec<_> = fs::read_dir(&output).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().ends_with(".new")), "{left:?}");
}

#[test]
fn ctrl_c_in_a_sequence_or_the_hard_cases_keeps_what_stands_before() {
    let folder = tempfile::tempdir().unwrap();
    let map = panoramas(folder.path(), &["sky.exr"]).remove(0);
    let sequence = Recording::new(12);
    let output = folder.path().join("report");
    let report = |message| {
        let mut command = lightcast();
        command.arg("report").arg(&map).arg(sequence.configuration());
        command.args(["--lights", "4", "--output"]).arg(&output);
        interrupted(command, message).unwrap();
        json(&output)
    };
    let tables = |report: &Value, key: &str| report[key].as_array().unwrap().len();
    let in_sequence = report("sky.exr: measured");
    assert_eq!((tables(&in_sequence, "maps"), tables(&in_sequence, "sequences")), (1, 0));
    let in_hard_cases = report("run.toml: measured");
    assert_eq!((tables(&in_hard_cases, "maps"), tables(&in_hard_cases, "sequences")), (1, 1));
    // Rows that were measured are complete; those after the last measured one are missing.
    let rows = in_hard_cases["stability"].as_array().unwrap();
    assert!(rows.iter().all(|row| row["figures"].is_object()), "{rows:?}");
}

#[cfg(feature = "render")]
#[test]
fn ctrl_c_in_pictures_keeps_those_of_the_maps_before() {
    use lightcast_core::image::{Frame, Pixels};
    use std::io::Write as _;
    let folder = tempfile::tempdir().unwrap();
    // Only a few pixels have light: the reference has one light for each.
    let path = |number: usize| folder.path().join(format!("{number}.exr"));
    for number in 0..8 {
        let samples = (0..64 * 32 * 3).map(|i| if i / 3 == 64 * 5 + number { 9.0 } else { 0.0 }).collect();
        let frame = Frame {
            width: 64,
            height: 32,
            channels: 3,
            pixels: Pixels::Radiance(samples),
            ..Frame::default()
        };
        write_exr(&path(number), &frame, None, false).unwrap();
    }
    let output = folder.path().join("report");
    let mut command = lightcast();
    command
        .arg("report")
        .args((0..8).map(path))
        .args(["--pictures", "--lights", "4", "--output"])
        .arg(&output);
    if let Err(messages) = interrupted(command, "pictures under 0.exr: measured") {
        assert!(messages.contains("no graphics adapter"), "{messages}");
        let test = std::thread::current().name().unwrap_or_default().to_owned();
        // Not eprintln!, which the test harness swallows when a test passes.
        let _ = writeln!(std::io::stderr(), "skipped: {test}: there is no graphics adapter");
        return;
    }
    let report = json(&output);
    assert_eq!((report["maps"].as_array().unwrap().len(), &report["complete"]), (8, &Value::Bool(false)));
    let pictures = report["pictures"].as_array().unwrap();
    assert!((1..8).contains(&pictures.len()), "{}", pictures.len());
    for table in pictures {
        let rows = table["rows"].as_array().unwrap();
        assert!(
            rows.len() >= 9 && rows.iter().all(|row| row["rms"].is_f64() && row["flip"].is_f64()),
            "{table}"
        );
    }
}

#[test]
fn the_hard_cases_are_printed_alone() {
    let run = lightcast().args(["report", "--stability"]).output().unwrap();
    assert!(run.status.success(), "{}", stderr(&run));
    let printed = String::from_utf8(run.stdout).unwrap();
    assert!(printed.starts_with("hard case"), "{printed}");
    assert!(printed.lines().count() > 20 && !printed.contains("beyond the bound"), "{printed}");
}

#[test]
fn wrong_usage_of_the_report_is_told_before_anything_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let map = panoramas(folder.path(), &["sky.exr"]).remove(0);
    let (map, missing, configuration) = (map.to_str().unwrap(), at("missing.hdr"), at("missing.toml"));
    let below = format!("{map}/report");
    let [short, long, lensless] = [5, 12, 12].map(Recording::new);
    lensless.configure("pace = \"fast\"");
    let text = fs::read_to_string(lensless.configuration()).unwrap();
    fs::write(
        lensless.configuration(),
        text + "\n[camera]\nprojection = \"fisheye\"\ncalibration = \"nowhere.toml\"\n",
    )
    .unwrap();
    let file = |recording: &Recording| recording.configuration().to_str().unwrap().to_owned();
    let [short, long, lensless] = [&short, &long, &lensless].map(file);
    for (arguments, code, expected) in [
        (&["--tables", map, &missing][..], 1, "missing.hdr"),
        (&["--tables", map, &configuration], 2, "missing.toml"),
        (&["--tables", map, &lensless], 2, "nowhere.toml"),
        (&["--tables", map, &short], 2, "has 5 frames at 25 frames per second; at least 11"),
        (&["--tables", map, &long, "--frames", "10"], 2, "--frames 10 are too few"),
        (&["--tables", map, &long, "--frame-rate", "25"], 2, "frame_rate_hz"),
        (&["--tables", map, "--frame-rate", "25"], 2, "--frame-rate"),
        (&["--tables", map, "--frames", "20"], 2, "--frames"),
        (&["--tables", map, map], 2, "named twice"),
        (&["--tables", map, "--garden", &missing, "--hall", map], 1, "missing.hdr"),
        (&["--tables", map, "--garden", map, "--hall", &missing], 1, "missing.hdr"),
        (&["--tables", map, "--lights", "0"], 2, "give 1 to 16384"),
        (&["--tables", map, "--lights", "4,x"], 2, "give 1 to 16384"),
        (&["--tables", map, "--output", "report"], 2, "--output"),
        (&["--tables", map, "--garden", map], 2, "--hall"),
        (&["--stability", map], 2, "--stability"),
        (&["--stability", "--tables"], 2, "--stability"),
        (&["--stability", "--lights", "4"], 2, "--stability"),
        (&["--stability", "--garden", map, "--hall", map], 2, "--stability"),
        #[cfg(feature = "render")]
        (&["--stability", "--pictures"], 2, "--stability"),
        #[cfg(feature = "render")]
        (&["--tables", &long, "--pictures"], 2, "--pictures"),
        (&[map, "--output", &below], 1, "the folder for the report cannot be made"),
        (&["--tables", "--lights", "4", "nowhere/sky.####.exr"], 2, "sky.####.exr"),
    ] {
        let run = lightcast().arg("report").args(arguments).output().unwrap();
        assert_eq!(run.status.code(), Some(code), "{arguments:?}: {}", stderr(&run));
        assert!(stderr(&run).contains(expected), "{arguments:?}: {}", stderr(&run));
        assert!(run.stdout.is_empty(), "{arguments:?}");
    }
    let output = at("report");
    let run = lightcast().args(["report", map, &configuration, "--output", &output]).output().unwrap();
    assert!(!run.status.success() && !Path::new(&output).exists(), "{}", stderr(&run));
}
