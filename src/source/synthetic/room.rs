//! A box seen from inside: textured walls, lamps on them, and the light of the lamps on the walls.

use super::animation::{Flicker, is_on};
use super::emitter::{Detail, Emitter, Shape, check_radiance};
use super::noise::{fractal_noise, hash};
use crate::error::{Error, Place, Result};
use glam::DVec3;
use serde::Deserialize;
use std::f64::consts::PI;

/// A room; the camera is the origin of the scene's frame.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Room {
    /// Inner size along x, y (up) and z in metres.
    pub size_m: [f64; 3],
    /// The camera's position, measured from the corner where x, y and z are least.
    pub camera_m: [f64; 3],
    /// Irradiance that every wall receives besides the lamps' light.
    pub ambient: [f64; 3],
    /// Mean reflectance of the walls.
    pub albedo: [f64; 3],
    /// Side of the squares on the walls in metres.
    pub tile_m: f64,
    /// Seed of the texture.
    pub seed: u64,
    /// Lamps on walls.
    pub lamp: Vec<WallLamp>,
}

impl Default for Room {
    /// A dim room of 6 x 3 x 5 m without lamps, the camera at its centre.
    fn default() -> Self {
        Self {
            size_m: [6.0, 3.0, 5.0],
            camera_m: [3.0, 1.5, 2.5],
            ambient: [0.1; 3],
            albedo: [0.6, 0.55, 0.5],
            tile_m: 0.5,
            seed: 0,
            lamp: Vec::new(),
        }
    }
}

/// One of the six walls, by its outward axis.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
pub enum Wall {
    /// Towards -X.
    #[serde(rename = "-x")]
    NegX,
    /// Towards +X.
    #[serde(rename = "+x")]
    PosX,
    /// The floor.
    #[serde(rename = "floor")]
    Floor,
    /// The ceiling.
    #[serde(rename = "ceiling")]
    Ceiling,
    /// Towards -Z.
    #[serde(rename = "-z")]
    NegZ,
    /// Towards +Z.
    #[serde(rename = "+z")]
    PosZ,
}

impl Wall {
    /// Axis (0 to 2), and whether the wall is at its positive end.
    fn axis(self) -> (usize, bool) {
        match self {
            Self::NegX => (0, false),
            Self::PosX => (0, true),
            Self::Floor => (1, false),
            Self::Ceiling => (1, true),
            Self::NegZ => (2, false),
            Self::PosZ => (2, true),
        }
    }
}

/// A lamp flush with a wall: a rectangle by `size_m` or a disc by `radius_m`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WallLamp {
    /// The wall on which it is mounted.
    pub wall: Wall,
    /// Its centre: the two coordinates along the wall, in the order x, y, z, from the room's corner.
    pub centre_m: [f64; 2],
    /// Full size of a rectangle along the same two coordinates.
    pub size_m: Option<[f64; 2]>,
    /// Radius of a disc.
    pub radius_m: Option<f64>,
    /// Radiance when on and not flickering.
    pub radiance: [f64; 3],
    /// Without it the lamp does not flicker.
    pub flicker: Option<Flicker>,
    /// On-times `[start, end)` in seconds; always on without any.
    #[serde(default)]
    pub on_s: Vec<[f64; 2]>,
}

