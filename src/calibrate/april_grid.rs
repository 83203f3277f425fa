//! AprilGrids, the boards of Kalibr: tags of the family 36h11 with a black border of two cells, in rows and
//! columns, with black squares between their corners.

use super::Corner;
use crate::error::{Error, Place, Result, plain_words, read_at_most};
use crate::files::GreyPicture;
use crate::rt::contained;
use ::aprilgrid::TagFamily;
use ::aprilgrid::detector::{DetectorParams, TagDetector};
use glam::DVec2;
use serde::Deserialize;
use std::path::Path;

/// Dimensions of a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AprilGrid {
    /// Tags from left to right.
    pub columns: usize,
    /// Tags from bottom to top.
    pub rows: usize,
    /// Edge of a tag's black square, in metres.
    pub tag_size_m: f64,
    /// Gap between two tags, as a fraction of a tag's edge.
    pub spacing: f64,
}

/// Number of tags in the family.
const TAGS_MAX: usize = 587;

/// Smallest picture side: the detector looks at 9 x 9 pixels around a corner, and a tag has ten cells.
const SIDE_MIN_PX: usize = 32;

const FILE_MAX_BYTES: u64 = 1 << 16;

/// Kalibr's target file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "camelCase")]
struct File {
    #[serde(rename = "target_type")]
    target_type: String,
    tag_cols: usize,
    tag_rows: usize,
    tag_size: f64,
    tag_spacing: f64,
    /// Number of the first tag in some versions of the file; only 0 is known here.
    #[serde(default)]
    low_id: usize,
    /// Used by Kalibr's own code; without a meaning here.
    #[serde(default, rename = "codeOffset")]
    code_offset: usize,
}

impl AprilGrid {
    /// Loads a target file of Kalibr:
    ///
    /// ```yaml
    /// target_type: 'aprilgrid'
    /// tagCols: 6
    /// tagRows: 6
    /// tagSize: 0.088      # edge of a tag, m
    /// tagSpacing: 0.3     # gap between tags / edge of a tag
    /// ```
    ///
    /// # Errors
    /// `Usage`, naming the file and the key.
    pub fn load(path: &Path) -> Result<Self> {
        read_at_most(path, FILE_MAX_BYTES)
            .map_err(|error| Error::usage("cannot be read").because(error))
            .and_then(|bytes| {
                String::from_utf8(bytes).map_err(|error| Error::usage("is not text").because(error))
            })
            .and_then(|text| Self::parse(&text))
            .map_err(|error| error.at(path))
    }

    /// Reads the text of a target file.
    ///
    /// # Errors
    /// As [`Self::load`], without the file's name.
    pub fn parse(text: &str) -> Result<Self> {
        let file: File = serde_saphyr::from_str(text).map_err(|error| {
            Error::usage("is no target file of Kalibr").because(plain_words(&error.to_string()))
        })?;
        let File {
            target_type,
            tag_cols: columns,
            tag_rows: rows,
            tag_size,
            tag_spacing,
            low_id,
            code_offset,
        } = file;
        let positive = |value: f64| value > 0.0 && value.is_finite();
        let (place, fault) = if target_type != "aprilgrid" {
            let fault = "only aprilgrid is found in photographs; give others as corners".to_owned();
            (Place::value("target_type", target_type), fault)
        } else if columns == 0 || rows == 0 || columns.checked_mul(rows).is_none_or(|tags| tags > TAGS_MAX) {
            let fault = format!("with tagRows = {rows}, the family 36h11 has 1 to {TAGS_MAX} tags");
            (Place::value("tagCols", columns), fault)
        } else if !positive(tag_size) {
            (Place::value("tagSize", tag_size), "is no edge in metres".to_owned())
        } else if !positive(tag_spacing) {
            (Place::value("tagSpacing", tag_spacing), "is no ratio of gap and edge".to_owned())
        } else if low_id != 0 || code_offset != 0 {
            let (key, value) = if low_id != 0 { ("lowId", low_id) } else { ("codeOffset", code_offset) };
            (Place::value(key, value), "only boards whose first tag is number 0 are known".to_owned())
        } else {
            return Ok(Self { columns, rows, tag_size_m: tag_size, spacing: tag_spacing });
        };
        Err(Error::usage(fault).at(place))
    }

    /// A corner of a tag on the board, x to the right, y up, from the first tag's lower left corner: 0 is the
    /// tag's lower left one, then counterclockwise. `None` for tags that the board does not have.
    fn corner_m(&self, tag: usize, corner: usize) -> Option<DVec2> {
        let (row, column) = (tag / self.columns, tag % self.columns);
        let step_m = self.tag_size_m * (1.0 + self.spacing);
        let within = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].get(corner)?;
        (row < self.rows).then(|| DVec2::new(column as f64, row as f64) * step_m + *within * self.tag_size_m)
    }

    /// The corners of all tags that are found in a photograph, by tag; empty where there is no board. Tags
    /// that do not belong to the board are left out.
    ///
    /// # Errors
    /// `BadFrame` for pictures of less than 32 pixels a side and for those on which the detector gives up.
    pub fn find(&self, picture: &GreyPicture) -> Result<Vec<Corner>> {
        let GreyPicture { width, height, values } = picture;
        if (*width).min(*height) < SIDE_MIN_PX || values.len() != width * height {
            return Err(Error::bad_frame(format!(
                "{width} x {height} pixels are too few to show a board, at least {SIDE_MIN_PX} a side are needed"
            )));
        }
        let parameters =
            DetectorParams { tag_spacing_ratio: self.spacing as f32, ..DetectorParams::default_params() };
        let detector = TagDetector::new(&TagFamily::T36H11, Some(parameters));
        let grey = ::image::GrayImage::from_raw(*width as u32, *height as u32, values.clone())
            .ok_or_else(|| Error::bad_frame("is too large to look for a board in"))?;
        let grey = ::image::DynamicImage::ImageLuma8(grey);
        let tags = contained(|| detector.detect(&grey))
            .map_err(|said| Error::bad_frame("the detector of AprilGrids gave up on it").because(said))?;
        let mut tags: Vec<_> = tags.into_iter().collect();
        tags.sort_unstable_by_key(|(tag, _)| *tag);
        Ok(tags
            .iter()
            .flat_map(|(tag, pixels)| pixels.iter().enumerate().map(|(corner, pixel)| (*tag, corner, *pixel)))
            .filter_map(|(tag, corner, (x, y))| {
                let board_m = self.corner_m(tag as usize, corner)?;
                // The detector has integer coordinates at pixel centres.
                let pixel = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
                pixel.is_finite().then_some(Corner { board_m, pixel })
            })
            .collect())
    }
}

#[cfg(test)]
mod tests;
