//! Corners of a flat board in a number of pictures, as a file that any detector can write:
//!
//! ```json
//! {
//!   "version": 1,
//!   "image_size": [1280, 800],
//!   "pixel_centres": "integer",
//!   "board": {"columns": 8, "rows": 6, "pitch_m": 0.0244},
//!   "views": [
//!     {"name": "left01.jpg", "corners_px": [[537.518, 378.586], [584.759, 380.118]]},
//!     {"name": "left02.jpg", "ids": [0, 1, 8], "corners_px": [[501.2, 301.0], [550.3, 302.1], [500.9, 350.8]]}
//!   ]
//! }
//! ```
//!
//! `pixel_centres` says where the centre of the first pixel lies: `integer` at (0, 0), as in OpenCV and
//! Kalibr, `half` at (0.5, 0.5), as in this program. The corners of a board of `columns` x `rows` are
//! numbered row by row from 0, the column fastest, `pitch_m` metres apart; other flat boards list theirs:
//! `{"points_m": [[0, 0], [0.088, 0]]}`. A view without `ids` shows all corners in their order.
//!
//! From chessboards, with OpenCV in Python:
//!
//! ```python
//! import cv2, json, sys
//! columns, rows, pitch_m = 9, 6, 0.025  # inner corners, and metres from one to the next
//! views = []
//! for name in sys.argv[1:]:
//!     grey = cv2.imread(name, cv2.IMREAD_GRAYSCALE)
//!     found, corners = cv2.findChessboardCornersSB(grey, (columns, rows))
//!     if found:
//!         views.append({"name": name, "corners_px": corners.reshape(-1, 2).tolist()})
//! print(json.dumps({"version": 1, "image_size": grey.shape[::-1], "pixel_centres": "integer", "views": views,
//!                   "board": {"columns": columns, "rows": rows, "pitch_m": pitch_m}}))
//! ```

use super::{BoardView, Corner};
use crate::error::{Error, Place, Result, plain_words, read_at_most};
use glam::DVec2;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Corners of many pictures of one board by one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CornerSet {
    /// Columns of the pictures.
    pub width: usize,
    /// Rows of the pictures.
    pub height: usize,
    /// The corners in each picture.
    pub views: Vec<BoardView>,
}

/// A thousand views of a thousand corners each take half of this.
const SIZE_MAX_BYTES: u64 = 1 << 26;

/// Most corners of a board: a thousand squares a side.
const BOARD_MAX: usize = 1_000_000;

const VERSION: u32 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    version: u32,
    image_size: [usize; 2],
    pixel_centres: PixelCentres,
    board: BoardEntry,
    views: Vec<ViewEntry>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum PixelCentres {
    Integer,
    Half,
}

#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BoardEntry {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    columns: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rows: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pitch_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    points_m: Option<Vec<[f64; 2]>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ViewEntry {
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ids: Option<Vec<usize>>,
    corners_px: Vec<[f64; 2]>,
}

impl CornerSet {
    /// Loads a file of corners.
    ///
    /// # Errors
    /// `Usage`, naming the file and the line, key, view or corner: files that cannot be read or are over 64
    /// MiB, unknown and missing keys, boards without a size, ids that the board does not have or that occur
    /// twice, counts that differ, and corners outside the picture.
    pub fn load(path: &Path) -> Result<Self> {
        read(path).and_then(|text| Self::parse(&text)).map_err(|error| error.at(path))
    }

    /// Reads the text of a file of corners.
    ///
    /// # Errors
    /// As [`Self::load`], without the file's name.
    pub fn parse(text: &str) -> Result<Self> {
        let file: File = serde_json::from_str(text).map_err(|error| {
            Error::usage("is no file of corners that can be used (its form: lightcast calibrate lens --help)")
                .because(plain_words(&error.to_string()))
        })?;
        if file.version != VERSION {
            return Err(Error::usage(format!("is not known, this program reads version {VERSION}"))
                .at(Place::value("version", file.version)));
        }
        let [width, height] = file.image_size;
        if ![width, height].iter().all(|side| (1..=65_535).contains(side)) {
            return Err(Error::usage("is no size of a picture in pixels, [columns, rows] expected")
                .at(Place::value("image_size", format_args!("[{width}, {height}]"))));
        }
        let board = board(file.board).map_err(|error| error.at(Place::key("board")))?;
        let shift = match file.pixel_centres {
            PixelCentres::Integer => 0.5,
            PixelCentres::Half => 0.0,
        };
        let views = file.views.into_iter().map(|entry| {
            let name = entry.name.clone();
            view(entry, &board, shift, [width, height]).map_err(|error| error.at(format_args!("view {name}")))
        });
        Ok(Self { width, height, views: views.collect::<Result<_>>()? })
    }

