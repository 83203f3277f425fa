use crate::error::Result;
use crate::picture;
use crate::rt::link::{Copied, Receiver};
use crate::rt::stage::{Flow, Stage};
use lightcast_core::image::PolarMap;
use lightcast_core::light::LightList;
use std::path::PathBuf;

/// Draws maps with the filtered lights that belong to them.
pub struct Picture {
    maps: Receiver<PolarMap>,
    /// The map that waits for its list, or was drawn last.
    map: Option<PolarMap>,
    folder: PathBuf,
}

impl Picture {
    /// Pictures of `maps`, whose lists come later as inputs, go to `folder`, which must exist. A map must be
    /// in its link before its list is, which holds when `maps` are copies of the maps of which the lists are
    /// made.
    pub fn new(maps: Receiver<PolarMap>, folder: PathBuf) -> Self {
        Self { maps, map: None, folder }
    }
}

impl Stage for Picture {
    type Input = LightList;
    type Output = ();

    /// A map whose list was lost or will not come (the run ends within the filter's delay) is not drawn.
    fn step(&mut self, list: &LightList, (): &mut ()) -> Result<Flow> {
        let Some(sequence) = list.sequence() else { return Ok(Flow::Send) };
        while self.map.as_ref().is_none_or(|map| map.stamp.sequence < sequence) {
            let Ok(Some(next)) = self.maps.try_receive() else { return Ok(Flow::Send) };
            match &mut self.map {
                Some(map) => map.copy_from(&next),
                None => self.map = Some(next.clone()),
            }
        }
        if let Some(map) = &self.map
            && map.stamp.sequence == sequence
        {
            picture::draw(map, list, &self.folder)?;
        }
        Ok(Flow::Send)
    }
}
