use super::*;
use lightcast_core::test_data::real_folder;

const OWN: &str = r#"{
  "version": 1,
  "lens": {"model": "kannala-brandt", "width": 640, "height": 480, "fx": 150.0, "fy": 151.0, "cx": 320.5,
           "cy": 240.0, "k": [0.01, 0.0, 0.0, 0.0], "field_of_view_deg": 180.0},
  "response": {"model": "piecewise-linear", "knees": [[16, 0.0], [1000, 1.0], [4000, 4096.0]]}
}"#;

const OPENCV_YAML: &str = "%YAML:1.0\n---\ncalibration_time: \"Mon 23 Nov\"\nimage_width: 1280\nimage_height: 800\n\
flags: 5\nfisheye_model: 1\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ \
5.58478087865323e+02, 0., 6.20458515360843e+02, 0.,\n       5.60506767351568e+02, 3.81939424848348e+02, 0., 0., \
1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ -1.4613319981768e-03, \
-3.29861110580401e-03,\n       6.05760088590183e-03, -3.74209380722371e-03 ]\n";

const OPENCV_JSON: &str = r#"{"K": {"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d",
 "data": [558.478087865323, 0.0, 620.458515360843, 0.0, 560.506767351568, 381.939424848348, 0, 0, 1]},
 "D": {"type_id": "opencv-matrix", "rows": 1, "cols": 4, "dt": "d",
 "data": [-0.0014613319981768, -0.00329861110580401, 0.00605760088590183, -0.00374209380722371]},
 "image_size": [1280, 800]}"#;

const OPENCV_XML: &str = r#"<?xml version="1.0"?>
<opencv_storage>
<image_Width>1280</image_Width>
<image_Height>800</image_Height>
<Camera_Matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt><data>
 5.58478087865323e+02 0. 6.20458515360843e+02 0. 5.60506767351568e+02 3.81939424848348e+02 0. 0. 1.</data>
</Camera_Matrix>
<Distortion_Coefficients type_id="opencv-matrix"><rows>4</rows><cols>1</cols><dt>d</dt><data>
 -1.4613319981768e-03 -3.29861110580401e-03 6.05760088590183e-03 -3.74209380722371e-03</data>
</Distortion_Coefficients>
</opencv_storage>"#;

const KALIBR: &str = "%YAML:1.0 # the type\n\ncam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.003, 0.0007, \
-0.002, 0.0002]\n  distortion_model: equidistant\n  intrinsics: [190.9, 190.8, 254.9, 256.8]\n  resolution: [512, \
500]\n  T_cam_imu:\n  - [1.0, 0.0, 0.0, 0.5]\ncam1:\n  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.0, 0.0, \
0.0]\n  distortion_model: equidistant\n  intrinsics: [200, 200, 250, 250]\n  resolution: [512, 512]\n";

fn message(text: &str) -> String {
    let error = Calibration::parse(text, None).unwrap_err();
    assert_eq!(error.kind(), crate::error::Kind::Usage);
    error.to_string()
}

#[test]
fn our_file_survives_the_way_out_and_in() {
    let calibration = Calibration::parse(OWN, None).unwrap();
    let lens = calibration.lens.parameters();
    assert_eq!((lens.width, lens.height, lens.fx, lens.fy), (640, 480, 150.0, 151.0));
    // Our own format has half-pixel centres: nothing is added.
    assert_eq!((lens.cx, lens.cy, lens.k), (320.5, 240.0, [0.01, 0.0, 0.0, 0.0]));
    assert!((lens.field_of_view_rad - std::f64::consts::PI).abs() < 1e-15);
    assert_eq!(calibration.response.saturation_code(), 4000);
    assert!(calibration.notes.is_empty());
    assert_eq!(Calibration::parse(&calibration.to_json(), None).unwrap(), calibration);
    assert!(Calibration::parse(OWN, Some("cam1")).is_err());
}

