use crate::calibrate::{AprilGrid, BoardView, CornerSet};
use crate::error::{Error, Kind, Result};
use crate::files::read_grey;
use std::path::PathBuf;

/// Looks for the board in every photograph. One that cannot be read or shows no board is named and stays in
/// the set without corners, so that the report has it too.
pub(super) fn corners(grid: &AprilGrid, files: &[PathBuf]) -> Result<CornerSet> {
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
