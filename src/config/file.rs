//! The keys of a configuration file as they are written, and their way into [`Config`].

use super::server::ServerKeys;
use super::source::SourceKeys;
use super::{CameraOptions, Config, ProjectionKind};
use crate::design::FilterOptions;
use crate::error::{Error, Place, Result, TomlText};
use glam::{DMat3, DVec3};
use lightcast_core::camera::{ColourMatrix, Response, ResponseModel};
use lightcast_core::image::PolarShape;
use lightcast_core::light;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use std::path::{Path, PathBuf};

/// How far the rows of a rotation may be from orthonormal: six written digits give 1e-6, and a rotation
/// within this tolerance is far below a pixel.
const ROTATION_TOLERANCE: f64 = 1e-5;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    source: SourceKeys,
    #[serde(default)]
    camera: CameraKeys,
    #[serde(default)]
    map: MapKeys,
    #[serde(default)]
    lights: light::Options,
    #[serde(default)]
    filter: FilterOptions,
    #[serde(default)]
    server: ServerKeys,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraKeys {
    #[serde(default)]
    projection: ProjectionKind,
    calibration: Option<PathBuf>,
    kalibr_camera: Option<String>,
    response: Option<ResponseModel>,
    #[serde(default, deserialize_with = "rotation")]
    world_from_camera: Option<DMat3>,
    rec709_from_sensor: Option<[[f64; 3]; 3]>,
}

#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct MapKeys {
    columns: usize,
    rows: usize,
    theta_max_deg: f64,
}

impl Default for MapKeys {
    /// The paper's polar map: a hemisphere in steps of one degree.
    fn default() -> Self {
        Self { columns: 360, rows: 90, theta_max_deg: 90.0 }
    }
}

/// Checks a configuration file; paths in it are relative to its folder.
pub(super) fn parse(origin: TomlText) -> Result<Config> {
    let File { source, camera, map, lights, filter, server } = origin.parse()?;
    let folder = origin.path.parent().unwrap_or(Path::new("")).to_owned();
    let (source, pace, links) = source.check(&folder).map_err(|error| origin.locate("source", error))?;
    let camera = camera.check(&folder).map_err(|error| origin.locate("camera", error))?;
    let map = PolarShape::new(map.columns, map.rows, map.theta_max_deg.to_radians())
        .map_err(|error| origin.locate("map", error.into()))?;
    let server = server.check(&folder).map_err(|error| origin.locate("server", error))?;
    Ok(Config { source, pace, links, camera, map, lights, filter, server, origin })
}

impl CameraKeys {
    /// The options, if the keys fit together.
    fn check(self, folder: &Path) -> Result<CameraOptions> {
        let Self { projection, calibration, kalibr_camera, response, world_from_camera, rec709_from_sensor } =
            self;
        match (projection, &calibration, &kalibr_camera) {
            (ProjectionKind::Fisheye, None, _) => {
                return Err(Error::usage(
                    "needs the lens in a calibration file; name it with the key `calibration`",
                )
                .at(Place::value("projection", "\"fisheye\"")));
            }
            (ProjectionKind::LatLong, Some(_), _) => {
                return Err(Error::usage(
                    "a lat-long panorama has no lens; remove this key or say projection = \"fisheye\"",
                )
                .at(Place::value("calibration", "...")));
            }
            (ProjectionKind::LatLong, None, Some(_)) => {
                return Err(Error::usage("there is no calibration to choose from; remove this key")
                    .at(Place::value("kalibr_camera", "...")));
            }
            _ => {}
        }
        Ok(CameraOptions {
            projection,
            calibration: calibration.map(|file| folder.join(file)),
            kalibr_camera,
            response: response
                .map(Response::new)
                .transpose()
                .map_err(|error| Error::from(error).at(Place::key("response")))?,
            world_from_camera,
            rec709_from_sensor: rec709_from_sensor.map(ColourMatrix::new).transpose()?,
        })
    }
}

fn rotation<'de, D: Deserializer<'de>>(value: D) -> Result<Option<DMat3>, D::Error> {
    let rows = <[[f64; 3]; 3]>::deserialize(value)?;
    let [x, y, z] = rows.map(DVec3::from);
    let off = [
        x.length() - 1.0,
        y.length() - 1.0,
        z.length() - 1.0,
        x.dot(y),
        y.dot(z),
        z.dot(x),
        x.cross(y).dot(z) - 1.0,
    ];
    // A NaN is not within the tolerance either.
    if !off.iter().all(|off| off.abs() <= ROTATION_TOLERANCE) {
        return Err(D::Error::custom(
            "is no rotation: the three rows must be unit vectors at right angles, right-handed (determinant +1)",
        ));
    }
    Ok(Some(DMat3::from_cols(x, y, z).transpose()))
}

