mod file;

pub use file::{ListFile, MOST_IRRADIANCE, MOST_POWER};

use lightcast_core::image::{Stamp, luminance};
use serde::{Deserialize, Serialize};

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
    pub fn luminance(&self) -> f32 {
        luminance(self.irradiance)
    }
}

/// The product: the lights of one frame, in slot order, with their error.
///
/// Serialises to the version 1 JSON object; [`LightList::write_json_line`] writes it as one line.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LightList {
    version: u32,
    /// Time and place in the sequence.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Frames by which the filter delays the lights; 0 means that they are not filtered.
    pub filter_delay_frames: u32,
    unit: &'static str,
    /// How many of the lights are used, where that is chosen frame by frame; the others have no power, or fade for the length
    /// of the filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chosen_lights: Option<u32>,
    /// RGB sum of the lights; before the filter also the power of the map (for equal-power lights in luminance
    /// only, see the sampler).
    pub power: [f64; 3],
    /// Relative RMS irradiance error over the sphere of normals against the map; after the filter against the
    /// equally filtered irradiances of the maps.
    pub error: f32,
    /// The same error of the first `n` lights when the rest has joined them: pairs of `n` and error.
    pub prefix_errors: Vec<(u32, f32)>,
    /// Every slot, also at zero power.
    pub lights: Vec<Light>,
    /// Luminous irradiances of the map at the error estimator's normals: what the error is measured against.
    /// Not part of the message.
    #[serde(skip)]
    pub reference_irradiance: Vec<f32>,
}

impl Default for LightList {
    fn default() -> Self {
        Self {
            version: 1,
            stamp: Stamp::default(),
            filter_delay_frames: 0,
            unit: "relative",
            chosen_lights: None,
            power: [0.0; 3],
            error: 0.0,
            prefix_errors: Vec::new(),
            lights: Vec::new(),
            reference_irradiance: Vec::new(),
        }
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
        self.reference_irradiance.clone_from(&other.reference_irradiance);
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

    /// Writes the list as one JSON object.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_json(&self, writer: impl std::io::Write) -> std::io::Result<()> {
        Ok(serde_json::to_writer(writer, self)?)
    }

    /// Writes the list as one line of JSON.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_json_line(&self, mut writer: impl std::io::Write) -> std::io::Result<()> {
        self.write_json(&mut writer)?;
        writer.write_all(b"\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_is_the_version_1_contract() {
        let list = LightList {
            stamp: Stamp { sequence: 17, capture_time_ns: 680_000_000, lost_before: 0, frame_rate_hz: 25.0 },
            filter_delay_frames: 4,
            power: [1.0, 2.0, 3.0],
            error: 0.0031,
            prefix_errors: vec![(8, 0.05)],
            lights: vec![Light {
                id: 0,
                direction: [0.0, 1.0, 0.0],
                irradiance: [1.0, 2.0, 3.0],
                spread_rad: 0.04,
            }],
            reference_irradiance: vec![1.0],
            ..LightList::default()
        };
        let mut line = Vec::new();
        list.write_json_line(&mut line).unwrap();
        assert_eq!(
            String::from_utf8(line).unwrap(),
            "{\"version\":1,\"sequence\":17,\"capture_time_ns\":680000000,\"lost_before\":0,\"frame_rate_hz\":25.0,\
             \"filter_delay_frames\":4,\"unit\":\"relative\",\"power\":[1.0,2.0,3.0],\"error\":0.0031,\
             \"prefix_errors\":[[8,0.05]],\"lights\":[{\"id\":0,\"direction\":[0.0,1.0,0.0],\
             \"irradiance\":[1.0,2.0,3.0],\"spread_rad\":0.04}]}\n"
        );
    }
}