    /// The set as such a file, with the board as a list of points, and half-pixel centres.
    pub fn to_json(&self) -> String {
        let mut points_m: Vec<[f64; 2]> =
            self.views.iter().flat_map(|view| &view.corners).map(|corner| corner.board_m.into()).collect();
        let order = |a: &[f64; 2], b: &[f64; 2]| a[1].total_cmp(&b[1]).then(a[0].total_cmp(&b[0]));
        points_m.sort_by(order);
        points_m.dedup();
        let views = self.views.iter().map(|view| ViewEntry {
            name: view.name.clone(),
            ids: Some(
                view.corners
                    .iter()
                    .filter_map(|corner| points_m.binary_search_by(|p| order(p, &corner.board_m.into())).ok())
                    .collect(),
            ),
            corners_px: view.corners.iter().map(|corner| corner.pixel.into()).collect(),
        });
        let file = File {
            version: VERSION,
            image_size: [self.width, self.height],
            pixel_centres: PixelCentres::Half,
            views: views.collect(),
            board: BoardEntry { points_m: Some(points_m), ..BoardEntry::default() },
        };
        // Numbers, strings and lists of them can always be written as JSON.
        let mut text = serde_json::to_string(&file).expect("plain data serialises");
        text.push('\n');
        text
    }
}

/// Every corner of the board, in metres. Errors name the key, below `board`.
fn board(entry: BoardEntry) -> Result<Vec<DVec2>> {
    let points: Vec<DVec2> = match entry {
        BoardEntry { columns: None, rows: None, pitch_m: None, points_m: Some(points) } => {
            points.into_iter().map(DVec2::from).collect()
        }
        BoardEntry { columns: Some(columns), rows: Some(rows), pitch_m: Some(pitch_m), points_m: None } => {
            if !(pitch_m > 0.0 && pitch_m.is_finite()) {
                return Err(Error::usage("is no distance between corners in metres")
                    .at(Place::value("pitch_m", pitch_m)));
            }
            if columns.checked_mul(rows).is_none_or(|count| count > BOARD_MAX) {
                return Err(Error::usage(format!(
                    "{columns} x {rows} corners are too many, at most {BOARD_MAX} are read"
                )));
            }
            (0..columns * rows)
                .map(|at| DVec2::new((at % columns) as f64, (at / columns) as f64) * pitch_m)
                .collect()
        }
        _ => {
            return Err(Error::usage("either columns, rows and pitch_m expected, or points_m alone"));
        }
    };
    Ok(points)
}

fn view(entry: ViewEntry, board: &[DVec2], shift_px: f64, size: [usize; 2]) -> Result<BoardView> {
    let ViewEntry { name, ids, corners_px } = entry;
    let ids = match ids {
        Some(ids) if ids.len() != corners_px.len() => {
            return Err(Error::usage(format!(
                "has {} numbers, but there are {} corners_px: every corner has one",
                ids.len(),
                corners_px.len()
            ))
            .at(Place::key("ids")));
        }
        None if corners_px.len() != board.len() => {
            return Err(Error::usage(format!(
                "has {} corners, but the board has {}; where some were not found, list the ids of the others",
                corners_px.len(),
                board.len()
            ))
            .at(Place::key("corners_px")));
        }
        Some(ids) => ids,
        None => (0..board.len()).collect(),
    };
    let mut seen = vec![false; board.len()];
    let mut corners = Vec::with_capacity(ids.len());
    for (id, pixel) in ids.into_iter().zip(corners_px) {
        let fault = |message: String| Error::usage(message).at(format_args!("id {id}"));
        let Some(seen) = seen.get_mut(id) else {
            return Err(fault(match board.len() {
                0 => "the board has no corners".to_owned(),
                count => format!("the board's corners are numbered 0 to {}", count - 1),
            }));
        };
        if std::mem::replace(seen, true) {
            return Err(fault("comes twice: a picture shows a corner once".to_owned()));
        }
        let pixel = DVec2::from(pixel) + shift_px;
        let [width, height] = size.map(|side| side as f64);
        // A detector that fits edges may place a corner slightly outside the picture.
        if !(pixel.cmpge(DVec2::splat(-1.0)).all() && pixel.cmple(DVec2::new(width, height) + 1.0).all()) {
            return Err(fault(format!(
                "lies at {:?}, outside the picture of {width} x {height}; are image_size and the pictures the same?",
                (pixel - shift_px).to_array()
            )));
        }
        corners.push(Corner { board_m: board[id], pixel });
    }
    Ok(BoardView { name, corners })
}