#[cfg(test)]
mod tests {
    use super::super::{Links, Pace, SourceOptions};
    use super::*;
    use crate::source::SequenceOptions;

    const SOURCE: &str = "[source]\nkind = \"sequence\"\npath = \"sky/\"\n";

    fn parse_with(rest: &str) -> Result<Config> {
        parse(TomlText { path: "conf/a.toml".into(), text: format!("{SOURCE}{rest}") })
    }

    #[test]
    fn a_source_suffices_and_paths_are_relative_to_the_file() {
        let config = parse_with("").unwrap();
        let expected = SequenceOptions { path: "conf/sky/".into(), ..SequenceOptions::default() };
        assert_eq!(config.source, SourceOptions::Sequence(expected));
        assert_eq!((config.pace, config.links), (Pace::RealTime, Links::Replay));
        assert_eq!(config.map, PolarShape::hemisphere(360, 90));
        assert_eq!((config.lights, config.filter), (light::Options::default(), FilterOptions::default()));
        assert_eq!(config.camera, CameraOptions::default());
        let absolute =
            parse_with("[camera]\nprojection = \"fisheye\"\ncalibration = \"/lens.json\"").unwrap();
        assert_eq!(absolute.camera.calibration.as_deref(), Some(Path::new("/lens.json")));
    }

