use crate::image::{Stamp, luminance};
use serde::{Deserialize, Serialize};

/// The most lights of a list.
///
/// Relaxation measures Voronoi cells on 65,536 lattice points; more lights than a quarter of that would have
/// cells of fewer than four.
pub const MAX_LIGHTS: usize = 16_384;

/// One directional light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Light {
    /// Slot of the light: the same light from frame to frame.
    pub id: u32,
    /// Unit vector towards the light, world frame.
    pub direction: [f32; 3],
    /// RGB irradiance on a surface facing the light: the integral of radiance over its share of the map.
    pub irradiance: [f32; 3],
    /// RMS angle in radians of the light's share about its direction; 0 where it is unknown.
    pub spread_rad: f32,
}

impl Light {
    /// Luminous irradiance.
    #[inline]
    pub fn luminance(&self) -> f32 {
        luminance(self.irradiance)
    }
}

/// The product: the lights of one frame, in slot order, with their error.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightList {
    /// Time and place in the sequence.
    pub stamp: Stamp,
    /// Frames by which the filter delays the lights; 0 means that they are not filtered.
    pub filter_delay_frames: u32,
    /// How many of the lights are used, where that is chosen frame by frame; the others have no power, or
    /// fade for the length of the filter.
    pub chosen_lights: Option<u32>,
    /// RGB sum of the lights; before the filter also the power of the map (for equal-power lights in
    /// luminance only, see the sampler).
    pub power: [f64; 3],
    /// Relative RMS irradiance error over the sphere of normals against the map; after the filter against the
    /// equally filtered irradiances of the maps. `None` until it is measured.
    pub error: Option<f32>,
    /// The same error of the first `n` lights when the rest has joined them: pairs of `n` and error.
    pub prefix_errors: Vec<(u32, f32)>,
    /// Every slot, also at zero power.
    pub lights: Vec<Light>,
}

/// A list with the reference against which its error is measured: the output of the extractor, and both input
/// and output of the filter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferencedList {
    /// The list.
    pub list: LightList,
    /// Luminous irradiances of the map at the error estimator's normals; after the filter equally filtered.
    pub reference_irradiance: Vec<f32>,
}

impl ReferencedList {
    /// Copies `other` into the storage of this one; no allocation once the capacities suffice.
    pub fn copy_from(&mut self, other: &Self) {
        self.list.copy_from(&other.list);
        self.reference_irradiance.clone_from(&other.reference_irradiance);
    }
}

impl LightList {
    /// Copies `other` into the storage of this list; no allocation once the capacities suffice.
    pub fn copy_from(&mut self, other: &Self) {
        let Self { stamp, filter_delay_frames, chosen_lights, power, error, .. } = *other;
        (self.stamp, self.filter_delay_frames, self.chosen_lights) =
            (stamp, filter_delay_frames, chosen_lights);
        (self.power, self.error) = (power, error);
        self.prefix_errors.clone_from(&other.prefix_errors);
        self.lights.clone_from(&other.lights);
    }

    /// RGB sum of the lights, in f64.
    pub fn sum_of_lights(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for light in &self.lights {
            for channel in 0..3 {
                sum[channel] += f64::from(light.irradiance[channel]);
            }
        }
        sum
    }
}
