use super::Light;
use crate::image::{PolarMap, luminance_f64};
use crate::math::polar;
use glam::DVec3;
use std::f64::consts::TAU;

/// Lights of equal luminous power towards `directions`, as in the paper (2005, section 3): their luminous sum
/// is that of the map, and each has the chromaticity of the map's pixel in its direction. RGB sums are
/// therefore only nearly those of the map. Where that pixel is black the light takes the map's mean
/// chromaticity. `spread_rad` is 0, which stands for unknown.
pub fn equal_power(map: &PolarMap, directions: &[[f32; 3]], lights: &mut Vec<Light>) {
    let power = map.power();
    let luminous_power = luminance_f64(power);
    let share = luminous_power / directions.len().max(1) as f64;
    lights.clear();
    lights.extend(directions.iter().enumerate().map(|(id, &direction)| {
        let pixel = pixel_towards(map, direction).map(f64::from);
        let colour = if luminance_f64(pixel) > 0.0 { pixel } else { power };
        let scale = if luminous_power > 0.0 { share / luminance_f64(colour) } else { 0.0 };
        Light {
            id: id as u32,
            direction,
            // Only maps near the limits of f32 reach the bound; infinity would become NaN downstream.
            irradiance: colour.map(|v| (v * scale).min(f64::from(f32::MAX)) as f32),
            spread_rad: 0.0,
        }
    }));
}

/// The pixel that holds a direction; beyond the rim that of the last row.
fn pixel_towards(map: &PolarMap, direction: [f32; 3]) -> [f32; 3] {
    let shape = map.shape;
    let (theta_rad, phi_rad) = polar(DVec3::from(direction.map(f64::from)));
    let row = (theta_rad / shape.theta_max_rad() * shape.rows() as f64) as usize;
    let column = (phi_rad / TAU * shape.columns() as f64) as usize;
    map.pixels[row.min(shape.rows() - 1) * shape.columns() + column.min(shape.columns() - 1)]
}
