use crate::recording::{Recording, lightcast, names, panorama, stderr};
use lightcast::files::{self, write_exr};
use lightcast::rt::Shutdown;
use lightcast_core::image::{Frame, Pixels};
use lightcast_core::test_data::say_skipped;
use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Output};
use std::time::Duration;

/// Runs `lightcast render` at a small size; `None` where there is no graphics adapter, after reporting it.
fn render(input: &Path, output: &Path, options: &[&str]) -> Option<Output> {
    let mut command = lightcast();
    command.arg("render").arg(input).arg("--output").arg(output);
    if !options.contains(&"--size") {
        command.args(["--size", "48x36"]);
    }
    let run = command.args(["--samples", "1"]).args(options).output().unwrap();
    if stderr(&run).contains("there is no graphics adapter") {
        say_skipped("there is no graphics adapter");
        return None;
    }
    Some(run)
}

fn radiance(path: &Path) -> Vec<f32> {
    let mut frame = Frame::default();
    files::read(path, &mut frame).unwrap();
    assert_eq!((frame.width, frame.height, frame.channels), (48, 36, 3));
    let Pixels::Radiance(values) = frame.pixels else { panic!("radiance") };
    assert!(values.iter().all(|v| v.is_finite() && *v >= 0.0));
    values
}

#[test]
fn a_panorama_its_list_and_its_reference_look_alike() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_exr(&at("sky.exr"), &panorama(64, 32, 3), None, false).unwrap();
    let map_options = ["--hemisphere", "--resolution", "60x15"];
    let Some(run) = render(&at("sky.exr"), &at("map.exr"), &map_options) else { return };
    assert!(run.status.success(), "{}", stderr(&run));
    let run = render(&at("sky.exr"), &at("map.png"), &map_options).unwrap();
    assert!(run.status.success(), "{}", stderr(&run));
    let run = render(&at("sky.exr"), &at("frames"), &map_options).unwrap();
    assert!(run.status.success(), "{}", stderr(&run));
    let picture = |path: &str| fs::read(at(path)).unwrap();
    assert_eq!(
        picture("frames/frame_00000.png"),
        picture("map.png"),
        "a folder gets the one picture there is"
    );
    let reference = [&map_options[..], &["--reference"]].concat();
    let run = render(&at("sky.exr"), &at("reference.exr"), &reference).unwrap();
    assert!(run.status.success(), "{}", stderr(&run));
    let mut lights = lightcast();
    lights.arg("lights").arg(at("sky.exr")).args(map_options).args(["--lights", "1152"]);
    fs::write(at("sky.jsonl"), lights.output().unwrap().stdout).unwrap();
    let run = render(&at("sky.jsonl"), &at("list.exr"), &[]).unwrap();
    assert!(run.status.success(), "{}", stderr(&run));

    let map = radiance(&at("map.exr"));
    assert_eq!(map, radiance(&at("list.exr")), "the program makes the same list of the same map");
    let reference = radiance(&at("reference.exr"));
    let mean = reference.iter().sum::<f32>() / reference.len() as f32;
    let difference = map.iter().zip(&reference).map(|(a, b)| (a - b).abs()).sum::<f32>() / map.len() as f32;
    println!("mean difference {} of {mean}", difference / mean);
    assert!(mean > 0.0 && difference < 0.05 * mean, "{difference} {mean}");
    assert!(fs::metadata(at("map.png")).unwrap().len() > 500);
}

#[test]
fn a_sequence_gives_numbered_pictures_and_the_same_each_time() {
    let recording = Recording::new(9);
    let (first, second) = (recording.path().join("first"), recording.path().join("second"));
    let Some(run) = render(&recording.configuration(), &first, &["--every", "4"]) else { return };
    assert!(run.status.success(), "{}", stderr(&run));
    let summary = stderr(&run);
    let row = summary.lines().find(|line| line.starts_with("render")).unwrap_or_else(|| panic!("{summary}"));
    assert_eq!(row.split_whitespace().nth(1), Some("9"), "{summary}");
    let names = names(&first);
    assert_eq!(names, ["frame_00004.png", "frame_00008.png"], "those of which `run --pictures` draws maps");
    assert!(render(&recording.configuration(), &second, &["--every", "4"]).unwrap().status.success());
    let (single, all) = (recording.path().join("first.png"), recording.path().join("all"));
    for output in [&single, &all] {
        assert!(render(&recording.configuration(), output, &["--every", "1"]).unwrap().status.success());
    }
    let first_of_all = all.join("frame_00000.png");
    assert_eq!(fs::read(single).unwrap(), fs::read(first_of_all).unwrap(), "a file gets the first");
    for name in names {
        assert_eq!(fs::read(first.join(&name)).unwrap(), fs::read(second.join(&name)).unwrap(), "{name}");
    }
}

