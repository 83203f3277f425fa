use crate::error::Result;
use crate::image::PolarMap;
use crate::light::LightList;
use crate::net::Board;
use crate::rt::CaptureEpoch;
use crate::rt::link::Receiver;
use crate::rt::stage::{Flow, Stage};
use std::sync::Arc;

/// Puts lists, and with each the newest map, on the board from which a server takes them.
pub struct Post {
    board: Arc<Board>,
    epoch: CaptureEpoch,
    maps: Receiver<PolarMap>,
}

impl Post {
    /// Onto `board`; `epoch` says how the capture times of lists stand to the kernel's clock. `maps` come through a
    /// `latest` link.
    pub fn new(board: Arc<Board>, epoch: CaptureEpoch, maps: Receiver<PolarMap>) -> Self {
        Self { board, epoch, maps }
    }
}

impl Stage for Post {
    type Input = LightList;
    type Output = ();

    fn step(&mut self, list: &LightList, (): &mut ()) -> Result<Flow> {
        if let Ok(Some(map)) = self.maps.try_receive() {
            self.board.post_map(&map);
        }
        self.board.post(list, &self.epoch);
        Ok(Flow::Send)
    }
}
