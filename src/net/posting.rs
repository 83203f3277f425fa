//! The ends of a service that post its results on a [`Board`].

use super::Board;
use crate::error::Result;
use crate::rt::CaptureEpoch;
use crate::rt::stage::{Flow, Stage};
use lightcast_core::image::PolarMap;
use lightcast_core::light::ReferencedList;
use std::sync::Arc;

/// Posts every list on a board.
pub struct PostLists {
    board: Arc<Board>,
    epoch: CaptureEpoch,
}

impl PostLists {
    /// `epoch` relates the lists' capture times to the kernel's clock.
    pub fn new(board: Arc<Board>, epoch: CaptureEpoch) -> Self {
        Self { board, epoch }
    }
}

impl Stage for PostLists {
    type Input = ReferencedList;
    type Output = ();

    fn step(&mut self, list: &ReferencedList, (): &mut ()) -> Result<Flow> {
        self.board.post(list, &self.epoch);
        Ok(Flow::Send)
    }
}

/// Posts every map on a board, in place of the previous one.
pub struct PostMaps(pub Arc<Board>);

impl Stage for PostMaps {
    type Input = PolarMap;
    type Output = ();

    fn step(&mut self, map: &PolarMap, (): &mut ()) -> Result<Flow> {
        self.0.post_map(map);
        Ok(Flow::Send)
    }
}
