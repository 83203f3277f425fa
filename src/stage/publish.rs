use super::picture::{Due, described_map};
use crate::error::{Error, Result};
use crate::light::LightList;
use crate::net::Board;
use crate::rt::CaptureEpoch;
use crate::rt::link::{Closed, Sender};
use crate::rt::stage::{Flow, Stage};
use std::io::{ErrorKind, Write};
use std::sync::Arc;

/// Writes every list as one line of JSON and flushes, so that a reader has each list whole and at once. A reader
/// that has gone (broken pipe) ends the run without an error.
pub struct Publish<W> {
    writer: W,
    /// Where the lines go, for messages.
    name: String,
    /// The line under way: one `write` per list, and a list is never written in part because of its contents.
    line: Vec<u8>,
    tap: Option<ListTap>,
    copies: Option<Sender<LightList>>,
    board: Option<(Arc<Board>, CaptureEpoch)>,
}

impl<W: Write + Send> Publish<W> {
    /// Lines to `writer`, called `name` in messages; copies of some lists to `tap`, copies of all to `copies`.
    pub fn new(
        writer: W,
        name: impl Into<String>,
        tap: Option<ListTap>,
        copies: Option<Sender<LightList>>,
    ) -> Self {
        Self { writer, name: name.into(), line: Vec::new(), tap, copies, board: None }
    }
}

impl<W> Publish<W> {
    /// Puts all lists on `board` too, from which a server takes them: that waits for nobody. `epoch` says how their capture
    /// times stand to the kernel's clock.
    #[must_use]
    pub fn with_board(self, board: Arc<Board>, epoch: CaptureEpoch) -> Self {
        Self { board: Some((board, epoch)), ..self }
    }
}

impl<W: Write + Send> Stage for Publish<W> {
    type Input = LightList;
    type Output = ();

    fn step(&mut self, list: &LightList, (): &mut ()) -> Result<Flow> {
        let place = || format!("{}: list {}", self.name, list.stamp.sequence);
        self.line.clear();
        list.write_json_line(&mut self.line)
            .map_err(|error| Error::failed("cannot be put into JSON").because(error).at(place()))?;
        match self.writer.write_all(&self.line).and_then(|()| self.writer.flush()) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::BrokenPipe => return Ok(Flow::End),
            Err(error) => return Err(Error::failed("cannot be written").because(error).at(place())),
        }
        if let Some(tap) = &mut self.tap
            && tap.offer(list).is_err()
        {
            self.tap = None;
        }
        if let Some((board, epoch)) = &self.board {
            board.post(list, epoch);
        }
        if let Some(copies) = &mut self.copies {
            let sent = copies.take().and_then(|mut copy| {
                copy.copy_from(list);
                copies.send(copy)
            });
            // A reader of lists that has gone, like one of lines, ends the run.
            if sent.is_err() {
                return Ok(Flow::End);
            }
        }
        Ok(Flow::Send)
    }
}

/// Sends copies of the lists that belong to the maps of a [`MapTap`](super::MapTap): a filtered list describes the
/// map of `filter_delay_frames` before.
pub struct ListTap {
    lists: Sender<LightList>,
    due: Due,
    first: Option<u64>,
}

impl ListTap {
    /// Copies go to `lists`, one in `every` sequence numbers of the maps that they describe.
    pub fn new(lists: Sender<LightList>, every: u64) -> Self {
        Self { lists, due: Due::new(every), first: None }
    }

    fn offer(&mut self, list: &LightList) -> Result<(), Closed> {
        // While the filter fills up, lists describe maps before the first.
        let first = *self.first.get_or_insert(list.stamp.sequence);
        match described_map(list) {
            Some(sequence) if sequence >= first && self.due.is_due(sequence) => {}
            _ => return Ok(()),
        }
        let mut copy = self.lists.take()?;
        copy.copy_from(list);
        self.lists.send(copy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::image::Stamp;
    use std::io;

    fn list(sequence: u64) -> LightList {
        let mut list = LightList::default();
        list.stamp = Stamp { sequence, ..Stamp::default() };
        list
    }

    struct Fails(ErrorKind);

    impl Write for Fails {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(self.0.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn one_line_a_list() {
        let mut lines = Vec::new();
        let mut publish = Publish::new(&mut lines, "memory", None, None);
        for sequence in 0..3 {
            assert_eq!(publish.step(&list(sequence), &mut ()).unwrap(), Flow::Send);
        }
        let text = String::from_utf8(lines).unwrap();
        assert_eq!(text.lines().count(), 3);
        assert!(text.lines().all(|line| line.starts_with("{\"version\":1,") && line.ends_with('}')));
    }

    #[test]
    fn a_broken_pipe_ends_and_a_full_disk_fails_with_the_place() {
        let flow = Publish::new(Fails(ErrorKind::BrokenPipe), "pipe", None, None).step(&list(1), &mut ());
        assert_eq!(flow.unwrap(), Flow::End);
        let error =
            Publish::new(Fails(ErrorKind::StorageFull), "out.jsonl", None, None).step(&list(17), &mut ());
        assert!(error.unwrap_err().to_string().starts_with("out.jsonl: list 17: cannot be written: "));
    }
}
