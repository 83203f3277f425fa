use super::picture::Due;
use crate::error::Result;
use crate::light::{Extractor, LightList};
use crate::net::Board;
use crate::rt::link::{Closed, Sender};
use crate::rt::stage::{Flow, Stage};
use lightcast_core::image::PolarMap;
use std::sync::Arc;
use std::time::Instant;

/// Turns a map into lights. Copies of some maps may go to others, and the newest onto a board.
pub struct Light {
    extractor: Extractor,
    taps: Vec<MapTap>,
    board: Option<Arc<Board>>,
}

impl Light {
    /// Lights by `extractor`; maps to all `taps` and to `board`.
    pub fn new(extractor: Extractor, taps: Vec<MapTap>, board: Option<Arc<Board>>) -> Self {
        Self { extractor, taps, board }
    }
}

impl Stage for Light {
    type Input = PolarMap;
    type Output = LightList;

    fn step(&mut self, map: &PolarMap, list: &mut LightList) -> Result<Flow> {
        let start = self.extractor.has_budget().then(Instant::now);
        self.extractor.step(map, list);
        if let Some(start) = start {
            self.extractor.took(start.elapsed(), map.stamp.frame_rate_hz);
        }
        // A reader that has ended gets no more; if it failed, the supervisor knows.
        self.taps.retain_mut(|tap| tap.offer(map).is_ok());
        if let Some(board) = &self.board {
            board.post_map(map);
        }
        Ok(Flow::Send)
    }
}

/// Sends copies of some maps, to a picture stage or a window: the first of every block of so many sequence numbers.
pub struct MapTap {
    maps: Sender<PolarMap>,
    due: Due,
}

impl MapTap {
    /// Copies go to `maps`, one in `every` sequence numbers.
    pub fn new(maps: Sender<PolarMap>, every: u64) -> Self {
        Self { maps, due: Due::new(every) }
    }

    fn offer(&mut self, map: &PolarMap) -> Result<(), Closed> {
        if !self.due.is_due(map.stamp.sequence) {
            return Ok(());
        }
        let mut copy = self.maps.take()?;
        (copy.stamp, copy.shape) = (map.stamp, map.shape);
        copy.pixels.clone_from(&map.pixels);
        self.maps.send(copy)
    }
}
