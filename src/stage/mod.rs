//! One thin file per stage: each runs one algorithm of the floors below under [`rt::stage::run`](crate::rt::stage).

mod calibrate;
mod capture;
mod filter;
mod light;
mod picture;
mod publish;
mod record;
#[cfg(feature = "render")]
mod render;
mod source;

pub use calibrate::Calibrate;
pub use capture::{ATTEMPTS, Capture, Patience};
pub use filter::Filter;
pub use light::{Light, MapTap};
pub use picture::Picture;
pub use publish::{ListTap, Publish};
pub use record::{Record, Recorder, Recording, SIDECAR, Tee, radiance_within_half};
#[cfg(feature = "render")]
pub use render::{Files, PictureWriter, Render};
pub use source::Source;

use crate::light::LightList;
use crate::rt::link::Item;
use lightcast_core::image::{Frame, PolarMap};

impl Item for Frame {
    fn lost_before(&self) -> u64 {
        self.stamp.lost_before
    }

    fn lose(&mut self, count: u64) {
        self.stamp.lost_before += count;
    }
}

impl Item for PolarMap {
    fn lost_before(&self) -> u64 {
        self.stamp.lost_before
    }

    fn lose(&mut self, count: u64) {
        self.stamp.lost_before += count;
    }
}

impl Item for LightList {
    fn lost_before(&self) -> u64 {
        self.stamp.lost_before
    }

    fn lose(&mut self, count: u64) {
        self.stamp.lost_before += count;
    }
}
