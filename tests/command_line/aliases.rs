//! Former names of options and keys, which scripts still use.

use crate::recording::{Recording, lightcast, panorama, stderr};
use lightcast::files::write_exr;
use std::fs;
use std::path::Path;

/// Standard output of a command that must succeed.
fn output(words: &[&str]) -> Vec<u8> {
    let run = lightcast().args(words).output().unwrap();
    assert!(run.status.success(), "{words:?}: {}", stderr(&run));
    run.stdout
}

#[test]
fn the_number_of_lights_may_still_be_called_count() {
    let folder = tempfile::tempdir().unwrap();
    let sky = folder.path().join("sky.exr");
    write_exr(&sky, &panorama(64, 32, 1), None, false).unwrap();
    let sky = sky.to_str().unwrap();
    assert_eq!(output(&["lights", sky, "--lights", "17"]), output(&["lights", sky, "--count", "17"]));
    let help = String::from_utf8(output(&["lights", "--help"])).unwrap();
    assert!(help.contains("--lights <N>") && !help.contains("--count"), "{help}");
}

#[test]
fn a_configuration_is_positional_or_named_by_the_option() {
    let recording = Recording::new(3);
    let path = recording.configuration();
    let (path, other) = (path.to_str().unwrap(), recording.path().join("run.conf"));
    fs::copy(path, &other).unwrap();
    let other = other.to_str().unwrap();
    let lists = output(&["run", path]);
    assert_eq!(crate::recording::lists(&lists).len(), 3);
    for words in [["run", "--config", path], ["run", "-c", path], ["run", "--config", other]] {
        assert_eq!(output(&words), lists, "{words:?}");
    }
    for (number, words) in [&["record", path][..], &["record", "--config", path], &["record", "-c", other]]
        .into_iter()
        .enumerate()
    {
        let folder = recording.path().join(format!("recording-{number}"));
        output(&[words, &["--output", folder.to_str().unwrap()]].concat());
        assert!(folder.join("recording.json").is_file(), "{words:?}");
    }
    let twice = lightcast().args(["run", path, "--config", path]).output().unwrap();
    assert_eq!(twice.status.code(), Some(2));
    assert!(stderr(&twice).contains("cannot be used with"), "{}", stderr(&twice));
    let tables = |words: &[&str]| {
        let recording = Recording::new(12);
        fs::copy(recording.configuration(), recording.path().join("run.conf")).unwrap();
        let mut command = lightcast();
        command.current_dir(recording.path()).args(["report", "--tables", "--lights", "4"]).args(words);
        let run = command.output().unwrap();
        assert!(run.status.success(), "{words:?}: {}", stderr(&run));
        String::from_utf8(run.stdout).unwrap()
    };
    assert!(tables(&["run.toml"]).contains("run.toml"));
    assert!(tables(&["--config", "run.conf"]).contains("run.conf"));
}

#[test]
fn an_elevation_may_still_be_called_altitude() {
    let folder = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/day.toml");
    let text = fs::read_to_string(&script).unwrap();
    assert!(text.contains("elevation_deg"));
    let renamed = folder.path().join("day.toml");
    fs::write(&renamed, text.replace("elevation_deg", "altitude_deg")).unwrap();
    let made = [(script, "a"), (renamed, "b")].map(|(script, name)| {
        let out = folder.path().join(name);
        let (script, out_word) = (script.to_str().unwrap(), out.to_str().unwrap());
        output(&["synthesize", script, "--frames", "1", "--output", out_word]);
        let mut files: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        assert!(files.len() >= 2, "a frame and its calibration");
        files.iter().map(|file| fs::read(file).unwrap()).collect::<Vec<_>>()
    });
    assert_eq!(made[0], made[1]);

    let marks = "[[mark]]\npixel = [80, 50]\nazimuth_deg = 30.0\nelevation_deg = 50.0\n\
                 [[mark]]\npixel = [35, 70]\nazimuth_deg = 170.0\nelevation_deg = 40.0\n";
    let calibration = folder.path().join("a/calibration.json");
    let found = ["elevation_deg", "altitude_deg"].map(|key| {
        let file = folder.path().join(key);
        fs::write(&file, marks.replace("elevation_deg", key)).unwrap();
        let words = ["calibrate", "orientation", file.to_str().unwrap(), "--calibration"];
        output(&[&words[..], &[calibration.to_str().unwrap()]].concat())
    });
    assert!(!found[0].is_empty() && found[0] == found[1]);
}
