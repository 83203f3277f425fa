//! The ends of a service that put what it makes on a [`Board`].

use super::Board;
use crate::error::Result;
use crate::rt::CaptureEpoch;
use crate::rt::stage::{Flow, Stage};
use lightcast_core::image::PolarMap;
use lightcast_core::light::LightList;
use std::sync::Arc;

/// Puts every list on a board.
pub struct PostLists {
    board: Arc<Board>,
    epoch: CaptureEpoch,
}

impl PostLists {
    /// `epoch` says how the lists' capture times stand to the kernel's clock.
    pub fn new(board: Arc<Board>, epoch: CaptureEpoch) -> Self {
        Self { board, epoch }
    }
}

impl Stage for PostLists {
    type Input = LightList;
    type Output = ();

    fn step(&mut self, list: &LightList, (): &mut ()) -> Result<Flow> {
        self.board.post(list, &self.epoch);
        Ok(Flow::Send)
    }
}

/// Puts every map on a board, in place of the one before.
pub struct PostMaps(pub Arc<Board>);

impl Stage for PostMaps {
    type Input = PolarMap;
    type Output = ();

    fn step(&mut self, map: &PolarMap, (): &mut ()) -> Result<Flow> {
        self.0.post_map(map);
        Ok(Flow::Send)
    }
}
