//! The sky: a smooth gradient, drifting clouds, a sun on a path, distant lamps, ground below the horizon.

use super::animation::{Flicker, Waypoint, along, is_on};
use super::emitter::{Detail, Emitter, check_radiance};
use super::noise::fractal_noise;
use crate::error::{Error, Place, Result};
use glam::DVec3;
use lightcast_core::math::angle_between;
use serde::Deserialize;

/// Radiance of the parts of a sky; colours are linear RGB.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sky {
    /// Radiance overhead.
    pub zenith: [f64; 3],
    /// Radiance just above the horizon.
    pub horizon: [f64; 3],
    /// Radiance below the horizon.
    pub ground: [f64; 3],
    /// `None`: no sun.
    pub sun: Option<Sun>,
    /// `None`: no clouds.
    pub clouds: Option<Clouds>,
    /// Lamps in front of everything else.
    pub lamp: Vec<FarLamp>,
}

impl Default for Sky {
    /// An empty, clear noon sky with radiance about 1 at the horizon.
    fn default() -> Self {
        Self {
            zenith: [0.12, 0.26, 0.6],
            horizon: [0.75, 0.88, 1.0],
            ground: [0.12, 0.1, 0.08],
            sun: None,
            clouds: None,
            lamp: Vec::new(),
        }
    }
}

/// The sun's disc and the glow around it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sun {
    /// Angular radius; by default the real sun's.
    #[serde(default = "sun_radius_deg")]
    pub radius_deg: f64,
    /// Radiance of the disc.
    pub radiance: [f64; 3],
    /// Radiance of the glow at the disc's edge; it falls by a factor of e every 12 degrees.
    #[serde(default)]
    pub glow: [f64; 3],
    /// Positions of the sun over time; at least one entry.
    pub path: Vec<Waypoint>,
}

fn sun_radius_deg() -> f64 {
    0.2666
}

/// Clouds: fractal noise on a plane overhead, cut at a threshold.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clouds {
    /// 0 for a clear sky, 1 for an overcast one.
    pub cover: f64,
    /// Size of the largest clouds, in heights of the cloud plane.
    #[serde(default = "one")]
    pub size: f64,
    /// Velocity along x and z in heights of the cloud plane per second.
    #[serde(default)]
    pub drift: [f64; 2],
    /// Radiance of the sunlit parts.
    pub radiance: [f64; 3],
    /// Seed of the clouds.
    #[serde(default)]
    pub seed: u64,
}

fn one() -> f64 {
    1.0
}

/// A distant disc that faces the camera.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FarLamp {
    /// From +X towards +Z.
    pub azimuth_deg: f64,
    /// Above the horizon.
    #[serde(alias = "altitude_deg")]
    pub elevation_deg: f64,
    /// Angular radius.
    pub radius_deg: f64,
    /// Radiance when on and not flickering.
    pub radiance: [f64; 3],
    /// Without it the lamp does not flicker.
    pub flicker: Option<Flicker>,
    /// On-times `[start, end)` in seconds; always on without any.
    #[serde(default)]
    pub on_s: Vec<[f64; 2]>,
}

/// Scale of the glow around the sun in degrees; approximately that of light haze.
const GLOW_DEG: f64 = 12.0;

/// Optical depth of the thickest cloud: the sun's disc keeps 1/400 of its radiance behind it.
const CLOUD_DEPTH: f64 = 6.0;

