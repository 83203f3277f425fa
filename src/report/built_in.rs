//! Inputs for a report when none are named: three maps of different character, and two sequences. They are
//! scripts for `lightcast synthesize`, so they are the same everywhere.

use crate::error::{Result, TomlText};
use crate::source::synthetic::{Script, Synthetic};
use lightcast_core::camera::{FrameToPolar, Response};
use lightcast_core::image::{Frame, PolarMap, PolarShape};

/// A calculated scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuiltIn {
    /// Its name in reports.
    pub name: &'static str,
    script: &'static str,
}

const OVERCAST: BuiltIn =
    BuiltIn { name: "overcast sky (built in)", script: include_str!("built_in/overcast.toml") };
const SUN: BuiltIn = BuiltIn { name: "moving sun (built in)", script: include_str!("built_in/sun.toml") };
const HALL: BuiltIn =
    BuiltIn { name: "hall of flickering lamps (built in)", script: include_str!("built_in/hall.toml") };

/// Those whose first frame is a map.
pub const MAPS: [BuiltIn; 3] = [OVERCAST, SUN, HALL];
/// Those that move.
pub const SEQUENCES: [BuiltIn; 2] = [SUN, HALL];

impl BuiltIn {
    fn parsed(&self) -> Result<Script> {
        Script::parse(&TomlText { path: self.name.into(), text: self.script.to_owned() }, None)
    }

    /// The number of its frames, and of frames per second.
    ///
    /// # Errors
    /// Those of [`Script::parse`].
    pub fn length(&self) -> Result<(usize, f64)> {
        let script = self.parsed()?;
        Ok((script.frames, script.frame_rate_hz))
    }

    /// Its frames, averaged to maps of this shape, at most `limit` of them. `goes_on` is asked after every
    /// frame; when it says no, the maps until then are all.
    ///
    /// # Errors
    /// Those of [`Script::parse`] and [`FrameToPolar::new`], for impossible shapes.
    pub fn maps(&self, shape: PolarShape, limit: usize, goes_on: impl Fn() -> bool) -> Result<Vec<PolarMap>> {
        let script = self.parsed()?;
        let frame_count = script.frames.min(limit);
        let mut frame_to_polar = FrameToPolar::new(script.projection(), script.world_from_camera(), shape)?;
        let mut source = Synthetic::new(script);
        // The frames are radiance; a response has a table all the same, so one is used for all.
        let (mut frame, response) = (Frame::default(), Response::default());
        let mut maps = Vec::with_capacity(frame_count);
        for index in 0..frame_count {
            source.render(index, &mut frame);
            let mut map = PolarMap::black(shape);
            frame_to_polar.apply(&frame, &response, &mut map)?;
            maps.push(map);
            if !goes_on() {
                break;
            }
        }
        Ok(maps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::image::luminance_f64;

    const SHAPE: PolarShape = PolarShape::hemisphere(90, 22);

    /// The share of the power that the brightest hundredth of the pixels has.
    fn peak_share(map: &PolarMap) -> f64 {
        let mut powers: Vec<f64> = (0..SHAPE.len())
            .map(|i| f64::from(map.luminance(i / 90, i % 90)) * SHAPE.pixel_solid_angle(i / 90))
            .collect();
        powers.sort_by(|a, b| b.total_cmp(a));
        powers.iter().take(SHAPE.len() / 100).sum::<f64>() / powers.iter().sum::<f64>()
    }

    #[test]
    fn maps_are_of_different_character() {
        let [overcast, sun, hall] = MAPS.map(|scene| peak_share(&scene.maps(SHAPE, 1, || true).unwrap()[0]));
        assert!(overcast < 0.04, "{overcast}");
        assert!(sun > 0.6, "{sun}");
        assert!((0.1..0.6).contains(&hall), "{hall}");
    }

    #[test]
    fn who_stops_it_gets_what_is_there() {
        assert_eq!(SEQUENCES[0].maps(SHAPE, 12, || false).unwrap().len(), 1);
    }

    #[test]
    fn sequences_move() {
        for scene in SEQUENCES {
            let maps = scene.maps(SHAPE, 12, || true).unwrap();
            assert_eq!(maps.len(), 12, "{}", scene.name);
            assert_eq!(scene.length().unwrap(), (40, 25.0), "{}", scene.name);
            let stamps: Vec<u64> = maps.iter().map(|map| map.stamp.sequence).collect();
            assert!(stamps.is_sorted() && maps.iter().all(|map| map.stamp.frame_rate_hz == 25.0));
            assert!(maps.windows(2).all(|pair| pair[0].pixels != pair[1].pixels), "{}", scene.name);
            assert!(maps.iter().all(|map| luminance_f64(map.power()) > 0.0));
        }
    }
}
