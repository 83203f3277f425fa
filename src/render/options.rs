use crate::error::{Error, Result};

/// Sizes and numbers of a [`Renderer`](super::Renderer). The defaults are the paper's numbers of lights and
/// shadow maps; the cone is wider.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Columns of the picture.
    pub width_px: u32,
    /// Rows of the picture.
    pub height_px: u32,
    /// Lights in set H, which light everything; a longer list is merged into them, and lights glossy surfaces
    /// as set L.
    pub lights: usize,
    /// Number of shadow maps; lights without one use that of the nearest light that has one.
    pub shadow_maps: usize,
    /// Side of a shadow map in texels.
    pub shadow_map_px: u32,
    /// Depth comparisons for the blocker search and for the filter of a soft shadow, up to 256; 1: hard
    /// shadows.
    pub soft_samples: u32,
    /// Whether pixels evaluate only the lights of their angular region.
    pub culling: bool,
    /// Angle gamma in radians: set L is used within gamma / 2 of the mirrored view direction. 0: only set H.
    pub cone_rad: f64,
    /// Maximum number of lights of set L in a region.
    pub region_lights: usize,
    /// Whether to count the lights that pixels evaluate, see
    /// [`Renderer::read_counts`](super::Renderer::read_counts).
    pub count_lights: bool,
    /// Most lights of set H after clustering; `None`: no clustering.
    pub clusters: Option<usize>,
    /// The lightings that are summed.
    pub lighting: Lightings,
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
            lights: 72,
            shadow_maps: 72,
            shadow_map_px: 256,
            soft_samples: 8,
            culling: true,
            // Wide enough for the tails of GGX: a white furnace is within 5 % (renderer_tests.rs), which it
            // is not at 20 degrees.
            cone_rad: 40f64.to_radians(),
            region_lights: 216,
            count_lights: false,
            clusters: None,
            lighting: Lightings::ALL,
            ground_albedo: 0.0,
        }
    }
}

/// Largest side of a picture, and most lights and shadow maps: more than any scene needs, and small enough
/// that no product of them overflows.
const MAX_SIDE_PX: u32 = 16_384;
const MAX_SHADOW_MAPS: usize = 4096;
/// Most comparisons for a soft shadow: a pixel makes twice as many for every light, and a driver aborts a
/// pass that takes seconds.
const MAX_SOFT_SAMPLES: u32 = 256;

impl Options {
    /// Tiles along a side of the shadow atlas.
    pub(super) fn tiles_per_side(&self) -> u32 {
        (self.shadow_maps.max(1) as f64).sqrt().ceil() as u32
    }

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
        if !(1..=lightcast_core::light::MAX_LIGHTS).contains(&self.lights) {
            return Err(Error::usage(format!(
                "{} lights; give 1 to {}",
                self.lights,
                lightcast_core::light::MAX_LIGHTS
            )));
        }
        if self.shadow_maps > MAX_SHADOW_MAPS || !(8..=most_px).contains(&self.shadow_map_px) {
            return Err(Error::usage(format!(
                "{} shadow maps of {} x {2} texels; give at most {MAX_SHADOW_MAPS}, of 8 to {most_px} texels",
                self.shadow_maps, self.shadow_map_px, self.shadow_map_px
            )));
        }
        let atlas_px = u64::from(self.tiles_per_side()) * u64::from(self.shadow_map_px);
        if atlas_px > u64::from(limits.max_texture_dimension_2d) {
            return Err(Error::usage(format!(
                "{} shadow maps of {1} x {1} texels need an atlas of {atlas_px} texels along a side; this device has {2}",
                self.shadow_maps, self.shadow_map_px, limits.max_texture_dimension_2d
            )));
        }
        if !(1..=MAX_SOFT_SAMPLES).contains(&self.soft_samples) {
            return Err(Error::usage(format!(
                "{} comparisons for a soft shadow; give 1 (hard shadows) to {MAX_SOFT_SAMPLES}",
                self.soft_samples
            )));
        }
        if !(0.0..=std::f64::consts::PI).contains(&self.cone_rad) {
            return Err(Error::usage(format!("a cone of {:?} rad; give 0 to pi", self.cone_rad)));
        }
        if !(0.0..=1.0).contains(&self.ground_albedo) {
            return Err(Error::usage(format!("a ground of albedo {:?}; give 0 to 1", self.ground_albedo)));
        }
        if self.clusters == Some(0) {
            return Err(Error::usage("0 clusters; give 1 or more"));
        }
        Ok(())
    }
}
