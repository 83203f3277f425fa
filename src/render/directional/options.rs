use crate::error::{Error, Result};
use lightcast_core::light::MAX_LIGHTS;

/// Sizes and numbers of the lighting by directional lights. The defaults are the paper's numbers of lights and
/// shadow maps; the cone is wider.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalOptions {
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
    /// [`Renderer::read_counts`](crate::render::Renderer::read_counts).
    pub count_lights: bool,
    /// Most lights of set H after clustering; `None`: no clustering.
    pub clusters: Option<usize>,
}

impl Default for DirectionalOptions {
    fn default() -> Self {
        Self {
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
        }
    }
}

/// Most shadow maps, beyond what any scene needs, and few enough that no product with their size overflows.
const MAX_SHADOW_MAPS: usize = 4096;
/// Most comparisons for a soft shadow: a pixel makes twice as many for every light, and a driver aborts a
/// pass that takes seconds.
const MAX_SOFT_SAMPLES: u32 = 256;

impl DirectionalOptions {
    /// Tiles along a side of the shadow atlas.
    pub(super) fn tiles_per_side(&self) -> u32 {
        (self.shadow_maps.max(1) as f64).sqrt().ceil() as u32
    }

    /// Refuses what a device with textures of up to `most_px` along a side cannot do, before anything is
    /// allocated.
    pub(in crate::render) fn check(&self, most_px: u32) -> Result<()> {
        if !(1..=MAX_LIGHTS).contains(&self.lights) {
            return Err(Error::usage(format!("{} lights; give 1 to {MAX_LIGHTS}", self.lights)));
        }
        if self.shadow_maps > MAX_SHADOW_MAPS || !(8..=most_px).contains(&self.shadow_map_px) {
            return Err(Error::usage(format!(
                "{} shadow maps of {1} x {1} texels; give at most {MAX_SHADOW_MAPS}, of 8 to {most_px} texels",
                self.shadow_maps, self.shadow_map_px
            )));
        }
        let atlas_px = u64::from(self.tiles_per_side()) * u64::from(self.shadow_map_px);
        if atlas_px > u64::from(most_px) {
            return Err(Error::usage(format!(
                "{} shadow maps of {1} x {1} texels need an atlas of {atlas_px} texels along a side; this \
                 device has {most_px}",
                self.shadow_maps, self.shadow_map_px
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
        if self.clusters == Some(0) {
            return Err(Error::usage("0 clusters; give 1 or more"));
        }
        Ok(())
    }
}
