use crate::calibrate::{Calibration, Mark, Orientation, fit_orientation};
use crate::cli::standard_output::print;
use crate::error::{Error, Place, Result, TomlText};
use glam::DVec3;
use lightcast_core::camera::LOOKING_UP;
use lightcast_core::math::{angle_between, direction};
use serde::Deserialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Stars and surveyed lamps that were marked by hand are a tenth of a degree off, or two.
const MOST_RESIDUAL_DEG: f64 = 1.0;

/// Find the orientation of a camera from pixels whose directions are known.
///
/// MARKS is a TOML file with one table for each mark: a star, the Moon, a lamp that was surveyed.
///
///   [[mark]]
///   pixel = [216.2, 149.6]   # column and row; the first pixel's centre is (0.5, 0.5)
///   azimuth_deg = 259.579    # from +X towards +Z: with +X to the north, a compass bearing
///   elevation_deg = 28.140   # above the horizon
///
/// Two marks that lie well apart give the whole rotation; more make it better. One mark is enough for a
/// camera that looks straight up: it is turned about the vertical, then tilted by what is left. The result is
/// the key world_from_camera for the section [camera] of a configuration, with the angular error of each mark
/// as a comment. Marks that are more than a degree off are told: one of them is another thing than it was
/// taken for, or the lens is.
///
/// Example: lightcast calibrate orientation marks.toml --calibration camera.json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// The marks.
    marks: PathBuf,

    /// Calibration file with the camera's lens.
    #[arg(long, value_name = "FILE")]
    calibration: PathBuf,

    /// Which camera of a Kalibr chain [default: the first].
    #[arg(long, value_name = "NAME")]
    kalibr_camera: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MarksFile {
    mark: Vec<MarkKeys>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MarkKeys {
    pixel: [f64; 2],
    azimuth_deg: f64,
    /// Earlier files call it altitude.
    #[serde(alias = "altitude_deg")]
    elevation_deg: f64,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let marks = read_marks(&arguments.marks)?;
    let calibration = Calibration::load(&arguments.calibration, arguments.kalibr_camera.as_deref())?;
    for note in &calibration.notes {
        tracing::info!("{}: {note}", arguments.calibration.display());
    }
    let orientation =
        fit_orientation(&calibration.lens, &marks, LOOKING_UP).map_err(|error| error.at(&arguments.marks))?;
    if let Some(warning) = disagreement(&orientation) {
        tracing::warn!("{}: {warning}", arguments.marks.display());
    }
    print(&[describe(&orientation).trim_end().to_owned()]).map(|_| ())
}

/// What to tell of marks that do not agree on one orientation.
fn disagreement(orientation: &Orientation) -> Option<String> {
    let off_deg = |&(_, residual_rad): &(usize, &f64)| residual_rad.to_degrees();
    let (index, residual_rad) = orientation
        .residuals_rad
        .iter()
        .enumerate()
        .filter(|mark| off_deg(mark) > MOST_RESIDUAL_DEG)
        .max_by(|a, b| a.1.total_cmp(b.1))?;
    Some(format!(
        "the marks do not agree: mark {} is {:.1} degrees off; check its pixel and direction, and the calibration",
        index + 1,
        residual_rad.to_degrees()
    ))
}

fn read_marks(path: &Path) -> Result<Vec<Mark>> {
    let text = TomlText::load(path)?;
    let file: MarksFile = text.parse()?;
    let mark = |(index, keys): (usize, MarkKeys)| {
        let MarkKeys { pixel, azimuth_deg, elevation_deg } = keys;
        // NaN lies in no range.
        for (key, value, reach) in
            [("azimuth_deg", azimuth_deg, 360.0), ("elevation_deg", elevation_deg, 90.0)]
        {
            if !(-reach..=reach).contains(&value) {
                let fault = Error::usage(format!("must lie between {} and {reach}", -reach))
                    .at(Place::value(format!("mark[{index}].{key}"), value));
                return Err(text.locate("", fault));
            }
        }
        let direction_world = direction((90.0 - elevation_deg).to_radians(), azimuth_deg.to_radians());
        Ok(Mark { pixel: pixel.into(), direction_world })
    };
    file.mark.into_iter().enumerate().map(mark).collect()
}

/// The key of a configuration, below comments that say how good it is.
fn describe(orientation: &Orientation) -> String {
    let Orientation { world_from_camera, residuals_rad } = orientation;
    let mut text = String::new();
    let lean_deg = angle_between(*world_from_camera * DVec3::Z, DVec3::Y).to_degrees();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "# The optical axis is {lean_deg:.3} degrees from the zenith.");
    for (index, residual_rad) in residuals_rad.iter().enumerate() {
        let _ = writeln!(text, "# Mark {} is {:.3} degrees off.", index + 1, residual_rad.to_degrees());
    }
    let rows = [0, 1, 2].map(|row| {
        let [x, y, z] = world_from_camera.row(row).to_array();
        format!("[{x:.9}, {y:.9}, {z:.9}]")
    });
    let _ = writeln!(text, "world_from_camera = [{}]", rows.join(", "));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(text: &str) -> Result<Vec<Mark>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("marks.toml");
        std::fs::write(&path, text).unwrap();
        read_marks(&path)
    }

    #[test]
    fn azimuth_and_elevation_are_directions() {
        let marks = written(
            "[[mark]]\npixel = [1, 2.5]\nazimuth_deg = 90\nelevation_deg = 0\n\
             [[mark]]\npixel = [3, 4]\nazimuth_deg = -20\naltitude_deg = 90\n",
        )
        .unwrap();
        assert_eq!(marks[0].pixel.to_array(), [1.0, 2.5]);
        assert!((marks[0].direction_world - DVec3::Z).length() < 1e-15);
        assert!((marks[1].direction_world - DVec3::Y).length() < 1e-15);
    }

    #[test]
    fn faults_are_told_with_line_and_key() {
        let good = "[[mark]]\npixel = [1, 2]\nazimuth_deg = 10\n";
        for (line, words) in [
            ("elevation_deg = 91", "line 4: mark[0].elevation_deg = 91: must lie between -90 and 90"),
            ("elevation_deg = nan", "line 4: mark[0].elevation_deg = NaN"),
            ("altitude_deg = 91", "mark[0].elevation_deg = 91"),
            ("height_deg = 3", "line 4 (`height_deg = 3`): unknown field"),
            ("elevation_deg = 3\naltitude_deg = 3", "duplicate field `elevation_deg`"),
        ] {
            let message = written(&format!("{good}{line}\n")).unwrap_err().to_string();
            assert!(message.contains(words), "{words}: {message}");
        }
    }

    #[test]
    fn marks_that_do_not_agree_are_told_with_the_worst() {
        let with = |residuals_rad: &[f64]| {
            disagreement(&Orientation {
                world_from_camera: LOOKING_UP,
                residuals_rad: residuals_rad.to_vec(),
            })
        };
        assert_eq!(with(&[0.0]), None);
        assert_eq!(with(&[0.003, 0.017]), None);
        let warning = with(&[0.02, 0.46, 0.1]).unwrap();
        assert!(warning.contains("mark 2 is 26.4 degrees off"), "{warning}");
    }

    #[test]
    fn the_result_is_a_key_that_a_configuration_takes() {
        let text = describe(&Orientation { world_from_camera: LOOKING_UP, residuals_rad: vec![0.01] });
        assert_eq!(
            text,
            "# The optical axis is 0.000 degrees from the zenith.\n# Mark 1 is 0.573 degrees off.\n\
             world_from_camera = [[1.000000000, 0.000000000, 0.000000000], [0.000000000, 0.000000000, 1.000000000], \
             [0.000000000, -1.000000000, 0.000000000]]\n"
        );
    }
}