/// Sends SIGINT once the program handles it and, if a folder is to be made, has made it and begun to draw.
/// False where it has ended before, for lack of a graphics adapter.
fn interrupt_when_ready(child: &mut Child, folder: Option<&Path>) -> bool {
    let tasks = format!("/proc/{}/task", child.id());
    loop {
        let has_signals = fs::read_dir(&tasks).is_ok_and(|tasks| {
            tasks.flatten().any(|task| {
                fs::read_to_string(task.path().join("comm")).is_ok_and(|name| name.trim() == "signals")
            })
        });
        if has_signals && folder.is_none_or(Path::exists) {
            break;
        }
        if child.try_wait().unwrap().is_some() {
            let mut messages = String::new();
            child.stderr.take().unwrap().read_to_string(&mut messages).unwrap();
            assert!(messages.contains("there is no graphics adapter"), "{messages}");
            return false;
        }
        Shutdown::new().wait(Duration::from_millis(20));
    }
    Shutdown::new().wait(Duration::from_millis(300));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    true
}

#[test]
fn an_interrupt_ends_pictures_within_one_sample_of_the_one_in_progress() {
    let recording = Recording::new(4);
    let output = recording.path().join("frames");
    // Of the first list and the whole sequence, far more samples than anybody waits for.
    for target in [&output, &recording.path().join("picture.png")] {
        let mut command = lightcast();
        command.arg("render").arg(recording.configuration()).arg("--output").arg(target);
        command.args(["--size", "640x480", "--samples", "4096", "--every", "1"]);
        let mut child = command.spawn().unwrap();
        if !interrupt_when_ready(&mut child, (*target == output).then_some(&output)) {
            say_skipped("there is no graphics adapter");
            return;
        }
        let run = child.wait_with_output().unwrap();
        let (status, rest) = (run.status, stderr(&run));
        if *target == output {
            assert_eq!(status.code(), Some(0), "{rest}");
            assert!(names(&output).is_empty(), "a picture of a part of its samples is none");
        } else {
            assert_eq!(status.code(), Some(1), "{rest}");
            assert!(rest.contains("interrupted; there is no picture") && !target.exists(), "{rest}");
        }
    }
}

#[test]
fn a_sequence_no_longer_than_the_filters_delay_says_why_there_is_no_picture() {
    let recording = Recording::new(3);
    let folder = recording.path().join("pictures");
    let run = recording.command().arg("--pictures").arg(&folder).output().unwrap();
    assert!(run.status.success(), "{}", stderr(&run));
    assert!(stderr(&run).contains("no picture was drawn: the filter gives the lights"), "{}", stderr(&run));
    let frames = recording.path().join("frames");
    let Some(run) = render(&recording.configuration(), &frames, &["--every", "2"]) else { return };
    assert!(run.status.success() && names(&frames).is_empty(), "{}", stderr(&run));
    assert!(stderr(&run).contains("frames: no picture was drawn"), "{}", stderr(&run));
}

#[test]
fn faults_are_told_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write_exr(&at("sky.exr"), &panorama(64, 32, 3), None, false).unwrap();
    fs::write(at("empty.jsonl"), "\n").unwrap();
    fs::write(at("scene.gltf"), "{}").unwrap();
    let missing = at("missing.glb");
    let scene = at("scene.gltf");
    for (input, output, options, code, expected) in [
        ("sky.exr", "a.jpg", &[][..], 2, "names no kind of picture"),
        ("sky.####.exr", "a.png", &[], 2, "sky.####.exr: is a folder or pattern of numbered panoramas"),
        ("empty.jsonl", "a.png", &[], 1, "empty.jsonl: holds no light list"),
        ("empty.jsonl", "a.png", &["--reference"], 2, "give a panorama"),
        ("sky.exr", "a.png", &["--scene", missing.to_str().unwrap()], 2, "missing.glb"),
        ("sky.exr", "a.png", &["--scene", scene.to_str().unwrap()], 2, "scene.gltf"),
        ("sky.exr", "a.png", &["--lights", "0"], 2, "0 lights"),
        ("sky.exr", "a.png", &["--size", "99999x1"], 2, "99999 x 1 pixels"),
        ("sky.exr", "a.png", &["--shadow-map-size", "4"], 2, "shadow maps of 4 x 4 texels"),
        ("sky.exr", "a.png", &["--eye", "1,1,1", "--target", "1,1,1"], 2, "the same point"),
        ("sky.exr", "a.png", &["--fov", "180"], 2, "0.1 to 170 degrees"),
    ] {
        let Some(run) = render(&at(input), &at(output), options) else { return };
        assert_eq!(run.status.code(), Some(code), "{input} {options:?}: {}", stderr(&run));
        assert!(stderr(&run).contains(expected), "{input} {options:?}: {}", stderr(&run));
    }
}