impl Sky {
    /// The sky at a time.
    pub fn at(&self, time_s: f64) -> SkyAt<'_> {
        let sun = self.sun.as_ref().map(|sun| {
            let (azimuth_deg, elevation_deg) = along(&sun.path, time_s);
            Emitter::far_disc(azimuth_deg, elevation_deg, sun.radius_deg, sun.radiance)
        });
        let lamps = self.lamp.iter().filter(|lamp| is_on(&lamp.on_s, time_s)).map(|lamp| {
            let factor = lamp.flicker.map_or(1.0, |flicker| flicker.factor(time_s));
            let radiance = lamp.radiance.map(|value| value * factor);
            Emitter::far_disc(lamp.azimuth_deg, lamp.elevation_deg, lamp.radius_deg, radiance)
        });
        SkyAt { sky: self, time_s, sun, lamps: lamps.collect() }
    }

    /// Errors name the key, below `sky`.
    pub(super) fn check(&self) -> Result<()> {
        for (key, radiance) in [("zenith", self.zenith), ("horizon", self.horizon), ("ground", self.ground)] {
            check_radiance(key, radiance)?;
        }
        if let Some(sun) = &self.sun {
            check_radiance("sun.radiance", sun.radiance)?;
            check_radiance("sun.glow", sun.glow)?;
            check_radius("sun", sun.radius_deg)?;
            if sun.path.is_empty() || !sun.path.is_sorted_by(|a, b| a.time_s < b.time_s) {
                return Err(Error::usage("needs entries that ascend in time_s").at(Place::key("sun.path")));
            }
            for (i, waypoint) in sun.path.iter().enumerate() {
                if !waypoint.time_s.is_finite() {
                    return Err(
                        Error::usage("must be finite").at(Place::key(format!("sun.path[{i}].time_s")))
                    );
                }
                check_place(&format!("sun.path[{i}]"), waypoint.azimuth_deg, waypoint.elevation_deg)?;
            }
        }
        if let Some(clouds) = &self.clouds {
            check_radiance("clouds.radiance", clouds.radiance)?;
            if !(0.0..=1.0).contains(&clouds.cover) {
                return Err(Error::usage("must lie between 0 and 1").at(Place::key("clouds.cover")));
            }
            if !(1e-3..=1e3).contains(&clouds.size) {
                return Err(Error::usage("must lie between 0.001 and 1000").at(Place::key("clouds.size")));
            }
            if !clouds.drift.iter().all(|speed| speed.abs() <= 1e3) {
                return Err(Error::usage("must lie between -1000 and 1000").at(Place::key("clouds.drift")));
            }
        }
        for (i, lamp) in self.lamp.iter().enumerate() {
            let key = format!("lamp[{i}]");
            check_radiance(&format!("{key}.radiance"), lamp.radiance)?;
            check_radius(&key, lamp.radius_deg)?;
            check_place(&key, lamp.azimuth_deg, lamp.elevation_deg)?;
            lamp.flicker
                .map_or(Ok(()), |flicker| flicker.check())
                .map_err(|error| error.at(Place::key(&key)))?;
        }
        Ok(())
    }
}

fn check_radius(key: &str, radius_deg: f64) -> Result<()> {
    if (1e-3..=45.0).contains(&radius_deg) {
        Ok(())
    } else {
        Err(Error::usage("must lie between 0.001 and 45").at(Place::key(format!("{key}.radius_deg"))))
    }
}

fn check_place(key: &str, azimuth_deg: f64, elevation_deg: f64) -> Result<()> {
    if azimuth_deg.is_finite() && (-90.0..=90.0).contains(&elevation_deg) {
        Ok(())
    } else {
        Err(Error::usage("needs a finite azimuth_deg and an elevation_deg between -90 and 90")
            .at(Place::key(key)))
    }
}

/// A sky at one time.
pub struct SkyAt<'a> {
    sky: &'a Sky,
    time_s: f64,
    sun: Option<Emitter>,
    lamps: Vec<Emitter>,
}

impl SkyAt<'_> {
    /// Radiance from a direction (unit vector).
    pub fn radiance(&self, direction: DVec3) -> [f64; 3] {
        let sky = self.sky;
        // The horizon is blurred over one degree: a hard one would alias.
        let above = smooth_step(-0.01, 0.01, direction.y);
        let height = direction.y.max(0.0);
        let mut radiance = mix(sky.zenith, sky.horizon, (1.0 - height).powi(4));
        let cloud = if above > 0.0 { self.cloud_density(direction) } else { 0.0 };
        let mut toward_sun = 0.0;
        if let (Some(sun), Some(options)) = (&self.sun, &sky.sun) {
            toward_sun = (-angle_between(direction, sun.centre).to_degrees() / GLOW_DEG).exp();
            for channel in 0..3 {
                radiance[channel] += options.glow[channel] * toward_sun;
            }
        }
        if let Some(clouds) = &sky.clouds {
            radiance =
                mix(radiance, self.cloud_radiance(clouds, direction, cloud, toward_sun), opacity(cloud));
        }
        if let Some(sun) = &self.sun {
            let disc = sun.profile(direction) * (-CLOUD_DEPTH * cloud).exp();
            for channel in 0..3 {
                radiance[channel] += sun.radiance[channel] * disc;
            }
        }
        radiance = mix(sky.ground, radiance, above);
        for lamp in &self.lamps {
            radiance = mix(radiance, lamp.radiance, lamp.profile(direction));
        }
        radiance
    }

    /// Details at the sun and the lamps.
    pub fn details(&self) -> impl Iterator<Item = Detail> {
        self.sun.iter().chain(&self.lamps).map(Emitter::detail)
    }

    /// 0 in clear sky to 1 in the thickest cloud.
    fn cloud_density(&self, direction: DVec3) -> f64 {
        let Some(clouds) = &self.sky.clouds else { return 0.0 };
        // The plane bends down to the horizon (0.15); otherwise clouds there would be finer than any pixel.
        let scale = 1.0 / (clouds.size * (direction.y.max(0.0) + 0.15));
        let shift = clouds.drift.map(|speed| -speed * self.time_s / clouds.size);
        let value = fractal_noise(direction.x * scale, direction.z * scale, shift, clouds.seed);
        // Five octaves of noise lie between 0.2 and 0.8 almost everywhere.
        let threshold = 0.8 - 0.6 * clouds.cover;
        smooth_step(threshold - 0.05, threshold + 0.2, value)
    }

    /// Bright where little cloud lies in front of the sun, silver near the sun, grey elsewhere.
    fn cloud_radiance(&self, clouds: &Clouds, direction: DVec3, density: f64, toward_sun: f64) -> [f64; 3] {
        let lit = match &self.sun {
            Some(sun) if density > 0.0 => {
                let nearer = (direction + sun.centre * 0.06).normalize_or(direction);
                (-2.0 * self.cloud_density(nearer)).exp()
            }
            _ => 1.0,
        };
        let brightness = (0.35 + 0.65 * lit) * (1.0 - 0.4 * density) * (1.0 + 2.0 * toward_sun);
        clouds.radiance.map(|value| value * brightness)
    }
}

