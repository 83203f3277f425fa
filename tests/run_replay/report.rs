use crate::recording::{lightcast, panorama, stderr};
use lightcast::files::write_exr;
use std::fs;
use std::io::Write;
use std::process::Output;

/// Runs the program; `None` where there is no graphics adapter, after reporting it.
fn run(arguments: &[&str]) -> Option<Output> {
    let run = lightcast().args(arguments).output().unwrap();
    if stderr(&run).contains("there is no graphics adapter") {
        let test = std::thread::current().name().unwrap_or_default().to_owned();
        // Not eprintln!, which the test harness swallows when a test passes.
        let _ = writeln!(std::io::stderr(), "skipped: {test}: there is no graphics adapter");
        return None;
    }
    Some(run)
}

#[test]
fn the_error_of_pictures_is_a_table_and_a_plot() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (sky, scene, plot) = (at("sky.exr"), at("hill.obj"), at("plots/error.svg"));
    write_exr(sky.as_ref(), &panorama(64, 32, 3), None, false).unwrap();
    fs::write(&scene, "v 0 1 0\nv -1 0 1\nv 1 0 1\nv 0 0 -1\nf 1 2 3\nf 1 3 4\nf 1 4 2\n").unwrap();
    let arguments = ["report-pictures", &sky, "--scene", &scene, "--plot", &plot];
    let small = ["--size", "32x24", "--resolution", "24x6", "--shadow-maps", "72"];
    let Some(run) = run(&[&arguments[..], &small].concat()) else { return };
    assert!(run.status.success(), "{}", stderr(&run));

    let table = String::from_utf8(run.stdout).unwrap();
    println!("{table}");
    let adapter = table.lines().next().unwrap();
    assert!(adapter.contains("Vulkan; driver "), "{adapter}");
    for title in ["built-in scene, sky ", "hill, sky ", "geometric means over 2 "] {
        let rows: Vec<Vec<f64>> = table
            .lines()
            .skip_while(|line| !line.starts_with(title))
            .skip(2)
            .map_while(|line| line.split_whitespace().map(|cell| cell.parse().ok()).collect())
            .collect();
        let counts: Vec<f64> = rows.iter().map(|row| row[0]).collect();
        assert_eq!(counts, [4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0], "{title}");
        assert!(rows.iter().all(|row| row.len() == 7 && row.iter().all(|value| *value >= 0.0)), "{title}");
        let (few, many) = (&rows[0], &rows[5]);
        assert!(many[1] < few[1] && many[4] < few[4], "{title}: RMS of {few:?} and {many:?}");
    }

    let svg = fs::read_to_string(&plot).unwrap();
    let document = roxmltree::Document::parse(&svg).unwrap();
    let lines = document.descendants().filter(|node| node.has_tag_name("polyline"));
    // RMS and FLIP over all maps, RMS for the one map, two samplers each.
    assert_eq!(lines.count(), 3 * 2);
}

#[test]
fn wrong_usage_of_the_reports_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (sky, missing) = (at("sky.exr"), at("missing.glb"));
    write_exr(sky.as_ref(), &panorama(64, 32, 3), None, false).unwrap();
    for (arguments, expected) in [
        (&["report-pictures"][..], "<MAPS>"),
        (&["report-pictures", &sky, "--scene", &missing], "missing.glb"),
        (&["report-pictures", &sky, "--size", "0x1", "--resolution", "8x2"], "0 x 1 pixels"),
        (&["report-pictures", &sky, "--resolution", "0x2"], "columns = 0"),
        (&["report-speed", &missing], "missing.glb"),
    ] {
        let Some(run) = run(arguments) else { return };
        assert!(!run.status.success(), "{arguments:?}");
        assert!(stderr(&run).contains(expected), "{arguments:?}: {}", stderr(&run));
    }
}
