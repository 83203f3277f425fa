use crate::error::Result;
use crate::image::PolarMap;
use crate::light::LightList;
use crate::picture;
use crate::rt::link::Receiver;
use crate::rt::stage::{Flow, Stage};
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
    first_list: Option<u64>,
}

impl Due {
    pub fn new(every: u64) -> Self {
        Self { every: every.max(1), last_block: None, first_list: None }
    }

    pub fn is_due(&mut self, sequence: u64) -> bool {
        let block = Some(sequence / self.every);
        let is_due = self.last_block != block;
        self.last_block = block;
        is_due
    }

    /// Whether a list describes a map that is due, so that all pictures of one frame carry the number of one list.
    /// While the filter fills up, lists describe maps before the first; they count only where every list does.
    pub fn is_list_due(&mut self, list: &LightList) -> bool {
        let first = *self.first_list.get_or_insert(list.stamp.sequence);
        self.every == 1
            || described_map(list).is_some_and(|sequence| sequence >= first && self.is_due(sequence))
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

    #[test]
    fn lists_are_due_with_the_maps_that_they_describe() {
        let due_lists = |every, filter_delay_frames| -> Vec<u64> {
            let mut due = Due::new(every);
            let mut list = LightList::default();
            list.filter_delay_frames = filter_delay_frames;
            (1..=30)
                .filter(|&sequence| {
                    list.stamp.sequence = sequence;
                    due.is_list_due(&list)
                })
                .collect()
        };
        assert_eq!(due_lists(10, 0), [1, 10, 20, 30]);
        assert_eq!(due_lists(10, 4), [5, 14, 24], "of maps 1, 10 and 20");
        assert_eq!(due_lists(1, 4), (1..=30).collect::<Vec<_>>());
    }
}
