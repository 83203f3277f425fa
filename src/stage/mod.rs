//! One thin file per stage: each runs one algorithm of the layers below under
//! [`rt::stage::run`](crate::rt::stage).

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
mod written;

pub use calibrate::Calibrate;
pub use capture::{ATTEMPTS, Capture, Patience};
pub use filter::Filter;
pub use light::Light;
pub use picture::Picture;
pub use publish::Publish;
pub use record::{Record, Recording, SIDECAR, radiance_within_half};
#[cfg(feature = "render")]
pub use render::{PictureWriter, Render};
pub use source::Source;

use crate::rt::link::{Copied, Item, PartOf};
use lightcast_core::image::{Frame, PolarMap};
use lightcast_core::light::LightList;
use lightcast_core::light::ReferencedList;

impl Item for Frame {
    fn lost_before(&self) -> u64 {
        self.stamp.lost_before
    }

    fn lose(&mut self, count: u64) {
        self.stamp.lost_before += count;
    }
}

impl Copied for Frame {
    fn copy_from(&mut self, other: &Self) {
        self.copy_from(other);
    }

    fn sequence(&self) -> Option<u64> {
        Some(self.stamp.sequence)
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

impl Copied for PolarMap {
    fn copy_from(&mut self, other: &Self) {
        (self.stamp, self.shape) = (other.stamp, other.shape);
        self.pixels.clone_from(&other.pixels);
    }

    fn sequence(&self) -> Option<u64> {
        Some(self.stamp.sequence)
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

impl Copied for LightList {
    fn copy_from(&mut self, other: &Self) {
        self.copy_from(other);
    }

    /// The number of the frame whose lights it describes, which the filter delays; `None`, or a number before
    /// that of the first frame, while the filter fills up.
    fn sequence(&self) -> Option<u64> {
        self.stamp.sequence.checked_sub(u64::from(self.filter_delay_frames))
    }
}

impl Item for ReferencedList {
    fn lost_before(&self) -> u64 {
        self.list.lost_before()
    }

    fn lose(&mut self, count: u64) {
        self.list.lose(count);
    }
}

impl Copied for ReferencedList {
    fn copy_from(&mut self, other: &Self) {
        self.copy_from(other);
    }

    fn sequence(&self) -> Option<u64> {
        self.list.sequence()
    }
}

/// The part that most ends need.
impl PartOf<ReferencedList> for LightList {
    fn copy_part_of(&mut self, whole: &ReferencedList) {
        self.copy_from(&whole.list);
    }
}
