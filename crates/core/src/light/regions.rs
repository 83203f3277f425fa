//! Angular regions: the lights that can matter to a normal or to a cone of directions, by one table look-up
//! (Havran et al. 2005, sections 4.1, 4.2 and 5; METHODS section 8).
//!
//! The sphere of directions is a cube map whose every cell belongs to the nearest of a few hundred centres. A
//! region consists of the cells of one centre, and its *reach* is the angle from the centre to the farthest
//! direction in them. The lights that a direction of the region needs lie within the reach plus an angle: a
//! right angle for the lights that a normal sees, gamma/2 for the lights of a cone of half-angle gamma/2. The
//! paper has one number, a/2, for the reach of all regions; each region's own is smaller, so that fewer
//! lights are kept and none that is needed is missing.
//!
//! A region's list keeps the order of the lights, so that its beginning is as progressive as that of the
//! whole list (observation 1 of the paper), and the list may be truncated.

use super::{Light, MAX_LIGHTS};
use crate::image::luminance_f64;
use crate::math::{angle_between, cube_cell, cube_cell_solid_angle, cube_direction, fibonacci_sphere};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// Regions for normals: of evenly spread lights a list holds 59 %, and no number of regions could give less
/// than 50 %.
const NORMAL_REGIONS: usize = 200;
/// The most regions, 4.5 degrees apart: the time to build the table grows with the square of their number.
const MAX_REGIONS: usize = 2048;
/// Cells for each region: the finer the cells, the smaller the reach.
const CELLS_PER_REGION: f64 = 64.0;

/// Added to every reach: rounding in f32, also that of a GPU's division, moves the border of a cell by less
/// than half of this.
const REACH_SLACK_RAD: f64 = 1e-6;
/// Taken off the least dot product: products of three terms in f32 are off by less than 3e-7, centres and
/// light directions as rounded to f32 move them by less than 2e-7.
const DOT_SLACK: f64 = 1e-6;
/// Least dot product where every light belongs to the region: below that of any two unit vectors.
const EVERYTHING: f32 = -2.0;

/// Regions that cover the sphere, with the table that finds them.
#[derive(Clone, Debug)]
pub struct Regions {
    side: u32,
    table: Vec<u32>,
    caps: Vec<[f32; 4]>,
    reaches_rad: Vec<f64>,
    solid_angles_sr: Vec<f64>,
}

/// The lights of every region: indices into the list that was assigned.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RegionLists {
    /// Number of indices that every region has room for.
    pub capacity: usize,
    /// Region-major: those of region r start at `r capacity`. Entries beyond those that a region keeps hold
    /// `u32::MAX`.
    pub indices: Vec<u32>,
    /// Number of lights with power within each region; it keeps the first `capacity` of them.
    pub within: Vec<u32>,
    /// Factor by which the kept lights of each region must be multiplied, so that their luminance is that of
    /// all lights within it; 1 where none was dropped.
    pub factors: Vec<f32>,
}

impl RegionLists {
    /// Indices of the lights that a region keeps, in the order of the list.
    pub fn kept(&self, region: usize) -> &[u32] {
        let count = self.capacity.min(self.within[region] as usize);
        &self.indices[region * self.capacity..][..count]
    }
}

