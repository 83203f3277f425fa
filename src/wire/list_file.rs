//! Light lists from files of JSON lines.

use super::MESSAGE_MAX_BYTES;
use super::list::read_list;
use crate::error::{Error, Place, Result, without_mark};
use lightcast_core::light::LightList;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// The longest line that is read: no list is longer.
const LINE_MAX_BYTES: u64 = MESSAGE_MAX_BYTES as u64;

/// Light lists from a file of JSON lines, as [`write_list_line`](super::write_list_line) writes them.
pub struct ListFile {
    name: String,
    reader: Box<dyn BufRead + Send>,
    line_number: u64,
    line: Vec<u8>,
}

impl ListFile {
    /// # Errors
    /// When the file cannot be opened.
    pub fn open(path: &Path) -> Result<Self> {
        let file = std::fs::File::open(path)
            .map_err(|error| Error::failed("cannot be opened").because(error).at(path))?;
        Ok(Self::new(&path.display().to_string(), file))
    }

    /// Lists from a `reader`, which messages call `name`.
    pub fn new(name: &str, reader: impl Read + Send + 'static) -> Self {
        let reader = Box::new(BufReader::new(reader));
        Self { name: name.to_owned(), reader, line_number: 0, line: Vec::new() }
    }

    /// Reads the next list into `list`; false at the end of the file. Empty lines are skipped.
    ///
    /// # Errors
    /// With file and line, those of [`read_list`].
    pub fn read(&mut self, list: &mut LightList) -> Result<bool> {
        loop {
            self.line.clear();
            let mut limited = self.reader.by_ref().take(LINE_MAX_BYTES + 1);
            let length = limited
                .read_until(b'\n', &mut self.line)
                .map_err(|error| Error::failed("cannot be read").because(error).at(&self.name))?;
            if length == 0 {
                return Ok(false);
            }
            self.line_number += 1;
            let line = match self.line_number {
                1 => without_mark(&self.line),
                _ => &self.line,
            };
            if line.trim_ascii().is_empty() {
                continue;
            }
            let parsed = if length as u64 > LINE_MAX_BYTES {
                Err(Error::failed(format!("is longer than {LINE_MAX_BYTES} bytes: no light list is")))
            } else {
                read_list(line.trim_ascii(), list)
            };
            return parsed
                .map(|()| true)
                .map_err(|error| error.at(Place::line(self.line_number)).at(&self.name));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::write_list_line;
    use super::*;
    use lightcast_core::image::Stamp;
    use lightcast_core::light::Light;

    fn file(content: &str) -> (tempfile::TempDir, ListFile) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.jsonl");
        std::fs::write(&path, content).unwrap();
        let file = ListFile::open(&path).unwrap();
        (folder, file)
    }

    fn light(id: u32) -> Light {
        Light { id, direction: [0.6, 0.8, 0.0], irradiance: [1.0, 2.0, 0.5], spread_rad: 0.1 }
    }

    #[test]
    fn what_was_written_is_read() {
        let written = LightList {
            stamp: Stamp { sequence: 17, capture_time_ns: -5, lost_before: 2, frame_rate_hz: 25.0 },
            filter_delay_frames: 4,
            power: [2.0, 4.0, 1.0],
            error: Some(0.25),
            prefix_errors: vec![(1, 0.5)],
            lights: vec![light(3), light(4)],
            ..LightList::default()
        };
        let mut lines = b"\n".to_vec();
        write_list_line(&written, &mut lines).unwrap();
        write_list_line(&written, &mut lines).unwrap();
        let (_folder, mut file) = file(std::str::from_utf8(&lines).unwrap());
        let mut list = LightList::default();
        for _ in 0..2 {
            assert!(file.read(&mut list).unwrap());
            assert_eq!(list, written);
        }
        assert!(!file.read(&mut list).unwrap());
    }

    #[test]
    fn faults_are_told_with_line_and_light() {
        let stamp = "\"sequence\":1,\"capture_time_ns\":0,\"lost_before\":0,\"frame_rate_hz\":25.0";
        let one = |light: &str| format!("{{\"version\":1,{stamp},\"lights\":[{light}]}}");
        let sound = "{\"id\":1,\"direction\":[0,1,0],\"irradiance\":[1,1,1],\"spread_rad\":0}";
        for (line, expected) in [
            (
                "hello".to_owned(),
                "line 2: is no light list, one JSON object: expected value at line 1 column 1",
            ),
            (format!("{{\"version\":2,{stamp},\"lights\":[]}}"), "is of version 2"),
            (format!("{{\"version\":1,{stamp}}}"), "missing field `lights`"),
            (one(&sound.replace("0,1,0", "0,1.1,0")), "light 0 (id 1): its direction is no unit vector"),
            (one(&sound.replace("1,1,1", "1,-1,1")), "its irradiance is not from 0"),
            (one(&sound.replace("1,1,1", "1,1e31,1")), "its irradiance is not from 0 to 1e30"),
            (one(&sound.replace("1,1,1", "1,1e39,1")), "number out of range at line 1 column 141"),
            (one(&sound.replace("rad\":0", "rad\":4")), "its spread_rad is no angle"),
            (one("").replace('{', "{\"error\":-1,"), "its error, or that of a prefix, is not"),
            (
                one("").replace('{', "{\"prefix_errors\":[[1,-1]],"),
                "its error, or that of a prefix, is not from 0",
            ),
            (one(&format!("{sound},{sound}")), "two lights have the id 1"),
        ] {
            let (_folder, mut file) = file(&format!("\n{line}\n"));
            let error = file.read(&mut LightList::default()).unwrap_err().to_string();
            assert!(error.contains("a.jsonl: line 2: ") && error.contains(expected), "{line}\n{error}");
        }
    }
}
