use super::{Light, LightList};
use crate::error::{Error, Result};
use crate::light::MAX_LIGHTS;
use lightcast_core::image::Stamp;
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Longest line that is read: [`MAX_LIGHTS`] lights of some 150 bytes each, twice over.
const LINE_MAX_BYTES: u64 = 1 << 23;

/// How far a direction may be from length 1: four written digits.
const LENGTH_TOLERANCE: f32 = 1e-3;
/// The highest irradiance that is read: sums of the most lights of so much still are numbers.
pub const MOST_IRRADIANCE: f32 = 1e30;
/// The highest power that is read: more than the sum of the most lights of the most irradiance.
pub const MOST_POWER: f64 = 1e36;

/// Light lists from a file of JSON lines, as [`LightList::write_json_line`] writes them.
pub struct ListFile {
    name: String,
    reader: Box<dyn BufRead + Send>,
    line_number: u64,
    line: Vec<u8>,
}

/// What a line must hold. Unknown keys are let pass: later versions may say more. The stamp's keys stand here one by one
/// because a flattened `Stamp` would have serde keep the values of all unknown keys.
#[derive(Deserialize)]
struct Message<S> {
    version: u32,
    sequence: u64,
    capture_time_ns: i64,
    lost_before: u64,
    frame_rate_hz: f64,
    #[serde(default)]
    filter_delay_frames: u32,
    chosen_lights: Option<u32>,
    power: Option<[f64; 3]>,
    #[serde(default)]
    error: f32,
    #[serde(default)]
    prefix_errors: Vec<(u32, f32)>,
    lights: Vec<Light>,
    stream: Option<S>,
}

impl ListFile {
    /// # Errors
    /// When the file cannot be opened.
    pub fn open(path: &Path) -> Result<Self> {
        let file = std::fs::File::open(path)
            .map_err(|error| Error::failed("cannot be opened").because(error).at(path.display()))?;
        Ok(Self::new(&path.display().to_string(), file))
    }

    /// Lists from a `reader`, which messages call `name`.
    pub fn new(name: &str, reader: impl Read + Send + 'static) -> Self {
        let reader = Box::new(BufReader::new(reader));
        Self { name: name.to_owned(), reader, line_number: 0, line: Vec::new() }
    }

    /// Reads the next list into `list`; false at the end of the file. Empty lines are passed over.
    ///
    /// # Errors
    /// With file and line, those of [`LightList::read_json`].
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
            if self.line.trim_ascii().is_empty() {
                continue;
            }
            let parsed = if length as u64 > LINE_MAX_BYTES {
                Err(Error::failed(format!("is longer than {LINE_MAX_BYTES} bytes: no light list is")))
            } else {
                list.read_json(self.line.trim_ascii())
            };
            return parsed
                .map(|()| true)
                .map_err(|error| error.at(format_args!("line {}", self.line_number)).at(&self.name));
        }
    }
}

impl LightList {
    /// Becomes what a JSON object says, as [`LightList::write_json_line`] writes it; keys that are unknown are passed
    /// over. Without a `power` that of the lights is taken.
    ///
    /// # Errors
    /// With the column: no JSON, a key that is missing, another version; with the number of the light: directions that
    /// are no unit vectors, irradiances that are negative, not finite or above 1e30; errors that are negative or not
    /// finite. The list is then as it was.
    pub fn read_json(&mut self, text: &[u8]) -> Result<()> {
        self.read_json_with::<IgnoredAny>(text).map(|_| ())
    }

    /// [`Self::read_json`]; gives the value of the key `stream`, in which a list on its way says what goes with it.
    ///
    /// # Errors
    /// Also when that value is no `S`.
    pub fn read_json_with<S: DeserializeOwned>(&mut self, text: &[u8]) -> Result<Option<S>> {
        let message: Message<S> = serde_json::from_slice(text)
            .map_err(|error| Error::failed("is no light list, one JSON object").because(error))?;
        let Message { version, sequence, capture_time_ns, lost_before, frame_rate_hz, .. } = message;
        let Message {
            filter_delay_frames, chosen_lights, power, error, prefix_errors, lights, stream, ..
        } = message;
        if version != 1 {
            return Err(Error::failed(format!("is of version {version}; this program reads version 1")));
        }
        if lights.len() > MAX_LIGHTS {
            return Err(Error::failed(format!(
                "holds {} lights; at most {MAX_LIGHTS} are read",
                lights.len()
            )));
        }
        for (number, light) in lights.iter().enumerate() {
            let length = light.direction.iter().map(|v| v * v).sum::<f32>().sqrt();
            let fault = if length.is_nan() || (length - 1.0).abs() > LENGTH_TOLERANCE {
                "direction is no unit vector"
            } else if !light.irradiance.iter().all(|v| (0.0..=MOST_IRRADIANCE).contains(v)) {
                "irradiance is not from 0 to 1e30"
            } else if !(0.0..=std::f32::consts::PI).contains(&light.spread_rad) {
                "spread_rad is no angle from 0 to pi"
            } else {
                continue;
            };
            return Err(Error::failed(format!("light {number} (id {}): its {fault}", light.id)));
        }
        if power.is_some_and(|power| !power.iter().all(|v| (0.0..=MOST_POWER).contains(v))) {
            return Err(Error::failed("its power is not from 0 to 1e36"));
        }
        if !prefix_errors
            .iter()
            .map(|&(_, error)| error)
            .chain([error])
            .all(|v| (0.0..=f32::MAX).contains(&v))
        {
            return Err(Error::failed("its error, or that of a prefix, is not from 0 to 3.4e38"));
        }
        let mut ids: Vec<u32> = lights.iter().map(|light| light.id).collect();
        ids.sort_unstable();
        if let Some(pair) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::failed(format!("two lights have the id {}", pair[0])));
        }
        self.stamp = Stamp { sequence, capture_time_ns, lost_before, frame_rate_hz };
        (self.filter_delay_frames, self.chosen_lights, self.error) =
            (filter_delay_frames, chosen_lights, error);
        (self.prefix_errors, self.lights) = (prefix_errors, lights);
        self.reference_irradiance.clear();
        self.power = power.unwrap_or_else(|| self.sum_of_lights());
        Ok(stream)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            error: 0.25,
            prefix_errors: vec![(1, 0.5)],
            lights: vec![light(3), light(4)],
            ..LightList::default()
        };
        let mut lines = b"\n".to_vec();
        written.write_json_line(&mut lines).unwrap();
        written.write_json_line(&mut lines).unwrap();
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
