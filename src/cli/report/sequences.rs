//! Maps of recorded sequences: numbered panoramas, or whatever a configuration describes.

use crate::camera::{FrameToPolar, Projection, Response};
use crate::config::{Config, Links, Pace, Source as ConfiguredSource};
use crate::error::{Error, Kind, Result};
use crate::image::{Frame, PolarMap};
use crate::report::stills::SHAPE;
use crate::rt::{Shutdown, link};
use crate::service::{Copies, Output, Service};
use crate::source::{Next, Sequence, SequenceOptions, Source};
use glam::DMat3;
use std::path::Path;
use std::time::Duration;

/// At most `limit` maps, fewer when `shutdown` is requested. `frame_rate_hz` goes before what files of panoramas say.
pub(super) fn read(
    path: &Path,
    frame_rate_hz: Option<f64>,
    limit: usize,
    shutdown: &Shutdown,
) -> Result<Vec<PolarMap>> {
    if path.extension().is_some_and(|extension| extension == "toml") {
        configured(path, limit, shutdown)
    } else {
        panoramas(path, frame_rate_hz, limit, shutdown)
    }
}

/// Runs the service that `run --config` would, as fast as it goes, and keeps its maps.
fn configured(path: &Path, limit: usize, shutdown: &Shutdown) -> Result<Vec<PolarMap>> {
    let mut config = Config::load(path)?;
    match &mut config.source {
        ConfiguredSource::Sequence(options) => options.repeat = false,
        #[cfg(feature = "camera")]
        ConfiguredSource::Camera(..) => {
            return Err(Error::usage(
                "a live camera gives other frames to every method; record it (`lightcast record`) and name the recording",
            )
            .at(path.display()));
        }
    }
    (config.map, config.links, config.pace) = (SHAPE, Links::Replay, Pace::Fast);
    let own = Shutdown::new();
    let (sender, mut receiver) = link::bounded(2, &own, || PolarMap::black(SHAPE));
    let copies = Copies { maps: Some(sender), ..Copies::default() };
    let nowhere = || Ok(Output { writer: Box::new(std::io::sink()), name: "nowhere".to_owned() });
    let service = Service::start(&config, nowhere, copies, &own)?;
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

/// Averages numbered lat-long panoramas of radiance.
fn panoramas(
    path: &Path,
    frame_rate_hz: Option<f64>,
    limit: usize,
    shutdown: &Shutdown,
) -> Result<Vec<PolarMap>> {
    let options = SequenceOptions { path: path.to_owned(), frame_rate_hz, ..SequenceOptions::default() };
    let mut source = Sequence::open(&options).map_err(|error| match error.kind() {
        Kind::Usage => Error::usage(format!("{error} (with --frame-rate)")),
        _ => error,
    })?;
    let format = source.format();
    if format.is_codes {
        return Err(Error::usage(
            "holds raw sensor codes; name a configuration that says what they mean, such as config/replay.toml",
        )
        .at(path.display()));
    }
    let projection =
        Projection::LatLong { width: format.width, height: format.height, centres: format.latlong_centres };
    let mut frame_to_polar = FrameToPolar::new(&projection, DMat3::IDENTITY, SHAPE)?;
    let (mut frame, mut maps) = (Frame::default(), Vec::new());
    while maps.len() < limit && !shutdown.is_requested() {
        match source.next(&mut frame) {
            Ok(Next::End) => break,
            Ok(Next::Frame) => {
                let mut map = PolarMap::black(SHAPE);
                frame_to_polar.apply(&frame, &Response::default(), &mut map)?;
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
    use crate::image::{Pixels, write_exr};

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
        let maps = read(folder.path(), None, 100, &shutdown).unwrap();
        let stamps: Vec<(u64, u64)> =
            maps.iter().map(|map| (map.stamp.sequence, map.stamp.lost_before)).collect();
        assert_eq!(stamps, [(1, 0), (2, 0), (4, 1), (5, 0)]);
        assert!(maps.iter().all(|map| map.stamp.frame_rate_hz == 25.0));
        assert_eq!(read(folder.path(), Some(50.0), 2, &shutdown).unwrap()[1].stamp.frame_rate_hz, 50.0);
        shutdown.request();
        assert!(read(folder.path(), None, 100, &shutdown).unwrap().is_empty());
    }

    #[test]
    fn a_configuration_gives_the_maps_that_run_would_see() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/replay.toml");
        let maps = read(&path, None, 12, &Shutdown::new()).unwrap();
        assert_eq!(maps.len(), 12);
        assert!(maps.iter().all(|map| map.shape == SHAPE && map.stamp.lost_before == 0));
        assert!(maps.windows(2).all(|pair| pair[0].pixels != pair[1].pixels));
    }

    #[test]
    fn raw_codes_and_unknown_rates_are_refused_with_a_way_out() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/day");
        let error = read(&folder, Some(25.0), 3, &Shutdown::new()).unwrap_err();
        assert!(error.kind() == Kind::Usage && error.to_string().contains("configuration"), "{error}");
        let folder = tempfile::tempdir().unwrap();
        for number in 1..=2 {
            write_exr(&folder.path().join(format!("a.{number}.exr")), &panorama(number), None, false)
                .unwrap();
        }
        let error = read(folder.path(), None, 3, &Shutdown::new()).unwrap_err().to_string();
        assert!(error.contains("--frame-rate"), "{error}");
    }
}
