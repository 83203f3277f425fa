use crate::recording::{lightcast, lists, panorama, stderr};
use lightcast::files::{self, write_exr};
use lightcast_core::image::{Frame, Pixels};
use std::path::Path;
use std::process::Output;

fn lights(map: &Path, options: &[&str]) -> Output {
    lightcast().arg("lights").arg(map).args(options).output().unwrap()
}

#[test]
fn lights_prints_one_list_of_the_whole_map() {
    let folder = tempfile::tempdir().unwrap();
    let map = folder.path().join("sky.exr");
    write_exr(&map, &panorama(64, 32, 1), None, false).unwrap();
    for (options, count) in [
        (&[][..], 64),
        (&["--lights", "17", "--sampler", "equal-power"], 17),
        (&["--inversion", "standard", "--hemisphere"], 64),
        (&["--inversion", "normalised-rows", "--hemisphere"], 64),
        (&["--sampler", "median-cut", "--lights", "48"], 48),
        (&["--sampler", "variance-minimisation"], 64),
        (&["--sampler", "structured"], 64),
        (&["--sampler", "kollig-keller", "--lights", "100"], 100),
        (&["--resolution", "90x45"], 64),
        (&["--resolution", "90x22", "--hemisphere", "--sampler", "refined"], 64),
    ] {
        let output = lights(&map, options);
        assert!(output.status.success(), "{options:?}: {}", stderr(&output));
        let found = lists(&output.stdout);
        assert_eq!(found.len(), 1);
        let list = &found[0];
        assert_eq!((list["version"].as_u64(), list["sequence"].as_u64()), (Some(1), Some(0)));
        let lights = list["lights"].as_array().unwrap();
        assert_eq!(lights.len(), count, "{options:?}");
        let sum: f64 = lights.iter().map(|light| light["irradiance"][1].as_f64().unwrap()).sum();
        let power = list["power"][1].as_f64().unwrap();
        assert!((sum / power - 1.0).abs() < 1e-4, "{options:?}: {sum} of {power}");
        let is_upper = lights.iter().all(|light| light["direction"][1].as_f64().unwrap() >= 0.0);
        if options.contains(&"--hemisphere") {
            assert!(is_upper, "{options:?}");
        } else if !options.contains(&"equal-power") {
            // Equal-power lights may all lie in the sun.
            assert!(!is_upper, "{options:?}");
        }
    }
}

#[test]
fn a_list_goes_to_a_file_and_its_lights_onto_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let map = folder.path().join("sky.exr");
    write_exr(&map, &panorama(64, 32, 1), None, false).unwrap();
    let printed = lights(&map, &[]);
    let written = lights(&map, &["--output", &at("list.jsonl"), "--picture", &at("map.png")]);
    assert!(written.status.success() && written.stdout.is_empty(), "{}", stderr(&written));
    assert_eq!(std::fs::read(at("list.jsonl")).unwrap(), printed.stdout);
    let mut picture = Frame::default();
    files::read(at("map.png").as_ref(), &mut picture).unwrap();
    assert_eq!((picture.width, picture.height, picture.channels), (720, 360, 3));
    let Pixels::Codes(codes) = picture.pixels else { panic!("radiance") };
    let is_green = |pixel: &[u16]| pixel[1] > 200 && pixel[0] < 100 && pixel[2] < 120;
    assert!(codes.chunks(3).filter(|pixel| is_green(pixel)).count() > 100, "rings are green");
    let other = lights(&map, &["--picture", &at("map.jpg")]);
    assert_eq!(other.status.code(), Some(2));
    assert!(stderr(&other).contains("map.jpg: --picture draws a PNG file"), "{}", stderr(&other));
}

#[test]
fn lights_tells_what_is_wrong_and_where() {
    let folder = tempfile::tempdir().unwrap();
    let map = folder.path().join("sky.exr");
    let output = lights(&map, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("sky.exr"), "{}", stderr(&output));
    write_exr(&map, &panorama(64, 32, 1), None, false).unwrap();
    for options in [
        ["--lights", "0"],
        ["--resolution", "360"],
        ["--resolution", "0x9"],
        ["--resolution", "99999999999x99999999999"],
        ["--sampler", "best"],
    ] {
        assert_eq!(lights(&map, &options).status.code(), Some(2), "{options:?}");
    }
    write_exr(&map, &panorama(48, 32, 1), None, false).unwrap();
    let output = lights(&map, &[]);
    assert!(output.status.success() && stderr(&output).contains("twice as wide"), "{}", stderr(&output));
}