#[test]
fn opencv_files_load_from_yaml_json_and_xml_with_half_a_pixel_added() {
    let loaded = [OPENCV_YAML, OPENCV_JSON, OPENCV_XML].map(|text| Calibration::parse(text, None).unwrap());
    let lens = loaded[0].lens.parameters();
    assert_eq!((lens.width, lens.height), (1280, 800));
    assert_eq!((lens.fx, lens.fy), (558.478087865323, 560.506767351568));
    assert!((lens.cx - 620.958515360843).abs() < 1e-12 && (lens.cy - 382.439424848348).abs() < 1e-12);
    assert_eq!(lens.k[3], -0.00374209380722371);
    assert_eq!(loaded[0], loaded[1]);
    assert_eq!(loaded[0], loaded[2]);
    assert!(loaded[0].response.is_identity());
    assert!(loaded[0].notes[0].contains("farthest corner"), "{:?}", loaded[0].notes);
    let corner = loaded[0].lens.unproject(glam::DVec2::new(0.0, 0.0));
    assert!(corner.is_some(), "no pixel of the image is cut away");
}

#[test]
fn kalibr_chains_give_the_first_camera_or_the_named_one() {
    let first = Calibration::parse(KALIBR, None).unwrap();
    let lens = first.lens.parameters();
    assert_eq!((lens.width, lens.height, lens.fx, lens.fy), (512, 500, 190.9, 190.8));
    assert!((lens.cx - 255.4).abs() < 1e-12 && (lens.cy - 257.3).abs() < 1e-12);
    assert_eq!(lens.k, [0.003, 0.0007, -0.002, 0.0002]);
    assert_eq!(first.notes.len(), 1);
    let second = Calibration::parse(KALIBR, Some("cam1")).unwrap();
    assert_eq!(second.lens.parameters().cx, 250.5);
    let missing = Calibration::parse(KALIBR, Some("cam7")).unwrap_err().to_string();
    assert!(missing.contains("cam7") && missing.contains("cam0, cam1"), "{missing}");
}

#[test]
fn what_cannot_be_used_is_refused_with_its_key() {
    let cases = [
        (OWN.replace("\"cx\"", "\"c_x\""), "c_x"),
        (OWN.replace("\"version\": 1", "\"version\": 2"), "version = 2: is not known"),
        (OWN.replace("kannala-brandt", "mei"), "mei"),
        (OWN.replace("\"knees\"", "\"kneez\""), "knee"),
        (OWN.replace("150.0", "1e999"), "line 3"),
        (OWN.replace("150.0", "-150.0"), "lens.fx = -150: must be positive"),
        (OWN.replace("[0.01,", "[-2.0,"), "degrees"),
        (OWN.replace("180.0", "400.0"), "lens.field_of_view_deg = 400"),
        (OPENCV_YAML.replace("5.58478087865323e+02", ".Nan"), "camera_matrix"),
        (OPENCV_YAML.replace("fisheye_model: 1", "fisheye_model: 0"), "fisheye_model = 0: says"),
        (OPENCV_YAML.replace("image_width", "image_breadth"), "width"),
        (OPENCV_YAML.replace("1280", "1280.5"), "image_width = 1280.5: is not a size"),
        (OPENCV_JSON.replace("-0.00374209380722371]", "0.1, 0.2]"), "D: cv::fisheye has four coefficients"),
        (OPENCV_JSON.replace("558.478087865323, 0.0", "558.478087865323, 3.0"), "K: [fx, 0, cx"),
        (KALIBR.replacen("equidistant", "radtan", 1), "cam0.distortion_model = radtan: is not"),
        (KALIBR.replacen("pinhole", "omni", 1), "cam0.camera_model = omni: is not"),
        (KALIBR.replacen("190.9, ", "", 1), "cam0.intrinsics"),
        (KALIBR.replacen("500]", "-500]", 1), "cam0.resolution"),
        (KALIBR.replacen("190.9", "1e200", 1), "fx"),
        ("{\"version\": 1}".to_owned(), "lens"),
        ("{}".to_owned(), "no calibration"),
        ("[".repeat(100_000), "YAML"),
        ("<a>".repeat(1000), "XML"),
        (format!("{{\"a\":{}", "[".repeat(100_000)), "JSON"),
        ("a: &a [1,1,1,1]\nb: &b [*a,*a,*a,*a]\n".to_owned() + "c: \u{0}", "YAML"),
        (String::new(), "no calibration"),
    ];
    for (text, part) in cases {
        let message = message(&text);
        assert!(message.contains(part), "{part}: {message}");
    }
}