    #[cfg(feature = "camera")]
    #[test]
    fn the_bundled_configuration_of_a_camera_is_sound_with_and_without_what_it_leaves_out() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/camera.toml");
        let text = std::fs::read_to_string(&path).unwrap();
        let SourceOptions::Camera(_, None) =
            parse(TomlText { path: path.clone(), text: text.clone() }).unwrap().source
        else {
            panic!("no camera");
        };
        // Lines of keys and tables, not of prose, are "# key = ..." and "# [table]".
        let is_key = |line: &str| line.split_once(" = ").is_some_and(|(key, _)| !key.contains(' '));
        let with_all: String = text
            .lines()
            .map(|line| match line.strip_prefix("# ") {
                Some(rest) if is_key(rest) || rest.starts_with('[') => format!("{rest}\n"),
                _ => format!("{line}\n"),
            })
            .collect();
        let config = parse(TomlText { path, text: with_all }).unwrap();
        let SourceOptions::Camera(camera, Some(bracket)) = config.source else { panic!("no bracket") };
        assert_eq!((camera.controls.len(), camera.size, bracket.values.len()), (3, Some([1280, 720]), 3));
        assert_eq!(config.camera.projection, ProjectionKind::Fisheye);
    }

    #[cfg(feature = "camera")]
    #[test]
    fn a_camera_is_live_and_its_controls_have_names() {
        use crate::source::v4l2::{ControlValue, V4l2Options};
        let text = "[source]\nkind = \"camera\"\ndevice = \"cam\"\nformat = \"Y12\"\nsize = [1280, 720]\n\
                    controls = { exposure = 5, automatic = false, mode = \"Manual Mode\" }";
        let config = parse(TomlText { path: "a.toml".into(), text: text.into() }).unwrap();
        let SourceOptions::Camera(source, None) = config.source else { panic!("{:?}", config.source) };
        assert_eq!((config.pace, config.links), (Pace::RealTime, Links::Live));
        let controls = [
            ("exposure", ControlValue::Number(5)),
            ("automatic", ControlValue::Switch(false)),
            ("mode", ControlValue::Item("Manual Mode".into())),
        ];
        let expected = V4l2Options {
            device: "cam".into(),
            format: Some("Y12".into()),
            size: Some([1280, 720]),
            controls: controls.map(|(name, value)| (name.to_owned(), value)).into(),
            ..V4l2Options::default()
        };
        assert_eq!(source, expected);
    }

    #[test]
    fn a_rotation_is_written_in_rows() {
        let config = parse_with("[camera]\nworld_from_camera = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]").unwrap();
        let world_from_camera = config.camera.world_from_camera.unwrap();
        assert_eq!(world_from_camera * DVec3::Z, DVec3::Y, "the optical axis looks up");
    }

    #[test]
    fn a_colour_matrix_is_written_in_rows() {
        let rows = "[[2, 0, 0.5], [0, 1, 0], [0, 0, 1.5]]";
        let config = parse_with(&format!("[camera]\nrec709_from_sensor = {rows}")).unwrap();
        let expected = ColourMatrix::new([[2.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.0, 0.0, 1.5]]).unwrap();
        assert_eq!(config.camera.rec709_from_sensor, Some(expected));
    }

    #[test]
    fn faults_are_told_with_file_line_and_key() {
        for (rest, expected) in [
            ("colour = 1", "conf/a.toml: line 4 (`colour = 1`): unknown field `colour`"),
            ("[lihgts]", "conf/a.toml: line 4 (`[lihgts]`): unknown field `lihgts`"),
            ("[map]\n\nrows = 0", "line 6: rows = 0: a side of a polar map has 1 to 16384 pixels"),
            (
                "[map]\ncolumns = -4",
                "line 5 (`columns = -4`): `-4` given where a whole number, 0 or more is wanted",
            ),
            ("[map]\ntheta_max_deg = nan", "line 5: theta_max_deg = NaN: the lower rim"),
            ("[map]\ntheta_max_deg = 1e-7", "the lower rim of a polar map lies at 0.1 to 180 degrees"),
            ("[map]\ntheta_max_deg = 180.1", "line 5: theta_max_deg = 180.1"),
            ("frame_rate_hz = 0.0", "line 4 (`frame_rate_hz = 0.0`): a frame rate is above 0"),
            ("pace = \"slow\"", "line 4 (`pace = \"slow\"`): `slow` is unknown; give `real-time` or `fast`"),
            ("bayer = \"RGBG\"", "line 4 (`bayer = \"RGBG\"`): `RGBG` is unknown; give one of `RGGB`"),
            ("repeat = maybe", "line 4 (`repeat = maybe`): "),
            #[cfg(feature = "camera")]
            ("device = \"cam\"", "line 4: device = ...: is no key of kind = \"sequence\""),
            ("first = 9\nlast = 8", "line 5: last = 8: must not be before first = 9"),
            ("[camera]\nprojection = \"fisheye\"", "line 5: projection = \"fisheye\": needs the lens"),
            (
                "[camera]\ncalibration = \"a.json\"",
                "line 5: calibration = ...: a lat-long panorama has no lens",
            ),
            ("[camera]\nworld_from_camera = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]", "is no rotation"),
            ("[camera]\nworld_from_camera = [[1, 0, 0], [0, nan, 0], [0, 0, 1]]", "is no rotation"),
            (
                "[camera]\nrec709_from_sensor = [[1, 0, 0], [0, inf, 0], [0, 0, 1]]",
                "line 5: rec709_from_sensor[1][1] = inf: must be finite",
            ),
            ("[camera]\nrec709_from_sensor = [2.0, 1.0, 1.5]", "line 5 (`rec709_from_sensor = [2.0"),
            ("[camera]\nkalibr_camera = \"cam1\"", "line 5: kalibr_camera = ...: there is no calibration"),
            (
                "[camera]\nresponse = { model = \"linear\", black_level = 9, white_level = 9, gain = 1.0 }",
                "line 5: response.black_level = 9: must lie below white_level = 9",
            ),
            (
                "[camera]\nresponse = { model = \"cubic\" }",
                "line 5 (`response = { model = \"cubic\" }`): `cubic` is unknown; give",
            ),
            ("[filter]\norder = 8", "line 5 (`order = 8`): unknown field `order`"),
        ] {
            let error = parse_with(rest).unwrap_err();
            assert_eq!(error.kind(), crate::error::Kind::Usage);
            assert!(error.to_string().contains(expected), "{rest}\n  gave {error}\n  not {expected}");
        }
        #[cfg(feature = "camera")]
        for (rest, expected) in [
            ("", "missing field `device`"),
            ("device = \"cam\"\npath = \"sky/\"", "path = ...: is no key of kind = \"camera\""),
            ("device = \"cam\"\nbuffers = 1", "buffers = 1: the driver needs 2 to 32"),
            ("device = \"cam\"\nsize = [0, 480]", "columns and rows must be above 0"),
            ("device = \"cam\"\nframe_rate_hz = -1", "a frame rate is above 0"),
        ] {
            let text = format!("[source]\nkind = \"camera\"\n{rest}");
            let error = parse(TomlText { path: "a.toml".into(), text }).unwrap_err().to_string();
            assert!(error.contains(expected), "{rest}\n  gave {error}\n  not {expected}");
        }
        let error =
            parse(TomlText { path: "a.toml".into(), text: "[map]\nrows = 9".to_owned() }).unwrap_err();
        assert!(error.to_string().contains("missing field `source`"), "{error}");
    }
}
