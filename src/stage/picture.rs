use super::written::Written;
use crate::error::Result;
use crate::picture;
use crate::rt::Counter;
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
    is_drawn: bool,
    folder: PathBuf,
    undrawn: Counter,
    written: Written,
}

impl Picture {
    /// Pictures of `maps`, the lists of which come later as inputs, go to `folder`, which must exist. A map
    /// must be in its link before its list is, as when `maps` are copies of what the lists are made of.
    /// Maps whose lists were lost are counted by `undrawn`.
    pub fn new(maps: Receiver<PolarMap>, folder: PathBuf, undrawn: Counter) -> Self {
        Self { maps, map: None, is_drawn: true, folder, undrawn, written: Written::default() }
    }
}

impl Stage for Picture {
    type Input = LightList;
    type Output = ();

    /// A map whose list was lost or will not come (the run ends within the filter's delay) is not drawn.
    fn step(&mut self, list: &LightList, (): &mut ()) -> Result<Flow> {
        self.written.saw(list);
        let Some(sequence) = list.sequence() else { return Ok(Flow::Send) };
        while self.map.as_ref().is_none_or(|map| map.stamp.sequence < sequence) {
            let Ok(Some(next)) = self.maps.try_receive() else { return Ok(Flow::Send) };
            self.undrawn.add(u64::from(!self.is_drawn));
            self.is_drawn = false;
            match &mut self.map {
                Some(map) => map.copy_from(&next),
                None => self.map = Some(next.clone()),
            }
        }
        if let Some(map) = &self.map
            && map.stamp.sequence == sequence
        {
            picture::draw(map, list, &self.folder)?;
            self.is_drawn = true;
            self.written.count();
        }
        Ok(Flow::Send)
    }

    fn finish(&mut self, is_complete: bool) -> Result<()> {
        if is_complete {
            self.written.tell(&self.folder);
        }
        Ok(())
    }
}