impl Room {
    /// The room at a time.
    pub fn at(&self, time_s: f64) -> RoomAt<'_> {
        let on = self.lamp.iter().filter(|lamp| is_on(&lamp.on_s, time_s));
        let lamps = on.map(|lamp| (lamp.wall, self.emitter(lamp, time_s)));
        RoomAt { room: self, lamps: lamps.collect() }
    }

    fn emitter(&self, lamp: &WallLamp, time_s: f64) -> Emitter {
        let (axis, far) = lamp.wall.axis();
        let free = free_axes(axis);
        let (half, shape) = match (lamp.size_m, lamp.radius_m) {
            (Some(size), _) => (size.map(|side| 0.5 * side), Shape::Rectangle),
            (None, radius) => ([radius.unwrap_or_default(); 2], Shape::Disc),
        };
        let mut centre = [0.0; 3];
        centre[axis] = if far { self.size_m[axis] } else { 0.0 };
        centre[free[0]] = lamp.centre_m[0];
        centre[free[1]] = lamp.centre_m[1];
        let factor = lamp.flicker.map_or(1.0, |flicker| flicker.factor(time_s));
        Emitter {
            centre: DVec3::from(centre) - DVec3::from(self.camera_m),
            half_u: unit(free[0]) * half[0],
            half_v: unit(free[1]) * half[1],
            shape,
            radiance: lamp.radiance.map(|value| value * factor),
        }
    }

    /// Errors name the key, below `room`.
    pub(super) fn check(&self) -> Result<()> {
        check_radiance("ambient", self.ambient)?;
        check_radiance("albedo", self.albedo)?;
        for axis in 0..3 {
            let inside = self.camera_m[axis] > 0.0 && self.camera_m[axis] < self.size_m[axis];
            if !inside || self.size_m[axis] > 1e6 {
                return Err(
                    Error::usage("must lie inside room.size_m, that at most 1e6").at(Place::key("camera_m"))
                );
            }
        }
        if !(1e-6..=1e6).contains(&self.tile_m) {
            return Err(Error::usage("must lie between 1e-6 and 1e6").at(Place::key("tile_m")));
        }
        for (i, lamp) in self.lamp.iter().enumerate() {
            let key = format!("lamp[{i}]");
            check_radiance(&format!("{key}.radiance"), lamp.radiance)?;
            let sides = match (lamp.size_m, lamp.radius_m) {
                (Some(size), None) => size,
                (None, Some(radius)) => [2.0 * radius; 2],
                _ => {
                    return Err(Error::usage("needs either size_m (a rectangle) or radius_m (a disc)")
                        .at(Place::key(&key)));
                }
            };
            let free = free_axes(lamp.wall.axis().0);
            for (axis, (side, centre)) in free.into_iter().zip(sides.into_iter().zip(lamp.centre_m)) {
                let within = centre - 0.5 * side >= 0.0 && centre + 0.5 * side <= self.size_m[axis];
                if !(side > 1e-6 && within) {
                    return Err(Error::usage("must lie within its wall and not be smaller than 1e-6 m")
                        .at(Place::key(&key)));
                }
            }
            lamp.flicker
                .map_or(Ok(()), |flicker| flicker.check())
                .map_err(|error| error.at(Place::key(&key)))?;
        }
        Ok(())
    }
}

/// A room at one time.
pub struct RoomAt<'a> {
    room: &'a Room,
    lamps: Vec<(Wall, Emitter)>,
}

impl RoomAt<'_> {
    /// Radiance from a direction (unit vector).
    pub fn radiance(&self, direction: DVec3) -> [f64; 3] {
        let (axis, far, point) = self.hit(direction);
        let mut radiance = self.wall_radiance(axis, far, point);
        for (wall, lamp) in &self.lamps {
            if wall.axis() == (axis, far) {
                let share = lamp.profile(direction);
                for channel in 0..3 {
                    radiance[channel] += (lamp.radiance[channel] - radiance[channel]) * share;
                }
            }
        }
        radiance
    }

    /// Details at the lamps that are on.
    pub fn details(&self) -> impl Iterator<Item = Detail> {
        self.lamps.iter().map(|(_, lamp)| lamp.detail())
    }

    /// The wall that a ray from the camera meets, and the point, relative to the camera.
    fn hit(&self, direction: DVec3) -> (usize, bool, DVec3) {
        let room = self.room;
        let (mut nearest, mut axis, mut far) = (f64::INFINITY, 1, true);
        for candidate in 0..3 {
            let forward = direction[candidate] > 0.0;
            let distance_m = if forward {
                room.size_m[candidate] - room.camera_m[candidate]
            } else {
                room.camera_m[candidate]
            };
            // A ray parallel to the wall gives infinity, which is never the minimum.
            let along = distance_m / direction[candidate].abs();
            if along < nearest {
                (nearest, axis, far) = (along, candidate, forward);
            }
        }
        (axis, far, direction * nearest)
    }

    /// A Lambertian wall under the ambient light and the lamps, each approximated as a point with a cosine
    /// lobe: this suffices for walls that brighten when a lamp does.
    fn wall_radiance(&self, axis: usize, far: bool, point: DVec3) -> [f64; 3] {
        let room = self.room;
        let inward = if far { -unit(axis) } else { unit(axis) };
        let mut irradiance = room.ambient;
        for (wall, lamp) in &self.lamps {
            let (lamp_axis, lamp_far) = wall.axis();
            let lamp_inward = if lamp_far { -unit(lamp_axis) } else { unit(lamp_axis) };
            let to_lamp = lamp.centre - point;
            let cosines = to_lamp.dot(inward).max(0.0) * (-to_lamp.dot(lamp_inward)).max(0.0);
            let area = lamp.area();
            // The distance is at least the size of the lamp: nearer, the lamp is not a point.
            let distance_2 = to_lamp.length_squared().max(area);
            for channel in 0..3 {
                irradiance[channel] += lamp.radiance[channel] * area * cosines / (distance_2 * distance_2);
            }
        }
        let texture = self.texture(axis, far, point + DVec3::from(room.camera_m));
        std::array::from_fn(|channel| irradiance[channel] * room.albedo[channel] * texture / PI)
    }

    /// A factor between 0.6 and 1.4: squares of two tones, modulated by fractal noise.
    fn texture(&self, axis: usize, far: bool, point_m: DVec3) -> f64 {
        let [i, j] = free_axes(axis);
        let (a, b) = (point_m[i] / self.room.tile_m, point_m[j] / self.room.tile_m);
        let dark = (a.floor() + b.floor()).rem_euclid(2.0) > 0.5;
        let seed = hash(self.room.seed ^ hash(axis as u64 * 2 + u64::from(far)));
        let tone = if dark { 0.8 } else { 1.2 };
        tone + 0.4 * (fractal_noise(a * 1.7, b * 1.7, [0.0; 2], seed) - 0.5)
    }
}

