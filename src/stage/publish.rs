use crate::error::{Error, Place, Result};
use crate::rt::stage::{Flow, Stage};
use crate::wire::write_list_line;
use lightcast_core::light::LightList;
use std::io::{ErrorKind, Write};

/// Writes every list as one line of JSON and flushes, so that a reader gets each list complete and
/// immediately. A reader that has gone (broken pipe) ends the stage without an error.
pub struct Publish<W> {
    writer: W,
    /// Where the lines go, for messages.
    name: String,
    /// The current line: there is one `write` per list, and the contents of a list never cause it to be
    /// written in part.
    line: Vec<u8>,
}

impl<W: Write + Send> Publish<W> {
    /// Lines to `writer`, called `name` in messages.
    pub fn new(writer: W, name: impl Into<String>) -> Self {
        Self { writer, name: name.into(), line: Vec::new() }
    }
}

impl<W: Write + Send> Stage for Publish<W> {
    type Input = LightList;
    type Output = ();

    fn step(&mut self, list: &LightList, (): &mut ()) -> Result<Flow> {
        let at_list = |error: Error| error.at(Place::List(list.stamp.sequence)).at(&self.name);
        self.line.clear();
        write_list_line(list, &mut self.line)
            .map_err(|error| at_list(Error::failed("cannot be put into JSON").because(error)))?;
        match self.writer.write_all(&self.line).and_then(|()| self.writer.flush()) {
            Ok(()) => Ok(Flow::Send),
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(Flow::End),
            Err(error) => Err(at_list(Error::failed("cannot be written").because(error))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::image::Stamp;
    use std::io;

    fn list(sequence: u64) -> LightList {
        LightList { stamp: Stamp { sequence, ..Stamp::default() }, ..LightList::default() }
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
        let mut publish = Publish::new(&mut lines, "memory");
        for sequence in 0..3 {
            assert_eq!(publish.step(&list(sequence), &mut ()).unwrap(), Flow::Send);
        }
        let text = String::from_utf8(lines).unwrap();
        assert_eq!(text.lines().count(), 3);
        assert!(text.lines().all(|line| line.starts_with("{\"version\":1,") && line.ends_with('}')));
    }

    #[test]
    fn a_broken_pipe_ends_and_a_full_disk_fails_with_the_place() {
        let flow = Publish::new(Fails(ErrorKind::BrokenPipe), "pipe").step(&list(1), &mut ());
        assert_eq!(flow.unwrap(), Flow::End);
        let error = Publish::new(Fails(ErrorKind::StorageFull), "out.jsonl").step(&list(17), &mut ());
        assert!(error.unwrap_err().to_string().starts_with("out.jsonl: list 17: cannot be written: "));
    }
}
