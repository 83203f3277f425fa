use crate::calibrate::CornerSet;
#[cfg(feature = "april-grid")]
use crate::calibrate::{AprilGrid, BoardView};
use crate::error::{Error, Result};
#[cfg(feature = "april-grid")]
use crate::{error::Kind, files::read_grey};
use std::path::{Path, PathBuf};

/// Looks for the board that the file `board` describes in every photograph. One that cannot be read or shows
/// no board is named and stays in the set without corners, so that the report has it too.
#[cfg(feature = "april-grid")]
pub(super) fn corners(board: &Path, files: &[PathBuf]) -> Result<CornerSet> {
    let grid = AprilGrid::load(board)?;
    let mut size = None;
    let mut views = Vec::with_capacity(files.len());
    for path in files {
        let name = path.display().to_string();
        let found = read_grey(path).and_then(|picture| {
            let corners = grid.find(&picture).map_err(|error| error.at(path))?;
            Ok(([picture.width, picture.height], corners))
        });
        let corners = match found {
            Ok((picture, corners)) => {
                let first = *size.get_or_insert(picture);
                if picture != first {
                    return Err(Error::usage(format!(
                        "has {} x {} pixels, but the pictures before have {} x {}; one lens at one resolution is \
                         calibrated at a time",
                        picture[0], picture[1], first[0], first[1]
                    ))
                    .at(path));
                }
                tracing::info!("{name}: {} of {} tags", corners.len() / 4, grid.columns * grid.rows);
                corners
            }
            Err(error) if error.kind() == Kind::BadFrame => {
                tracing::warn!("{error}");
                Vec::new()
            }
            Err(error) => return Err(error),
        };
        views.push(BoardView { name, corners });
    }
    let [width, height] =
        size.ok_or_else(|| Error::failed("none of the photographs can be read; give PNG or JPEG files"))?;
    Ok(CornerSet { width, height, views })
}

/// The detector brings a hundred packages, for what is done once for each lens.
#[cfg(not(feature = "april-grid"))]
pub(super) fn corners(_: &Path, _: &[PathBuf]) -> Result<CornerSet> {
    Err(Error::usage(
        "this program was built without its detector of AprilGrids; install it with `make install \
         FEATURES=april-grid` (`cargo install --features april-grid ...`), or give a file of corners that another \
         program has found (`lightcast calibrate lens --help`)",
    )
    .at("--april-grid"))
}
