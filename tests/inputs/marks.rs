//! Texts as programs on Windows write them, with a byte order mark and CRLF: every kind of file means what it
//! means without.

use lightcast::calibrate::{Calibration, CornerSet};
use lightcast::config::Config;
use lightcast::net::Token;
use lightcast::wire::ListFile;
use lightcast_core::light::LightList;
use std::fmt::Debug;
use std::fs;
use std::path::Path;

const OWN: &str = r#"{"version": 1,
 "lens": {"model": "kannala-brandt", "width": 640, "height": 480, "fx": 150.0, "fy": 151.0, "cx": 320.5,
          "cy": 240.0, "k": [0.01, 0.0, 0.0, 0.0], "field_of_view_deg": 180.0}}
"#;

const KALIBR: &str = "cam0:
  camera_model: pinhole
  distortion_coeffs: [0.003, 0.0007, -0.002, 0.0002]
  distortion_model: equidistant
  intrinsics: [190.9, 190.8, 254.9, 256.8]
  resolution: [512, 500]
";

const CORNERS: &str = r#"{"version": 1, "image_size": [640, 480], "pixel_centres": "half",
 "board": {"columns": 2, "rows": 1, "pitch_m": 0.1},
 "views": [{"name": "a.png", "corners_px": [[10, 20], [30, 40]]}]}
"#;

const CONFIGURATION: &str = "[source]
kind = \"sequence\"
path = \"a.####.exr\"

[lights]
count = 12
";

/// Writes `text` plainly and as programs on Windows do, in folders of their own, and requires `read` to give
/// the same of both.
fn check<T: Debug>(name: &str, text: &str, read: impl Fn(&Path) -> T) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    let plain = format!("{:?}", read(&path));
    fs::write(&path, format!("\u{feff}{}", text.replace('\n', "\r\n"))).unwrap();
    assert_eq!(format!("{:?}", read(&path)), plain, "{name}");
}

#[test]
fn calibrations_corners_and_boards() {
    let calibration = |path: &Path| Calibration::load(path, None).unwrap();
    check("own.json", OWN, calibration);
    check("kalibr.yaml", KALIBR, calibration);
    check("corners.json", CORNERS, |path| CornerSet::load(path).unwrap());
    #[cfg(feature = "april-grid")]
    check(
        "board.yaml",
        "target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 6\ntagSize: 0.088\ntagSpacing: 0.3\n",
        |path| lightcast::calibrate::AprilGrid::load(path).unwrap(),
    );
}

#[test]
fn configurations_and_tokens() {
    check("run.toml", CONFIGURATION, |path| {
        let config = Config::load(path).unwrap();
        (config.lights.count, config.map, config.links)
    });
    let secret = "abcdefgh-12345678";
    check("token", &format!("{secret}\n"), |path| {
        assert!(Token::load(path).unwrap().is(secret.as_bytes()), "the whole line and nothing else");
    });
}

#[test]
fn lists() {
    let golden = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/replay.jsonl"));
    check("lists.jsonl", &golden.unwrap(), |path| {
        let (mut file, mut list, mut all) = (ListFile::open(path).unwrap(), LightList::default(), Vec::new());
        while file.read(&mut list).unwrap() {
            all.push(list.clone());
        }
        assert_eq!(all.len(), 5);
        all
    });
}

#[cfg(feature = "render")]
#[test]
fn scenes() {
    use lightcast::scene::Scene;
    let shape = |path: &Path| {
        let scene = Scene::load(path).unwrap();
        assert!(!scene.meshes.is_empty());
        let meshes = scene.meshes.iter().map(|mesh| (mesh.indices.clone(), format!("{:?}", mesh.vertices)));
        (meshes.collect::<Vec<_>>(), scene.notes.clone())
    };
    check("a.obj", "# a corner\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", shape);
    check(
        "a.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        shape,
    );
    check(
        "a.gltf",
        r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
 "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
 "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
 "bufferViews": [{"buffer": 0, "byteLength": 36}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}]}
"#,
        shape,
    );
}