fn read(path: &Path) -> Result<String> {
    let bytes =
        read_at_most(path, SIZE_MAX_BYTES).map_err(|error| Error::usage("cannot be read").because(error))?;
    if bytes.len() as u64 > SIZE_MAX_BYTES {
        return Err(Error::usage("is larger than 64 MiB: give fewer views"));
    }
    String::from_utf8(bytes)
        .map_err(|error| Error::usage("is not text (photographs need a board, --april-grid)").because(error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;

    const TEXT: &str = r#"{"version": 1, "image_size": [640, 480], "pixel_centres": "integer",
 "board": {"columns": 3, "rows": 2, "pitch_m": 0.5},
 "views": [
  {"name": "a.png", "corners_px": [[0, 1], [10, 1], [20, 1], [0, 11], [10, 11], [20, 11.25]]},
  {"name": "b.png", "ids": [4, 0], "corners_px": [[100.5, 200], [639, 479]]}]}"#;

    #[test]
    fn corners_have_their_place_on_the_board_and_half_pixel_centres() {
        let set = CornerSet::parse(TEXT).unwrap();
        assert_eq!((set.width, set.height, set.views.len()), (640, 480, 2));
        assert_eq!(set.views[0].corners.len(), 6);
        assert_eq!(
            set.views[0].corners[5],
            Corner { board_m: DVec2::new(1.0, 0.5), pixel: DVec2::new(20.5, 11.75) }
        );
        assert_eq!(
            set.views[1].corners,
            [
                Corner { board_m: DVec2::new(0.5, 0.5), pixel: DVec2::new(101.0, 200.5) },
                Corner { board_m: DVec2::ZERO, pixel: DVec2::new(639.5, 479.5) }
            ]
        );
        let half = CornerSet::parse(&TEXT.replace("integer", "half")).unwrap();
        assert_eq!(half.views[0].corners[5].pixel, DVec2::new(20.0, 11.25));
        let listed = TEXT.replace(
            r#""columns": 3, "rows": 2, "pitch_m": 0.5"#,
            r#""points_m": [[0, 0], [0.5, 0], [1, 0], [0, 0.5], [0.5, 0.5], [1, 0.5]]"#,
        );
        assert_eq!(CornerSet::parse(&listed).unwrap(), set);
        assert_eq!(CornerSet::parse(&set.to_json()).unwrap(), set);
    }

    #[test]
    fn what_cannot_be_used_is_refused_with_its_place() {
        let cases = [
            (TEXT.replace("\"version\": 1", "\"version\": 3"), "version = 3: is not known"),
            (TEXT.replace("\"pixel_centres\"", "\"pixels\""), "pixels"),
            (TEXT.replace("integer", "corner"), "`integer` or `half`"),
            (TEXT.replace("\"pixel_centres\": \"integer\",", ""), "missing field `pixel_centres`"),
            (TEXT.replace("[640, 480]", "[0, 480]"), "image_size = [0, 480]: is no size"),
            (TEXT.replace("[640, 480]", "[640]"), "line 1"),
            (TEXT.replace("\"rows\": 2, ", ""), "board: either columns"),
            (TEXT.replace("\"rows\": 2", "\"rows\": 2, \"points_m\": []"), "board: either columns"),
            (TEXT.replace("0.5}", "-0.5}"), "board.pitch_m = -0.5: is no distance"),
            (
                TEXT.replace("\"columns\": 3", "\"columns\": 18446744073709551615"),
                "board: 18446744073709551615 x 2 corners are too many",
            ),
            (TEXT.replace("[10, 11], ", ""), "view a.png: corners_px: has 5 corners, but the board has 6"),
            (
                TEXT.replace("[4, 0]", "[4, 0, 1]"),
                "view b.png: ids: has 3 numbers, but there are 2 corners_px",
            ),
            (TEXT.replace("[4, 0]", "[4, 6]"), "view b.png: id 6: the board's corners are numbered 0 to 5"),
            (TEXT.replace("[4, 0]", "[4, 4]"), "view b.png: id 4: comes twice"),
            (TEXT.replace("[639, 479]", "[739, 479]"), "view b.png: id 0: lies at [739.0, 479.0], outside"),
            (TEXT.replace("[639, 479]", "[NaN, 479]"), "line 5"),
            (TEXT.replace("[639, 479]", "[1e999, 479]"), "line 5"),
            (TEXT.replace("[639, 479]", "[639, 479, 1]"), "line 5"),
            (TEXT.replace("\"name\": \"b.png\",", ""), "missing field `name`"),
            (String::new(), "--help"),
            ("[".repeat(100_000), "line 1"),
        ];
        for (text, part) in cases {
            let error = CornerSet::parse(&text).unwrap_err();
            assert_eq!(error.kind(), Kind::Usage);
            assert!(error.to_string().contains(part), "{part}: {error}");
        }
        // An empty board has no corners to number.
        let empty = r#"{"version": 1, "image_size": [4, 4], "pixel_centres": "half", "board": {"points_m": []},
 "views": [{"name": "a", "ids": [0], "corners_px": [[1, 1]]}]}"#;
        assert!(CornerSet::parse(empty).unwrap_err().to_string().contains("id 0"));
    }

    #[test]
    fn files_are_named_and_bounded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("corners.json");
        let message = || CornerSet::load(&path).unwrap_err().to_string();
        assert!(message().contains("corners.json: cannot be read"), "{}", message());
        std::fs::write(&path, vec![b' '; (1 << 26) + 1]).unwrap();
        assert!(message().contains("64 MiB"));
        std::fs::write(&path, [0xff]).unwrap();
        assert!(message().contains("not text"));
        std::fs::write(&path, TEXT).unwrap();
        assert!(CornerSet::load(&path).is_ok());
    }
}
