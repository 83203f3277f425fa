use super::directional::DirectionalOptions;
use crate::error::{Error, Result};

/// Size of the pictures of a [`Renderer`](super::Renderer), and what each lighting is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Columns of the picture.
    pub width_px: u32,
    /// Rows of the picture.
    pub height_px: u32,
    /// The lightings that are summed.
    pub lighting: Lightings,
    /// Options of [`Lightings::directional`].
    pub directional: DirectionalOptions,
    /// Albedo, 0 to 1, of the ground below the horizon, whose light [`Lightings::ambient`] adds; 0: none.
    pub ground_albedo: f32,
}

/// The lightings that add radiance to a view, each named after its folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lightings {
    /// Directional lights with shadows.
    pub directional: bool,
    /// The light of a ground that a capture does not see.
    pub ambient: bool,
}

impl Lightings {
    /// All of them.
    pub const ALL: Self = Self { directional: true, ambient: true };
}

impl Default for Options {
    fn default() -> Self {
        Self {
            width_px: 640,
            height_px: 480,
            lighting: Lightings::ALL,
            directional: DirectionalOptions::default(),
            ground_albedo: 0.0,
        }
    }
}

/// Largest side of a picture: more than any scene needs, and small enough that no product overflows.
const MAX_SIDE_PX: u32 = 16_384;

impl Options {
    /// Number of pixels.
    pub(super) fn pixels(&self) -> usize {
        self.width_px as usize * self.height_px as usize
    }

    /// Refuses options that the device does not support, before anything is allocated.
    pub(super) fn check(&self, limits: &wgpu::Limits) -> Result<()> {
        let most_px = MAX_SIDE_PX.min(limits.max_texture_dimension_2d);
        let side = 1..=most_px;
        if !side.contains(&self.width_px) || !side.contains(&self.height_px) {
            return Err(Error::usage(format!(
                "a picture of {} x {} pixels; this device draws 1 to {most_px} along a side",
                self.width_px, self.height_px
            )));
        }
        if self.pixels() as u64 * 16 > limits.max_storage_buffer_binding_size {
            return Err(Error::usage(format!(
                "a picture of {} x {} pixels; this device has room for {}",
                self.width_px,
                self.height_px,
                limits.max_storage_buffer_binding_size / 16
            )));
        }
        self.directional.check(most_px)?;
        if !(0.0..=1.0).contains(&self.ground_albedo) {
            return Err(Error::usage(format!("a ground of albedo {:?}; give 0 to 1", self.ground_albedo)));
        }
        Ok(())
    }
}
