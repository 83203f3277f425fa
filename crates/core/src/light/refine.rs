//! A share of the map, or of lights, as one light.
//!
//! A share with luminous flux F and first moment `V`, the integral of luminous radiance times direction,
//! becomes a light in direction `V / |V|` with `spread_rad = acos(|V| / F)`. For flux at angles a from the
//! light's direction `|V| / F` is the mean of `cos a`, so that this is the RMS angle up to terms of a^4: 0.2
//! % below it for an even disc of radius 0.5 rad. Unlike the RMS itself it needs one pass, and shares can be
//! joined exactly: F and V add.

use super::Light;
use super::nearest::NearestSites;
use crate::image::{PolarMap, PolarShape, luminance_f64};
use glam::DVec3;

/// RGB flux and luminous first moment of a share.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Share {
    /// RGB flux: the integral of radiance over the share.
    pub flux: [f64; 3],
    /// Integral of luminous radiance times direction.
    pub moment: DVec3,
}

impl Share {
    /// The share that a light stands for.
    pub(super) fn of(light: &Light) -> Self {
        let flux = light.irradiance.map(f64::from);
        let length = luminance_f64(flux) * f64::from(light.spread_rad).cos();
        Self { flux, moment: DVec3::from(light.direction.map(f64::from)) * length }
    }

    /// Joins another share.
    pub fn add(&mut self, other: &Self) {
        for channel in 0..3 {
            self.flux[channel] += other.flux[channel];
        }
        self.moment += other.moment;
    }

    pub(super) fn luminous_flux(&self) -> f64 {
        luminance_f64(self.flux)
    }

    /// The light of this share; towards `site` where the share has no flux or its directions cancel.
    pub fn light(&self, id: u32, site: [f32; 3]) -> Light {
        let flux = luminance_f64(self.flux);
        let length = self.moment.length();
        // Below this part of the flux a resultant is only the rounding of f64 sums over millions of pixels.
        let certain = length > 1e-9 * flux && length > 0.0;
        let direction = if certain { (self.moment / length).as_vec3().to_array() } else { site };
        let spread_rad = if flux > 0.0 {
            // acos(1 - d) = 2 asin(sqrt(d / 2)) keeps its digits where d is small.
            let defect = (1.0 - length / flux).clamp(0.0, 1.0);
            // A share narrower than this is one direction: f64 sums cannot resolve it.
            if defect < 1e-14 { 0.0 } else { 2.0 * (0.5 * defect).sqrt().asin() }
        } else {
            0.0
        };
        Light {
            id,
            direction,
            // Only maps near the limits of f32 reach the bound; infinity would become NaN downstream.
            irradiance: self.flux.map(|v| v.min(f64::from(f32::MAX)) as f32),
            spread_rad: spread_rad as f32,
        }
    }
}

/// The cells of sites: which pixels are nearest to each, and what they hold. Each takes one pass over the
/// map.
#[derive(Clone, Debug)]
pub struct Voronoi {
    shape: PolarShape,
    nearest_sites: NearestSites,
    /// The index of the site of every pixel.
    nearest: Vec<u32>,
    /// Cosine and sine per column, at its centre.
    azimuths: Vec<[f64; 2]>,
    shares: Vec<Share>,
}

impl Voronoi {
    /// For maps of one shape and at most `site_count` sites.
    pub fn new(shape: PolarShape, site_count: usize) -> Self {
        Self {
            shape,
            nearest_sites: NearestSites::new(shape, site_count),
            nearest: vec![0; shape.len()],
            azimuths: shape.column_azimuths(),
            shares: Vec::with_capacity(site_count),
        }
    }

    /// Writes the light of the cell of every site: its RGB flux (the sum over all lights is that of the map),
    /// its flux-weighted mean direction and its spread. The light of an empty cell has no power and the
    /// site's direction.
    pub fn refine(&mut self, map: &PolarMap, sites: &[[f32; 3]], lights: &mut Vec<Light>) {
        let columns = map.shape.columns();
        let row = |row: usize| &map.pixels[row * columns..(row + 1) * columns];
        let cells = self.sum(sites, row).iter().zip(sites).enumerate();
        lights.clear();
        lights.extend(cells.map(|(id, (share, &site))| share.light(id as u32, site)));
    }

    /// What the cell of every site holds of a map, given row by row.
    pub(super) fn sum<'a>(
        &mut self,
        sites: &[[f32; 3]],
        pixels: impl Fn(usize) -> &'a [[f32; 3]],
    ) -> &[Share] {
        self.nearest_sites.assign(sites, &mut self.nearest);
        self.shares.clear();
        self.shares.resize(sites.len(), Share::default());
        let shape = self.shape;
        for (row, nearest) in self.nearest.chunks_exact(shape.columns()).enumerate() {
            let pixels = pixels(row);
            let theta_rad = shape.theta_max_rad() * (row as f64 + 0.5) / shape.rows() as f64;
            let (sin_theta, cos_theta) = theta_rad.sin_cos();
            let solid_angle = shape.pixel_solid_angle(row);
            let mut start = 0;
            // Runs of one cell: sums stay in registers, and what is common to the row is multiplied once.
            for run in nearest.chunk_by(|a, b| a == b) {
                let end = start + run.len();
                let (flux, [x, z]) = sum_run(&pixels[start..end], &self.azimuths[start..end]);
                let moment = DVec3::new(sin_theta * x, cos_theta * luminance_f64(flux), sin_theta * z);
                self.shares[run[0] as usize]
                    .add(&Share { flux: flux.map(|v| v * solid_angle), moment: moment * solid_angle });
                start = end;
            }
        }
        &self.shares
    }
}

/// RGB sum of pixels, and their luminance times cosine and sine of azimuth.
fn sum_run(pixels: &[[f32; 3]], azimuths: &[[f64; 2]]) -> ([f64; 3], [f64; 2]) {
    let (mut flux, mut moment) = ([0.0; 3], [0.0; 2]);
    for (pixel, azimuth) in pixels.iter().zip(azimuths) {
        let rgb = pixel.map(f64::from);
        let y = luminance_f64(rgb);
        for channel in 0..3 {
            flux[channel] += rgb[channel];
        }
        for axis in 0..2 {
            moment[axis] += y * azimuth[axis];
        }
    }
    (flux, moment)
}
