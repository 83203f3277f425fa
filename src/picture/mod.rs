//! Pictures for display: a map with its lights drawn on it, and the sphere-on-plane scene of METHODS section
//! 9 shaded by the lights and by the whole map, side by side. Also the perceived difference between two
//! pictures, and line plots.

mod canvas;
mod flip;
mod map;
mod plot;
mod scene;
mod tone;

use crate::error::Result;
use lightcast_core::image::PolarMap;
use lightcast_core::light::LightList;
use std::path::Path;

pub use canvas::Canvas;
pub use flip::{FlipError, PIXELS_PER_DEGREE, flip, linear_from_srgb8};
pub use map::{MapBackground, draw_map, encode_map_png};
pub use plot::{Panel, Parts, Plot, Series, escaped};
pub use scene::draw_scene;
pub use tone::ToneCurve;

/// Writes `map_SEQUENCE.png` and `scene_SEQUENCE.png` into `folder`.
///
/// # Errors
/// When a file cannot be written.
pub fn draw(map: &PolarMap, list: &LightList, folder: &Path) -> Result<()> {
    let sequence = list.stamp.sequence;
    draw_map(map, &list.lights).write(&folder.join(format!("map_{sequence:05}.png")))?;
    draw_scene(map, &list.lights).write(&folder.join(format!("scene_{sequence:05}.png")))
}
