//! Recorded sequences: numbered panoramas, or whatever a configuration describes.

use crate::compare::still_methods::SHAPE;
use crate::config::{Config, Links, Pace, SourceOptions};
use crate::error::{Error, Kind, Result};
use crate::rt::{Shutdown, link};
use crate::service::{Ends, Prepared, Service};
use crate::source::{FrameSource, Next, Sequence, SequenceOptions};
use glam::DMat3;
use lightcast_core::camera::{FrameToPolar, Projection, Response};
use lightcast_core::image::{Frame, PolarMap};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A sequence that is open.
pub(super) struct Recorded {
    path: PathBuf,
    source: Frames,
    /// Frames, readable or not, and how many there are a second.
    length: (usize, f64),
}

enum Frames {
    /// Lat-long panoramas of radiance.
    Panoramas(Sequence),
    /// What a configuration describes.
    Configured(Box<Config>),
}

impl Recorded {
    /// Opens a configuration and checks everything that its first picture can show.
    pub fn configured(path: &Path) -> Result<Self> {
        let (config, length) = configuration(path)?;
        Ok(Self { path: path.to_owned(), source: Frames::Configured(Box::new(config)), length })
    }

    /// Opens a folder or a pattern of panoramas. `frame_rate_hz` takes precedence over the files.
    pub fn panoramas(path: &Path, frame_rate_hz: Option<f64>) -> Result<Self> {
        let sequence = panoramas(path, frame_rate_hz)?;
        let length = length(&sequence);
        Ok(Self { path: path.to_owned(), source: Frames::Panoramas(sequence), length })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn is_configured(&self) -> bool {
        matches!(self.source, Frames::Configured(_))
    }

    /// Number of frames, readable or not, and frames per second.
    pub fn length(&self) -> (usize, f64) {
        self.length
    }

    /// At most `limit` maps, fewer when `shutdown` is requested.
    pub fn read(&mut self, limit: usize, shutdown: &Shutdown) -> Result<Vec<PolarMap>> {
        match &mut self.source {
            Frames::Panoramas(sequence) => average(sequence, limit, shutdown),
            Frames::Configured(config) => run(config, limit, shutdown),
        }
    }
}

fn length(sequence: &Sequence) -> (usize, f64) {
    (sequence.file_count(), sequence.format().frame_rate_hz)
}

/// A configuration whose service would start, with maps of this report's shape.
fn configuration(path: &Path) -> Result<(Config, (usize, f64))> {
    let mut config = Config::load(path)?;
    (config.map, config.links, config.pace) = (SHAPE, Links::Replay, Pace::Fast);
    let length = match &mut config.source {
        SourceOptions::Sequence(options) => {
            options.repeat = false;
            length(&Sequence::open(options)?)
        }
        #[cfg(feature = "camera")]
        SourceOptions::Camera(..) => {
            return Err(Error::usage(
                "a live camera gives other frames to every method; record it (`lightcast record`) and name the recording",
            )
            .at(path));
        }
    };
    Prepared::new(&config)?;
    Ok((config, length))
}

/// Runs the service that `run` would, as fast as possible, and keeps its maps.
fn run(config: &Config, limit: usize, shutdown: &Shutdown) -> Result<Vec<PolarMap>> {
    let own = Shutdown::new();
    let (sender, mut receiver) = link::bounded(2, &own, || PolarMap::black(SHAPE));
    let service = Service::start(config, Ends { maps: Some(sender), ..Ends::default() }, &own)?;
    let mut maps = Vec::new();
    while maps.len() < limit && !shutdown.is_requested() {
        let Some(map) = receiver.receive() else { break };
        maps.push(PolarMap::clone(&map));
    }
    drop(receiver);
    own.request();
    service.join(Duration::from_millis(10), || ())?;
    Ok(maps)
}

/// Opens numbered lat-long panoramas of radiance.
fn panoramas(path: &Path, frame_rate_hz: Option<f64>) -> Result<Sequence> {
    let open = |frame_rate_hz| {
        Sequence::open(&SequenceOptions {
            path: path.to_owned(),
            frame_rate_hz,
            ..SequenceOptions::default()
        })
    };
    let sequence = open(frame_rate_hz).map_err(|error| {
        // The error of a wrong pattern has nothing to do with rates.
        if frame_rate_hz.is_none() && error.kind() == Kind::Usage && open(Some(1.0)).is_ok() {
            return Error::usage("the files say no frame rate; give --frame-rate HZ").at(path);
        }
        error
    })?;
    if sequence.format().is_codes {
        return Err(Error::usage(
            "holds raw sensor codes; name a configuration that says what they mean, such as config/replay.toml",
        )
        .at(path));
    }
    Ok(sequence)
}

/// Averages panoramas to maps.
fn average(sequence: &mut Sequence, limit: usize, shutdown: &Shutdown) -> Result<Vec<PolarMap>> {
    let format = sequence.format();
    let projection =
        Projection::LatLong { width: format.width, height: format.height, centres: format.latlong_centres };
    let mut frame_to_polar = FrameToPolar::new(&projection, DMat3::IDENTITY, SHAPE)?;
    let (mut frame, mut maps, response) = (Frame::default(), Vec::new(), Response::default());
    while maps.len() < limit && !shutdown.is_requested() {
        match sequence.next(&mut frame) {
            Ok(Next::End) => break,
            Ok(Next::Frame) => {
                let mut map = PolarMap::black(SHAPE);
                frame_to_polar.apply(&frame, &response, &mut map)?;
                maps.push(map);
            }
            Err(error) if error.kind() == Kind::BadFrame => tracing::warn!("{error}"),
            Err(error) => return Err(error),
        }
    }
    Ok(maps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_exr;
    use lightcast_core::image::Pixels;

    fn panorama(shift: usize) -> Frame {
        let (width, height) = (32, 16);
        let value = |i: usize| if i % width == shift { 20.0 } else { 0.5 };
        let samples = (0..width * height * 3).map(|i| value(i / 3)).collect();
        Frame { width, height, channels: 3, pixels: Pixels::Radiance(samples), ..Frame::default() }
    }

    #[test]
    fn panoramas_come_in_order_without_those_that_are_damaged() {
        let folder = tempfile::tempdir().unwrap();
        for number in 1..=5 {
            let path = folder.path().join(format!("sky.{number:04}.exr"));
            write_exr(&path, &panorama(number), Some(25.0), false).unwrap();
        }
        std::fs::write(folder.path().join("sky.0003.exr"), "nothing").unwrap();
        let shutdown = Shutdown::new();
        let read = |rate_hz, limit| {
            let mut recorded = Recorded::panoramas(folder.path(), rate_hz).unwrap();
            (recorded.length(), recorded.read(limit, &shutdown).unwrap())
        };
        let (length, maps) = read(None, 100);
        assert_eq!(length, (5, 25.0));
        let stamps: Vec<(u64, u64)> =
            maps.iter().map(|map| (map.stamp.sequence, map.stamp.lost_before)).collect();
        assert_eq!(stamps, [(1, 0), (2, 0), (4, 1), (5, 0)]);
        assert!(maps.iter().all(|map| map.stamp.frame_rate_hz == 25.0));
        let (length, maps) = read(Some(50.0), 2);
        assert_eq!((length, maps.len(), maps[1].stamp.frame_rate_hz), ((5, 50.0), 2, 50.0));
        shutdown.request();
        assert!(read(None, 100).1.is_empty());
    }

    #[test]
    fn a_configuration_gives_the_maps_that_run_would_see() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/replay.toml");
        let mut recorded = Recorded::configured(&path).unwrap();
        assert!(recorded.is_configured() && recorded.length().0 >= 100);
        let maps = recorded.read(12, &Shutdown::new()).unwrap();
        assert_eq!(maps.len(), 12);
        assert!(maps.iter().all(|map| map.shape == SHAPE && map.stamp.lost_before == 0));
        assert!(maps.windows(2).all(|pair| pair[0].pixels != pair[1].pixels));
    }

    #[test]
    fn raw_codes_and_unknown_rates_are_refused_with_a_way_out() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/day");
        let error = Recorded::panoramas(&folder, Some(25.0)).err().unwrap();
        assert!(error.kind() == Kind::Usage && error.to_string().contains("configuration"), "{error}");
        let folder = tempfile::tempdir().unwrap();
        for number in 1..=2 {
            write_exr(&folder.path().join(format!("a.{number}.exr")), &panorama(number), None, false)
                .unwrap();
        }
        let error = |path: &Path| Recorded::panoramas(path, None).err().unwrap().to_string();
        assert!(error(folder.path()).contains("--frame-rate"), "{}", error(folder.path()));
        let nothing = error(&folder.path().join("b.###.exr"));
        assert!(nothing.contains("b.###.exr") && !nothing.contains("--frame-rate"), "{nothing}");
    }
}
