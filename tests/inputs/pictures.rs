//! Panoramas: where their pixels lie, what their numbers mean, how they are laid out.

use super::{fault, lightcast, said};
use lightcast::files::write_exr;
use lightcast_core::image::{Frame, Pixels};
use std::path::Path;

/// The power of a panorama's lights and what was said.
fn power(path: &Path, arguments: &[&str]) -> ([f64; 3], String) {
    let output = lightcast(&[&["lights", "--lights", "4"], arguments].concat(), path);
    assert!(output.status.success(), "{}: {}", path.display(), said(&output));
    let list: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let power = [0, 1, 2].map(|channel| list["power"][channel].as_f64().unwrap());
    (power, said(&output))
}

fn assert_power(name: &str, expected: [f64; 3]) -> String {
    let Some(path) = fault(name) else { return String::new() };
    let (found, said) = power(&path, &[]);
    // The mantissas of RGBE have eight bits and are taken as they are, without half a step.
    let tolerance = if name.ends_with(".hdr") { 0.02 } else { 0.006 };
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < tolerance, "{name}: {found} instead of {expected}");
    }
    said
}

fn refusal(name: &str, arguments: &[&str]) -> Option<String> {
    let path = fault(name)?;
    let output = lightcast(&[&["lights", "--lights", "4"], arguments].concat(), &path);
    assert!(!output.status.success() && output.stdout.is_empty(), "{name}: {}", said(&output));
    let said = said(&output);
    assert!(said.contains(name), "{said}");
    Some(said)
}

/// The clients' tests have directions for Blender and three.js from the same table.
#[test]
fn suns_of_panoramas_have_the_directions_that_the_clients_turn() {
    let table = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clients/suns.json");
    let suns: serde_json::Value = serde_json::from_slice(&std::fs::read(table).unwrap()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sun.exr");
    let (width, height) = (360, 180);
    for sun in suns.as_array().unwrap() {
        let [u, v] = ["u", "v"].map(|key| sun[key].as_f64().unwrap());
        // v counts from below, as in the texture coordinates of renderers.
        let (column, row) = ((u * width as f64) as usize, ((1.0 - v) * height as f64) as usize);
        let mut values = vec![0.0; 3 * width * height];
        values[3 * (row * width + column)..][..3].fill(1000.0);
        let frame =
            Frame { width, height, channels: 3, pixels: Pixels::Radiance(values), ..Frame::default() };
        write_exr(&path, &frame, None, false).unwrap();
        let output = lightcast(&["lights", "--lights", "1"], &path);
        let list: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let cosine: f64 = (0..3)
            .map(|axis| {
                list["lights"][0]["direction"][axis].as_f64().unwrap()
                    * sun["direction"][axis].as_f64().unwrap()
            })
            .sum();
        // A corner of the picture's pixel, and half a pixel of the map, both of one degree.
        assert!(cosine > 1.5_f64.to_radians().cos(), "{sun}: {}", list["lights"][0]);
    }
}

#[test]
fn a_data_window_lies_where_it_says_and_the_rest_is_black() {
    assert_power("e_plain.exr", [12.00, 8.98, 5.82]);
    assert_power("e_crop.exr", [10.45, 7.39, 4.01]);
}

#[test]
fn primaries_are_those_that_the_file_names() {
    assert_power("e_xyz.exr", [12.00, 8.98, 5.82]);
    assert_power("h_plain.hdr", [11.99, 8.97, 5.82]);
    // ACES AP0: not the numbers of the file.
    if let Some(path) = fault("h_prim.hdr") {
        let (found, _) = power(&path, &[]);
        println!("h_prim.hdr: {found:?}");
        assert!((found[0] - 11.99).abs() > 0.5, "{found:?}");
    }
}

#[test]
fn a_sun_that_half_floats_cannot_hold_is_no_hole() {
    let Some(path) = fault("e_inf.exr") else { return };
    let (found, said) = power(&path, &[]);
    println!("e_inf.exr: {found:?}");
    assert!(found.iter().all(|power| *power > 100.0), "{found:?}");
    assert!(said.contains("samples are infinite"), "{said}");
}

#[test]
fn the_only_layer_is_the_picture() {
    assert_power("e_blender.exr", [12.00, 8.98, 5.82]);
}

#[test]
fn radiance_pictures_are_turned_and_their_line_ends_do_not_matter() {
    let Some(plain) = fault("h_plain.hdr") else { return };
    let lights = |path: &Path| lightcast(&["lights", "--lights", "4"], path).stdout;
    for name in ["h_plusY.hdr", "h_mirrorX.hdr"] {
        assert!(lights(&fault(name).unwrap()) == lights(&plain), "{name}: the same picture, the same lights");
    }
    if let Some(path) = fault("h_crlf.hdr") {
        // Its EXPOSURE is 2.
        println!("h_crlf.hdr: {:?}", power(&path, &[]).0);
    }
}

#[test]
fn what_is_not_supported_is_refused_as_what_it_is() {
    for (name, words) in
        [("e_yc.exr", "luminance/chroma"), ("e_htj2k32.exr", "HTJ2K"), ("h_xyze.hdr", "32-bit_rle_xyze")]
    {
        let Some(said) = refusal(name, &[]) else { continue };
        assert!(said.contains(words) && !said.contains("complete?"), "{said}");
    }
}

#[test]
fn a_probe_is_refused_until_its_layout_is_said_and_then_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("probe.hdr");
    // An angular map of 64 x 64, everywhere 0.5, as uncompressed RGBE.
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 64 +X 64\n".to_vec();
    bytes.extend([128, 128, 128, 128].repeat(64 * 64));
    std::fs::write(&path, bytes).unwrap();
    let output = lightcast(&["lights", "--lights", "4"], &path);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("--layout angular") && said(&output).contains("--layout mirror-ball"));
    // The whole sphere: 4 pi times the radiance.
    for layout in ["angular", "mirror-ball", "lat-long"] {
        let (found, _) = power(&path, &["--layout", layout]);
        let expected = 0.5 * 4.0 * std::f64::consts::PI;
        assert!(found.iter().all(|power| (power / expected - 1.0).abs() < 1e-4), "{layout}: {found:?}");
    }
    let output = lightcast(&["lights", "--lights", "4", "--layout", "cube-cross"], &path);
    assert!(said(&output).contains("four by three"), "{}", said(&output));
}

#[test]
fn frames_of_one_sequence_may_have_different_data_windows() {
    let Some(path) = fault("seq/crop/c.toml") else { return };
    let output = lightcast(&["run"], &path);
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(String::from_utf8(output.stdout.clone()).unwrap().lines().count(), 3, "{}", said(&output));
    assert!(!said(&output).contains("bad frame,"), "{}", said(&output));
}
