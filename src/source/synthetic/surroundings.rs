//! One type for all scenes: radiance by direction and time.

use super::emitter::Detail;
use super::panorama::{Panorama, PanoramaAt};
use super::room::{Room, RoomAt};
use super::sky::{Sky, SkyAt};
use glam::DVec3;

/// The scene around the camera.
#[derive(Clone, Debug)]
pub enum Surroundings {
    /// Open sky.
    Sky(Sky),
    /// The inside of a box.
    Room(Room),
    /// A recorded panorama.
    Panorama(Panorama),
}

impl Surroundings {
    /// The scene at a time in seconds since frame 0.
    pub fn at(&self, time_s: f64) -> SceneAt<'_> {
        match self {
            Self::Sky(sky) => SceneAt::Sky(sky.at(time_s)),
            Self::Room(room) => SceneAt::Room(room.at(time_s)),
            Self::Panorama(panorama) => SceneAt::Panorama(panorama.at(time_s)),
        }
    }
}

/// A scene at one time.
pub enum SceneAt<'a> {
    /// See [`Surroundings::Sky`].
    Sky(SkyAt<'a>),
    /// See [`Surroundings::Room`].
    Room(RoomAt<'a>),
    /// See [`Surroundings::Panorama`].
    Panorama(PanoramaAt<'a>),
}

impl SceneAt<'_> {
    /// RGB radiance from a direction (unit vector, world frame).
    pub fn radiance(&self, direction: DVec3) -> [f64; 3] {
        match self {
            Self::Sky(sky) => sky.radiance(direction),
            Self::Room(room) => room.radiance(direction),
            Self::Panorama(panorama) => panorama.radiance(direction),
        }
    }

    /// Where the pixel integral must be fine.
    pub fn details(&self) -> Vec<Detail> {
        match self {
            Self::Sky(sky) => sky.details().collect(),
            Self::Room(room) => room.details().collect(),
            Self::Panorama(panorama) => panorama.details().collect(),
        }
    }
}