impl Regions {
    /// Regions about `centre_count` spherical Fibonacci points (at least 1 and at most 2048 are made), for
    /// lights within `extra_rad` of any of their directions. Negative angles and NaN count as 0.
    pub fn new(centre_count: usize, extra_rad: f64) -> Self {
        let count = centre_count.clamp(1, MAX_REGIONS);
        let side = (count as f64 * CELLS_PER_REGION / 6.0).sqrt().ceil() as u32;
        let centres: Vec<DVec3> = fibonacci_sphere(count).collect();
        let mut table = Vec::with_capacity(6 * (side * side) as usize);
        let (mut reaches_rad, mut solid_angles_sr) = (vec![0f64; count], vec![0.0; count]);
        for face in 0..6 {
            for row in 0..side {
                for column in 0..side {
                    let place = |i, j| cube_direction(face, f64::from(row) + i, f64::from(column) + j, side);
                    let region = nearest(&centres, place(0.5, 0.5));
                    table.push(region as u32);
                    solid_angles_sr[region] += cube_cell_solid_angle(row, column, side);
                    for (i, j) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)] {
                        let corner_rad = angle_between(centres[region], place(i, j));
                        reaches_rad[region] = reaches_rad[region].max(corner_rad);
                    }
                }
            }
        }
        for reach_rad in &mut reaches_rad {
            // Directions within r of a centre form a cone that is convex for r up to a right angle. The
            // directions of a cell are sums of those of its corners with weights that are not negative, so
            // that such a cone holds the cell where it holds the corners. Beyond a right angle the corners
            // give no bound.
            *reach_rad = if *reach_rad < FRAC_PI_2 { *reach_rad + REACH_SLACK_RAD } else { PI };
        }
        let caps = centres.iter().zip(&reaches_rad);
        let caps = caps.map(|(centre, reach_rad)| {
            let [x, y, z] = centre.as_vec3().to_array();
            let angle_rad = reach_rad + extra_rad.max(0.0);
            [x, y, z, if angle_rad < PI { (angle_rad.cos() - DOT_SLACK) as f32 } else { EVERYTHING }]
        });
        Self { side, caps: caps.collect(), table, reaches_rad, solid_angles_sr }
    }

    /// 200 regions for the lights that a normal sees (METHODS' H).
    pub fn for_normals() -> Self {
        Self::new(NORMAL_REGIONS, FRAC_PI_2)
    }

    /// Regions for the lights (METHODS' L) in cones of half-angle `gamma_rad / 2`, with centres about gamma
    /// apart; for a gamma below 4.5 degrees they are farther apart than that, and the lists longer.
    pub fn for_cones(gamma_rad: f64) -> Self {
        // A centre's share of the sphere is about gamma squared. NaN makes the most regions, each with its
        // own lights.
        let gamma_rad = gamma_rad.max(0.0);
        let count = 4.0 * PI / (gamma_rad * gamma_rad);
        Self::new(count.ceil() as usize, 0.5 * gamma_rad)
    }

    /// Number of regions.
    pub fn count(&self) -> usize {
        self.caps.len()
    }

    /// Cells along the side of a face of the table.
    pub fn side(&self) -> u32 {
        self.side
    }

    /// The region of every cell, `6 side^2` of them in the order of [`cube_cell`].
    pub fn table(&self) -> &[u32] {
        &self.table
    }

    /// Centre (unit vector) of every region and the least dot product with it of the directions of its
    /// lights: a light towards l belongs to the region if `x l.x + y l.y + z l.z >= w`, in f32. The bound is
    /// rounded down by enough that neither rounding of the product nor fused operations lose a light; -2
    /// stands for every light.
    pub fn caps(&self) -> &[[f32; 4]] {
        &self.caps
    }

    /// Angle in radians from a region's centre to the farthest direction that the table gives to it.
    pub fn reach_rad(&self, region: usize) -> f64 {
        self.reaches_rad[region]
    }

    /// Index in the table of a vector of any length, see [`cube_cell`].
    fn table_index(&self, direction: [f32; 3]) -> usize {
        cube_cell(direction, self.side) as usize
    }

    /// The region of a vector of any length.
    pub fn region(&self, direction: [f32; 3]) -> usize {
        self.table[self.table_index(direction)] as usize
    }

    /// Lists for every region the lights with power (any channel above 0) that belong to it, in the order of
    /// `lights`, at most `capacity` of them. Nothing is allocated once `lists` has held as many.
    ///
    /// # Panics
    /// If `capacity` is above [`MAX_LIGHTS`].
    pub fn assign(&self, lights: &[Light], capacity: usize, lists: &mut RegionLists) {
        assert!(capacity <= MAX_LIGHTS, "a capacity of {capacity}, above that of any list");
        lists.capacity = capacity;
        lists.indices.clear();
        lists.indices.resize(self.count() * capacity, u32::MAX);
        lists.within.clear();
        lists.factors.clear();
        for (region, &[x, y, z, least]) in self.caps.iter().enumerate() {
            let places = &mut lists.indices[region * capacity..][..capacity];
            let (mut within, mut kept, mut all) = (0, 0.0, 0.0);
            for (index, light) in lights.iter().enumerate() {
                let d = light.direction;
                let dot = x * d[0] + y * d[1] + z * d[2];
                if dot >= least && light.irradiance.iter().any(|&v| v > 0.0) {
                    all += luminance_f64(light.irradiance.map(f64::from));
                    if let Some(place) = places.get_mut(within) {
                        *place = index as u32;
                        kept = all;
                    }
                    within += 1;
                }
            }
            lists.within.push(within as u32);
            // An infinite factor would make a subnormal light far too bright, and one of 0 NaN.
            let factor = if kept > 0.0 { (all / kept).min(f64::from(f32::MAX)) } else { 1.0 };
            lists.factors.push(factor as f32);
        }
    }

    /// Number of lights that a direction's region keeps, as the mean over all directions. The number of
    /// lights divided by this is the gain of culling, at most 2 for normals.
    pub fn mean_lights(&self, lists: &RegionLists) -> f64 {
        let regions = self.solid_angles_sr.iter().enumerate();
        regions.map(|(region, sr)| sr * lists.kept(region).len() as f64).sum::<f64>() / (4.0 * PI)
    }
}

/// Index of the centre with the largest dot product; the first of equals.
fn nearest(centres: &[DVec3], direction: DVec3) -> usize {
    let mut best = (f64::NEG_INFINITY, 0);
    for (index, centre) in centres.iter().enumerate() {
        let dot = centre.dot(direction);
        if dot > best.0 {
            best = (dot, index);
        }
    }
    best.1
}

#[cfg(test)]
mod tests;
