//! Clusters of lights with similar directions: fewer shadow maps for a few strong sources (Havran et al.
//! 2005, section 4.3; METHODS section 8).

use super::Light;
use super::refine::Share;

/// The paper's c_f, 1.8 to 1.9: by how much wider than its share of the hemisphere a cluster has to be
/// because discs do not tile.
const COVERING_FACTOR: f64 = 1.85;

/// Index of the cluster of a light that has none.
const NO_CLUSTER: u32 = u32::MAX;

/// Joins `lights` with similar directions into at most `most` lights.
///
/// In the order of the list, the first light that has no cluster yet founds one and gathers all others
/// without one whose direction is within `epsilon = 1.85 asin(sqrt(2 / most))` of its own: the angle at which
/// `most` clusters cover a hemisphere (166 degrees for a `most` of 1 and 2, where the sine would pass 1). If
/// the lights cover more than a hemisphere or lie unfavourably, some may be left over when there are `most`
/// clusters; those join the cluster whose founder is nearest, the first of equally near ones. Which lights
/// found clusters depends on their order alone, not on their powers; the order is stable in time, and so are
/// the clusters.
///
/// A cluster becomes one light: powers add, direction and spread are the flux-weighted ones of
/// [`prefix`](super::prefix()), and the `id` is that of the founder. A cluster of one is that light bit for
/// bit. Lights without power (no channel above 0) have no cluster. Lights are joined by angle even where
/// there are no more than `most` of them, so that a growing budget never changes the picture abruptly. A
/// `most` of 0 gives no lights.
///
/// `clusters` receives the lights in the order of their founders, `places` receives for each of `lights` its
/// cluster's index, `u32::MAX` for none. Both are the caller's storage; nothing else is allocated.
///
/// The paper searches with a tree. This compares every founder with every light: 0.02 ms for 300 lights and
/// 72 clusters, a fiftieth of the published time (`make bench`), so that a tree would gain nothing.
pub fn cluster(lights: &[Light], most: usize, clusters: &mut Vec<Light>, places: &mut Vec<u32>) {
    clusters.clear();
    places.clear();
    places.resize(lights.len(), NO_CLUSTER);
    if most == 0 {
        return;
    }
    let sine = (2.0 / most as f64).sqrt().min(1.0);
    let least_dot = (COVERING_FACTOR * sine.asin()).cos() as f32;
    for (index, founder) in lights.iter().enumerate() {
        if places[index] != NO_CLUSTER || !has_power(founder) {
            continue;
        }
        if clusters.len() == most {
            places[index] = nearest(clusters, founder.direction);
            continue;
        }
        let place = clusters.len() as u32;
        clusters.push(*founder);
        places[index] = place;
        for (light, other) in lights.iter().zip(places.iter_mut()).skip(index + 1) {
            if *other == NO_CLUSTER
                && dot(founder.direction, light.direction) >= least_dot
                && has_power(light)
            {
                *other = place;
            }
        }
    }
    // Up to here each cluster equals its founder, because all other lights are compared with the founders'
    // directions.
    for (place, cluster) in clusters.iter_mut().enumerate() {
        let (mut share, mut count) = (Share::default(), 0);
        for (light, _) in lights.iter().zip(places.iter()).filter(|&(_, &other)| other == place as u32) {
            share.add(&Share::of(light));
            count += 1;
        }
        if count > 1 {
            *cluster = share.light(cluster.id, cluster.direction);
        }
    }
}

fn has_power(light: &Light) -> bool {
    light.irradiance.iter().any(|&v| v > 0.0)
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Index of the nearest cluster; the first of equally near ones.
fn nearest(clusters: &[Light], direction: [f32; 3]) -> u32 {
    let mut best = (f32::NEG_INFINITY, 0);
    for (place, cluster) in clusters.iter().enumerate() {
        let dot = dot(cluster.direction, direction);
        if dot > best.0 {
            best = (dot, place as u32);
        }
    }
    best.1
}

#[cfg(test)]
mod tests;