fn opacity(density: f64) -> f64 {
    1.0 - (-4.0 * density).exp()
}

fn mix(a: [f64; 3], b: [f64; 3], t: f64) -> [f64; 3] {
    std::array::from_fn(|channel| a[channel] + (b[channel] - a[channel]) * t)
}

fn smooth_step(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::math::{direction, fibonacci_sphere};

    fn cloudy() -> Sky {
        let path = vec![Waypoint { time_s: 0.0, azimuth_deg: 20.0, elevation_deg: 40.0 }];
        let sun = Sun { radius_deg: 0.2666, radiance: [1e5; 3], glow: [0.5; 3], path };
        let clouds = Clouds { cover: 0.5, size: 1.0, drift: [0.1, 0.0], radiance: [1.0; 3], seed: 1 };
        Sky { sun: Some(sun), clouds: Some(clouds), ..Sky::default() }
    }

    #[test]
    fn radiance_is_finite_and_not_negative_everywhere() {
        for time_s in [0.0, 1.0, 1e4] {
            let sky = cloudy();
            let at = sky.at(time_s);
            for direction in fibonacci_sphere(5000).chain([DVec3::Y, DVec3::NEG_Y, DVec3::X, DVec3::NEG_Z]) {
                assert!(at.radiance(direction).iter().all(|v| v.is_finite() && *v >= 0.0), "{direction}");
            }
        }
    }

    #[test]
    fn a_clear_sun_has_its_radiance_and_a_lamp_stands_before_it() {
        let mut sky = cloudy();
        sky.clouds = None;
        let sun = direction(50f64.to_radians(), 20f64.to_radians());
        assert!((sky.at(0.0).radiance(sun)[0] / 1e5 - 1.0).abs() < 1e-4);
        sky.lamp.push(FarLamp {
            azimuth_deg: 20.0,
            elevation_deg: 40.0,
            radius_deg: 3.0,
            radiance: [5.0, 1.0, 0.5],
            flicker: None,
            on_s: vec![[1.0, 2.0]],
        });
        assert_eq!(sky.at(1.5).radiance(sun), [5.0, 1.0, 0.5]);
        assert!(sky.at(2.5).radiance(sun)[0] > 9e4);
        assert_eq!(sky.at(1.5).details().count(), 2);
    }

    #[test]
    fn clouds_cover_more_as_they_are_told_and_drift() {
        let mut sky = cloudy();
        let share = |sky: &Sky, time_s: f64| {
            let at = sky.at(time_s);
            let up: Vec<DVec3> = fibonacci_sphere(4000).filter(|d| d.y > 0.3).collect();
            up.iter().filter(|d| at.cloud_density(**d) > 0.3).count() as f64 / up.len() as f64
        };
        let mut cover = |value| {
            if let Some(clouds) = &mut sky.clouds {
                clouds.cover = value;
            }
            share(&sky, 0.0)
        };
        let shares = [cover(0.0), cover(0.4), cover(0.7), cover(1.0)];
        assert!(shares[0] < 0.02 && shares[3] > 0.95, "{shares:?}");
        assert!(shares.is_sorted(), "{shares:?}");
        let sky = cloudy();
        let up = direction(0.4, 1.0);
        let values: Vec<f64> = (0..50).map(|t| sky.at(f64::from(t)).cloud_density(up)).collect();
        assert!(values.iter().any(|v| *v > 0.5) && values.iter().any(|v| *v < 0.1), "{values:?}");
    }
}