#[test]
fn exports_come_back_with_every_digit_and_the_half_pixel() {
    let text = OWN
        .replace("150.0", "212.12345678901234")
        .replace("[0.01, 0.0, 0.0, 0.0]", "[0.0123456789, -1.5e-7, 2e-21, 0.0]");
    let calibration = Calibration::parse(&text, None).unwrap();
    let ours = calibration.lens.parameters();
    let kalibr = calibration.to_kalibr_yaml();
    for (name, export) in [
        ("OpenCV YAML", calibration.to_opencv_yaml()),
        ("OpenCV JSON", calibration.to_opencv_json()),
        ("Kalibr", kalibr.clone()),
    ] {
        // Their pixel centres are at integers: our 320.5 is 320 in their files.
        assert!(export.contains("320.0") && export.contains("239.5"), "{name}: {export}");
        let back = Calibration::parse(&export, None).unwrap();
        let lens = back.lens.parameters();
        assert_eq!(
            (lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy, lens.k),
            (ours.width, ours.height, ours.fx, ours.fy, ours.cx, ours.cy, ours.k),
            "{name}"
        );
        // Neither format can hold the field of view.
        assert_eq!(back.notes.len(), 1, "{name}");
    }
    assert_eq!(Calibration::parse(&kalibr, Some("cam0")).unwrap().lens.parameters().cx, ours.cx);
    assert!(!kalibr.contains("e-"), "{kalibr}");
}

#[test]
fn aliases_that_multiply_are_refused() {
    let mut text = "a0: &a0 [1,1,1,1,1,1,1,1,1,1]\n".to_owned();
    for level in 1..12 {
        let alias = format!("*a{}", level - 1);
        text += &format!("a{level}: &a{level} [{}]\n", vec![alias; 10].join(","));
    }
    assert!(message(&text).contains("budget"), "{}", message(&text));
}

#[test]
fn files_are_named_and_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lens.json");
    let missing = Calibration::load(&path, None).unwrap_err();
    assert!(missing.places().eq([&Place::File(path.clone())]), "{missing}");
    assert!(missing.to_string().contains("lens.json: cannot be read"), "{missing}");
    std::fs::write(&path, vec![b' '; (1 << 20) + 1]).unwrap();
    assert!(Calibration::load(&path, None).unwrap_err().to_string().contains("1 MiB"));
    std::fs::write(&path, [0xff, 0xfe]).unwrap();
    assert!(Calibration::load(&path, None).unwrap_err().to_string().contains("not text"));
    std::fs::write(&path, OWN).unwrap();
    assert!(Calibration::load(&path, None).is_ok());
}

#[test]
fn real_kalibr_files_load() {
    let Some(folder) = real_folder("calib") else { return };
    for (file, cx) in [
        ("tum_vi/kalibr_imucam_chain.yaml", 254.93170605935475),
        ("t265_kalibr_imucam_chain.yaml", 415.9558137753508),
    ] {
        let calibration = Calibration::load(&folder.join(file), None).unwrap();
        assert!((calibration.lens.parameters().cx - cx - 0.5).abs() < 1e-12);
        println!("{file}: {}", calibration.notes[0]);
        assert!(Calibration::load(&folder.join(file), Some("cam1")).is_ok());
    }
}