fn free_axes(axis: usize) -> [usize; 2] {
    match axis {
        0 => [1, 2],
        1 => [0, 2],
        _ => [0, 1],
    }
}

fn unit(axis: usize) -> DVec3 {
    DVec3::AXES[axis]
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::math::fibonacci_sphere;

    fn lamp(wall: Wall, centre_m: [f64; 2], size_m: [f64; 2]) -> WallLamp {
        let radiance = [100.0, 90.0, 70.0];
        WallLamp {
            wall,
            centre_m,
            size_m: Some(size_m),
            radius_m: None,
            radiance,
            flicker: None,
            on_s: vec![],
        }
    }

    #[test]
    fn every_direction_meets_a_wall_of_the_room() {
        let room = Room { camera_m: [1.0, 0.5, 4.0], ..Room::default() };
        let at = room.at(0.0);
        for direction in fibonacci_sphere(2000).chain(DVec3::AXES).chain([DVec3::NEG_X, DVec3::NEG_Y]) {
            let (axis, far, point) = at.hit(direction);
            let point = point + DVec3::from(room.camera_m);
            for i in 0..3 {
                assert!((-1e-9..=room.size_m[i] + 1e-9).contains(&point[i]), "{direction}: {point}");
            }
            assert!((point[axis] - if far { room.size_m[axis] } else { 0.0 }).abs() < 1e-9);
            assert!(at.radiance(direction).iter().all(|v| v.is_finite() && *v > 0.0));
        }
    }

    #[test]
    fn a_ceiling_lamp_shines_overhead_and_lights_the_floor() {
        let mut room = Room { lamp: vec![lamp(Wall::Ceiling, [3.0, 2.5], [1.2, 0.3])], ..Room::default() };
        room.lamp[0].on_s = vec![[1.0, 2.0]];
        let (off, on) = (room.at(0.5), room.at(1.5));
        assert_eq!(on.radiance(DVec3::Y), [100.0, 90.0, 70.0]);
        assert!(off.radiance(DVec3::Y)[0] < 1.0);
        let (dark, lit) = (off.radiance(DVec3::NEG_Y), on.radiance(DVec3::NEG_Y));
        // Directly below at 3 m: E = L A / d^2 in addition to the ambient 0.1.
        let expected = (0.1 + 100.0 * 0.36 / 9.0) / 0.1;
        assert!((lit[0] / dark[0] / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn lamps_beyond_their_wall_are_refused() {
        let room = |lamp| Room { lamp: vec![lamp], ..Room::default() };
        assert!(room(lamp(Wall::PosX, [1.5, 2.5], [1.0, 1.0])).check().is_ok());
        assert!(room(lamp(Wall::PosX, [2.8, 2.5], [1.0, 1.0])).check().is_err());
        let mut both = lamp(Wall::PosX, [1.5, 2.5], [1.0, 1.0]);
        both.radius_m = Some(0.5);
        assert!(room(both).check().is_err());
    }
}
