//! From a list to the lights on the device: set H, set L and the shadow map of each (Havran et al. 2005,
//! sections 4.2 and 5.2.1).

use super::DirectionalOptions;
use super::tiles::Tiles;
use bytemuck::{Pod, Zeroable};
use lightcast_core::light::{Light, Prefixes, cluster};

/// A light as shaders read it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(in crate::render) struct GpuLight {
    pub direction: [f32; 3],
    pub spread_rad: f32,
    pub irradiance: [f32; 3],
    pub tile: u32,
}

impl GpuLight {
    fn new(light: &Light, tile: u32) -> Self {
        Self { direction: light.direction, spread_rad: light.spread_rad, irradiance: light.irradiance, tile }
    }
}

/// The lights of a frame.
#[derive(Default)]
pub(super) struct LightSets {
    pub tiles: Tiles,
    /// Set H, then set L.
    pub lights: Vec<GpuLight>,
    pub high_count: usize,
    high: Vec<Light>,
    prefixes: Prefixes,
    heads: Vec<u32>,
    clusters: Vec<Light>,
    places: Vec<u32>,
}

impl LightSets {
    /// Set H is the prefix of the list, clustered if the options say so; if the list is longer and cones are
    /// in use, set L is the whole list. A light of L has the shadow map of the light of H into which it was
    /// merged.
    pub fn update(&mut self, list: &[Light], options: &DirectionalOptions) {
        self.prefixes.prefix_with_heads(list, options.lights, &mut self.high, &mut self.heads);
        if let Some(most) = options.clusters {
            cluster(&self.high, most, &mut self.clusters, &mut self.places);
            std::mem::swap(&mut self.high, &mut self.clusters);
            // Lights without power do not belong to any cluster, and are not drawn.
            self.heads.iter_mut().for_each(|head| *head = self.places[*head as usize]);
        }
        self.tiles.assign(&self.high, options.shadow_maps);
        self.lights.clear();
        let tile_of = &self.tiles.tile_of;
        self.lights.extend(self.high.iter().zip(tile_of).map(|(light, &tile)| GpuLight::new(light, tile)));
        self.high_count = self.high.len();
        if list.len() > self.high.len() && options.cone_rad > 0.0 {
            let low = list.iter().zip(&self.heads);
            self.lights.extend(low.map(|(light, &head)| {
                GpuLight::new(light, tile_of.get(head as usize).copied().unwrap_or(u32::MAX))
            }));
        }
    }

    pub fn low_count(&self) -> usize {
        self.lights.len() - self.high_count
    }
}
