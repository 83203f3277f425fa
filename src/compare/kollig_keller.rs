//! Lloyd's relaxation with a growing number of points: Kollig and Keller, *Efficient Illumination by High
//! Dynamic Range Images*, Eurographics Symposium on Rendering 2003.
//!
//! From the paper: a quadrature rule with one node for each Voronoi cell of the sphere, whose weight is the
//! map's integral over the cell. The nodes are relaxed, each to its cell's centre of mass, with the map's
//! radiance as mass. The set begins with one node and grows by new nodes next to that of the cell with the
//! highest total intensity, so that the relaxation does not end in a poor local minimum and the intensities
//! become similar.
//!
//! Chosen here: from 16 nodes on, an eighth of their number is added at once, next to those of the brightest
//! cells, where the paper adds one, so that the time grows with the number of lights little faster than the
//! time of one pass over the map. There are eight steps of relaxation after every growth and eight more at
//! the end. A new node is half of its cell's spread away from the old one, in directions rotated by the
//! golden angle. A cell with a single lit pixel is not split, and nodes with dark cells are moved next to
//! bright ones.

use glam::DVec3;
use lightcast_core::image::{PolarMap, PolarShape};
use lightcast_core::light::{Light, Voronoi};
use std::f64::consts::PI;

/// Number of nodes for each one that is added at once.
const NODES_PER_NEW_ONE: usize = 8;
const STEPS_PER_GROWTH: usize = 8;
const STEPS_AT_THE_END: usize = 8;
/// Consecutive growths that may leave dark cells dark: a new node next to one of two lamps may have neither
/// in its cell, whereas a third of a turn further it would have one of them.
const VAIN_GROWTHS: usize = 4;

/// Writes as many lights as there are `sites`. Their sum is the RGB power of the map.
///
/// The sites become the lights' directions; their initial values matter only where no cell can be split any
/// more, as on a map without light: then the unused sites are left unchanged.
pub(super) fn kollig_keller(
    map: &PolarMap,
    voronoi: &mut Voronoi,
    sites: &mut [[f32; 3]],
    lights: &mut Vec<Light>,
) {
    // A single site has all pixels; its initial direction matters only for a dark map.
    let (mut used, mut in_vain) = (1, 0);
    relax(voronoi, map, &mut sites[..used], lights);
    while used < sites.len() || lights.iter().any(is_dark) {
        let Some(grown) = grow(map.shape, sites, used, in_vain, lights) else {
            used = sites.len();
            break;
        };
        let dark = lights.iter().filter(|light| is_dark(light)).count();
        for _ in 0..STEPS_PER_GROWTH {
            relax(voronoi, map, &mut sites[..grown], lights);
        }
        let still_dark = lights.iter().filter(|light| is_dark(light)).count();
        in_vain = if grown > used || still_dark < dark { 0 } else { in_vain + 1 };
        used = grown;
        if in_vain == VAIN_GROWTHS {
            used = sites.len();
            break;
        }
    }
    for _ in 0..STEPS_AT_THE_END {
        relax(voronoi, map, &mut sites[..used], lights);
    }
}

/// One step of Lloyd's relaxation: computes the lights of the sites' cells, and moves the sites to the
/// lights' directions.
fn relax(voronoi: &mut Voronoi, map: &PolarMap, sites: &mut [[f32; 3]], lights: &mut Vec<Light>) {
    voronoi.refine(map, sites, lights);
    for (site, light) in sites.iter_mut().zip(lights) {
        *site = light.direction;
    }
}

fn is_dark(light: &Light) -> bool {
    light.luminance() == 0.0
}

/// Places new sites, and those of dark cells, next to the sites of the cells with the highest power, and
/// returns the number of sites then in use; `None` where no cell can be split. With every further growth in
/// vain, the new sites are rotated by the golden angle.
fn grow(
    shape: PolarShape,
    sites: &mut [[f32; 3]],
    used: usize,
    in_vain: usize,
    lights: &[Light],
) -> Option<usize> {
    let dark = lights.iter().enumerate().filter(|(_, light)| is_dark(light));
    let dark: Vec<usize> = dark.map(|(index, _)| index).collect();
    // Light from a single direction has a spread of exactly 0.
    let mut bright: Vec<&Light> =
        lights.iter().filter(|light| !is_dark(light) && light.spread_rad > 0.0).collect();
    bright.sort_by(|a, b| b.luminance().total_cmp(&a.luminance()));
    bright.truncate(dark.len() + (used / NODES_PER_NEW_ONE).max(1));
    // Closer than the next pixel a new site would have no pixels.
    let least_rad = 0.5 * shape.theta_max_rad() / shape.rows() as f64;
    let mut grown = None;
    let mut places = dark.into_iter().chain(used..sites.len());
    for light in bright {
        let Some(place) = places.next() else { break };
        let about = DVec3::from(light.direction.map(f64::from));
        let (east, north) = about.any_orthonormal_pair();
        let (sin, cos) = ((used + place + in_vain) as f64 * PI * (3.0 - 5f64.sqrt())).sin_cos();
        let away_rad = (0.5 * f64::from(light.spread_rad)).max(least_rad);
        let site = about * away_rad.cos() + (east * cos + north * sin) * away_rad.sin();
        sites[place] = site.as_vec3().normalize_or(glam::Vec3::Y).to_array();
        grown = Some(grown.unwrap_or(used).max(place + 1));
    }
    grown
}

#[cfg(test)]
mod tests;
