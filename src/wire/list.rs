//! Lists as JSON: version 1 of the object that files, streams and standard output have.

use super::limits::{LENGTH_TOLERANCE, MOST_IRRADIANCE, MOST_POWER};
use crate::error::{Error, Result, plain_words};
use lightcast_core::image::Stamp;
use lightcast_core::light::{Light, LightList, MAX_LIGHTS};
use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};
use std::io;

/// The keys that are written, in their order.
#[derive(Serialize)]
struct Written<'a> {
    version: u32,
    #[serde(flatten)]
    stamp: Stamp,
    filter_delay_frames: u32,
    unit: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    chosen_lights: Option<u32>,
    power: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<f32>,
    prefix_errors: &'a [(u32, f32)],
    lights: &'a [Light],
}

/// The keys that an object must have. Unknown keys are ignored, because later versions may have more. The
/// stamp's keys are listed here one by one because a flattened `Stamp` would make serde store the values of
/// all unknown keys.
#[derive(Deserialize)]
struct Read<S> {
    version: u32,
    sequence: u64,
    capture_time_ns: i64,
    lost_before: u64,
    frame_rate_hz: f64,
    #[serde(default)]
    filter_delay_frames: u32,
    chosen_lights: Option<u32>,
    power: Option<[f64; 3]>,
    error: Option<f32>,
    #[serde(default)]
    prefix_errors: Vec<(u32, f32)>,
    lights: Vec<Light>,
    stream: Option<S>,
}

/// Writes a list as one JSON object.
///
/// # Errors
/// Those of the writer.
pub fn write_list(list: &LightList, writer: impl io::Write) -> io::Result<()> {
    let LightList { stamp, filter_delay_frames, chosen_lights, power, error, prefix_errors, lights } = list;
    let written = Written {
        version: 1,
        stamp: *stamp,
        filter_delay_frames: *filter_delay_frames,
        unit: "relative",
        chosen_lights: *chosen_lights,
        power: *power,
        error: *error,
        prefix_errors,
        lights,
    };
    Ok(serde_json::to_writer(writer, &written)?)
}

/// Writes a list as one line of JSON.
///
/// # Errors
/// Those of the writer.
pub fn write_list_line(list: &LightList, mut writer: impl io::Write) -> io::Result<()> {
    write_list(list, &mut writer)?;
    writer.write_all(b"\n")
}

/// Reads `list` from a JSON object as [`write_list`] writes it; unknown keys are ignored. Without a `power`
/// that of the lights is used.
///
/// # Errors
/// With the column: invalid JSON, a missing key, another version; with the number of the light: directions
/// that are not unit vectors, irradiances that are negative, not finite or above 1e30; errors that are
/// negative or not finite. The list is then unchanged.
pub fn read_list(text: &[u8], list: &mut LightList) -> Result<()> {
    read_list_with::<IgnoredAny>(text, list).map(|_| ())
}

/// [`read_list`]; returns the value of the key `stream`, which holds the data that goes with a transmitted
/// list.
///
/// # Errors
/// Also when that value is not an `S`.
pub(super) fn read_list_with<S: DeserializeOwned>(text: &[u8], list: &mut LightList) -> Result<Option<S>> {
    let read: Read<S> = serde_json::from_slice(text).map_err(|error| {
        Error::failed("is no light list, one JSON object").because(plain_words(&error.to_string()))
    })?;
    let Read { version, sequence, capture_time_ns, lost_before, frame_rate_hz, .. } = read;
    let Read { filter_delay_frames, chosen_lights, power, error, prefix_errors, lights, stream, .. } = read;
    if version != 1 {
        return Err(Error::failed(format!("is of version {version}; this program reads version 1")));
    }
    if lights.len() > MAX_LIGHTS {
        return Err(Error::failed(format!("holds {} lights; at most {MAX_LIGHTS} are read", lights.len())));
    }
    for (number, light) in lights.iter().enumerate() {
        let length = light.direction.iter().map(|v| v * v).sum::<f32>().sqrt();
        let fault = if length.is_nan() || (length - 1.0).abs() > LENGTH_TOLERANCE {
            "direction is no unit vector"
        } else if !light.irradiance.iter().all(|v| (0.0..=MOST_IRRADIANCE).contains(v)) {
            "irradiance is not from 0 to 1e30"
        } else if !(0.0..=std::f32::consts::PI).contains(&light.spread_rad) {
            "spread_rad is no angle from 0 to pi"
        } else {
            continue;
        };
        let place = format!("light {number} (id {})", light.id);
        return Err(Error::failed(format!("its {fault}")).at(place));
    }
    if power.is_some_and(|power| !power.iter().all(|v| (0.0..=MOST_POWER).contains(v))) {
        return Err(Error::failed("its power is not from 0 to 1e36"));
    }
    if !prefix_errors.iter().map(|&(_, error)| error).chain(error).all(|v| (0.0..=f32::MAX).contains(&v)) {
        return Err(Error::failed("its error, or that of a prefix, is not from 0 to 3.4e38"));
    }
    let mut ids: Vec<u32> = lights.iter().map(|light| light.id).collect();
    ids.sort_unstable();
    if let Some(pair) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(Error::failed(format!("two lights have the id {}", pair[0])));
    }
    list.stamp = Stamp { sequence, capture_time_ns, lost_before, frame_rate_hz };
    (list.filter_delay_frames, list.chosen_lights, list.error) = (filter_delay_frames, chosen_lights, error);
    (list.prefix_errors, list.lights) = (prefix_errors, lights);
    list.power = power.unwrap_or_else(|| list.sum_of_lights());
    Ok(stream)
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
            error: Some(0.0031),
            prefix_errors: vec![(8, 0.05)],
            lights: vec![Light {
                id: 0,
                direction: [0.0, 1.0, 0.0],
                irradiance: [1.0, 2.0, 3.0],
                spread_rad: 0.04,
            }],
            ..LightList::default()
        };
        let mut line = Vec::new();
        write_list_line(&list, &mut line).unwrap();
        assert_eq!(
            String::from_utf8(line).unwrap(),
            "{\"version\":1,\"sequence\":17,\"capture_time_ns\":680000000,\"lost_before\":0,\"frame_rate_hz\":25.0,\
             \"filter_delay_frames\":4,\"unit\":\"relative\",\"power\":[1.0,2.0,3.0],\"error\":0.0031,\
             \"prefix_errors\":[[8,0.05]],\"lights\":[{\"id\":0,\"direction\":[0.0,1.0,0.0],\
             \"irradiance\":[1.0,2.0,3.0],\"spread_rad\":0.04}]}\n"
        );
    }
}
