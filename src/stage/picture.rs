use crate::error::Result;
use crate::light::LightList;
use crate::picture;
use crate::rt::link::Receiver;
use crate::rt::stage::{Flow, Stage};
use lightcast_core::image::PolarMap;
use std::path::PathBuf;

/// Draws maps with the published lights that belong to them.
pub struct Picture {
    lists: Receiver<LightList>,
    /// The last list received, if any: it may belong to a map that is still to come.
    list: Option<LightList>,
    folder: PathBuf,
}

impl Picture {
    /// Pictures go to `folder`, which must exist; `lists` come from a [`ListTap`](super::ListTap).
    pub fn new(lists: Receiver<LightList>, folder: PathBuf) -> Self {
        Self { lists, list: None, folder }
    }
}

impl Stage for Picture {
    type Input = PolarMap;
    type Output = ();

    /// A map whose list was lost or will not come (the run ends within the filter's delay) is not drawn.
    fn step(&mut self, map: &PolarMap, (): &mut ()) -> Result<Flow> {
        let is_before = |list: &LightList| described_map(list) < Some(map.stamp.sequence);
        while self.list.as_ref().is_none_or(is_before) {
            let Some(received) = self.lists.receive() else { return Ok(Flow::End) };
            self.list.get_or_insert_default().copy_from(&received);
        }
        if let Some(list) = &self.list
            && described_map(list) == Some(map.stamp.sequence)
        {
            picture::draw(map, list, &self.folder)?;
        }
        Ok(Flow::Send)
    }
}

/// Sequence number of the map that a list describes; `None` while the filter fills up.
pub(super) fn described_map(list: &LightList) -> Option<u64> {
    list.stamp.sequence.checked_sub(u64::from(list.filter_delay_frames))
}

/// Finds the first item of every block of `every` sequence numbers. Not the multiples themselves: where one was
/// lost, the next takes its place, so that no map waits for a list that will not come.
pub(super) struct Due {
    every: u64,
    last_block: Option<u64>,
}

impl Due {
    pub fn new(every: u64) -> Self {
        Self { every: every.max(1), last_block: None }
    }

    pub fn is_due(&mut self, sequence: u64) -> bool {
        let block = Some(sequence / self.every);
        let is_due = self.last_block != block;
        self.last_block = block;
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_every_block_is_due() {
        let mut due = Due::new(10);
        let found: Vec<u64> =
            [3, 4, 9, 12, 19, 20, 21, 45, 50].into_iter().filter(|&sequence| due.is_due(sequence)).collect();
        assert_eq!(found, [3, 12, 20, 45, 50]);
    }
}
