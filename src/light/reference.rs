//! Irradiances of a map at the estimator's normals, from blocks of pixels instead of pixels.
//!
//! Irradiance is linear in the flux vector `sum f w` of everything in front of a surface, so a block of pixels
//! wholly in front of it counts exactly by its flux vector alone. Only blocks that the horizon of the normal cuts
//! are approximate; there the flux is taken as spread evenly over the block's own second moment.

use super::error::IrradianceSums;
use crate::image::{PolarMap, PolarShape, luminance};
use glam::DVec3;
use std::f64::consts::TAU;

/// Wanted side of a block; the tests hold the estimate against the slow measure, pixel by pixel.
const BLOCK_SIDE_RAD: f64 = 4.0 * std::f64::consts::PI / 180.0;

/// Some whole rows of the map, cut into blocks of about equal width.
#[derive(Clone, Debug)]
struct Band {
    rows: std::ops::Range<usize>,
    blocks: usize,
}

/// Evaluates maps of one shape.
#[derive(Clone, Debug)]
pub struct MapIrradiance {
    shape: PolarShape,
    bands: Vec<Band>,
    column_cos_sin: Vec<(f32, f32)>,
    /// Luminous radiance of the row summed times solid angle, per block: flux vector and flux.
    blocks: Vec<(DVec3, f64)>,
    sums: IrradianceSums,
}

impl MapIrradiance {
    /// Prepares the blocks of a shape.
    pub fn new(shape: PolarShape) -> Self {
        let band_count = (shape.theta_max_rad / BLOCK_SIDE_RAD).ceil().clamp(1.0, shape.rows as f64) as usize;
        let bands: Vec<Band> = (0..band_count)
            .map(|band| {
                let rows = band * shape.rows / band_count..(band + 1) * shape.rows / band_count;
                let middle = 0.5 * (shape.theta_edge_rad(rows.start) + shape.theta_edge_rad(rows.end));
                let blocks = (TAU * middle.sin() / BLOCK_SIDE_RAD).ceil().clamp(3.0, 1e9) as usize;
                Band { rows, blocks: blocks.min(shape.columns) }
            })
            .collect();
        let most = bands.iter().map(|band| band.blocks).max().unwrap_or(0);
        let column_cos_sin = (0..shape.columns)
            .map(|column| {
                let (sin, cos) = (TAU * (column as f64 + 0.5) / shape.columns as f64).sin_cos();
                (cos as f32, sin as f32)
            })
            .collect();
        Self {
            shape,
            bands,
            column_cos_sin,
            blocks: vec![(DVec3::ZERO, 0.0); most],
            sums: IrradianceSums::new(),
        }
    }

    /// Writes the luminous irradiances of `map`, whose shape is that given to [`Self::new`], into `reference`.
    pub fn reference(&mut self, map: &PolarMap, reference: &mut Vec<f32>) {
        assert_eq!(map.shape, self.shape, "the map's shape is fixed when the estimator is made");
        let columns = self.shape.columns;
        self.sums.clear();
        for band in &self.bands {
            let blocks = &mut self.blocks[..band.blocks];
            blocks.fill((DVec3::ZERO, 0.0));
            for row in band.rows.clone() {
                let theta = self.shape.theta_max_rad * (row as f64 + 0.5) / self.shape.rows as f64;
                let (sin_theta, cos_theta) = theta.sin_cos();
                let solid_angle = self.shape.pixel_solid_angle(row);
                let pixels = &map.pixels[row * columns..(row + 1) * columns];
                for (block, (sum, flux)) in blocks.iter_mut().enumerate() {
                    let range = block * columns / band.blocks..(block + 1) * columns / band.blocks;
                    let (mut x, mut z, mut total) = (0.0f32, 0.0f32, 0.0f32);
                    for (&pixel, &(cos_phi, sin_phi)) in
                        pixels[range.clone()].iter().zip(&self.column_cos_sin[range])
                    {
                        let radiance = luminance(pixel);
                        x += radiance * cos_phi;
                        z += radiance * sin_phi;
                        total += radiance;
                    }
                    let (x, z, total) = (f64::from(x), f64::from(z), f64::from(total));
                    *sum += DVec3::new(x * sin_theta, total * cos_theta, z * sin_theta) * solid_angle;
                    *flux += total * solid_angle;
                }
            }
            for &(vector, flux) in blocks.iter() {
                // |V|^2 = F^2 (1 - s^2), s^2 the flux's variance over both tangential axes; an even spread of
                // variance s^2 / 2 on one axis is sqrt(3 s^2 / 2) to either side.
                let half_width = (1.5 * (flux * flux - vector.length_squared()).max(0.0)).sqrt();
                self.sums.add(vector.as_vec3(), half_width as f32);
            }
        }
        reference.clear();
        reference.extend(self.sums.irradiances());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::error::ListError;
    use crate::light::measure::{Emitters, relative_rms};
    use crate::light::{Light, LightList};

    /// A smooth sky with a bright disc, coarse lights at the block centres of a fixed grid.
    fn sky(shape: PolarShape, sun: (usize, usize)) -> PolarMap {
        PolarMap::from_fn(shape, |row, column| {
            let near = row.abs_diff(sun.0) <= 1 && column.abs_diff(sun.1) <= 1;
            let base = 1.0 + 0.5 * (column as f32 * 0.05).sin() + 0.3 * (row as f32 * 0.11).cos();
            if near { [3000.0, 2500.0, 2000.0] } else { [base, base * 1.1, base * 1.3] }
        })
    }

    fn lights_by_blocks(map: &PolarMap, rows: usize, columns: usize) -> Vec<Light> {
        let mut lights = Vec::new();
        for (id, (block_row, block_column)) in (0..map.shape.rows / rows)
            .flat_map(|r| (0..map.shape.columns / columns).map(move |c| (r, c)))
            .enumerate()
        {
            let (mut vector, mut flux) = (DVec3::ZERO, 0.0);
            for row in block_row * rows..(block_row + 1) * rows {
                for column in block_column * columns..(block_column + 1) * columns {
                    let f = f64::from(map.luminance(row, column)) * map.shape.pixel_solid_angle(row);
                    vector += f * map.shape.pixel_direction(row, column);
                    flux += f;
                }
            }
            let direction = vector.try_normalize().unwrap_or(DVec3::Y).as_vec3().to_array();
            lights.push(Light { id: id as u32, direction, irradiance: [flux as f32; 3], spread_rad: 0.0 });
        }
        lights
    }

    #[test]
    fn estimate_is_within_a_tenth_of_the_slow_measure() {
        for (shape, blocks) in [
            (PolarShape::hemisphere(360, 90), [(30, 60), (15, 30), (10, 20), (5, 15)]),
            (PolarShape::sphere(360, 180), [(60, 60), (30, 30), (20, 20), (10, 15)]),
        ] {
            for sun in [(40, 0), (2, 100), (88, 200)] {
                let map = sky(shape, sun);
                let slow_reference = Emitters::from_map(&map).irradiances(300);
                let mut list = LightList::default();
                MapIrradiance::new(shape).reference(&map, &mut list.reference_irradiance);
                for (rows, columns) in blocks {
                    let lights = lights_by_blocks(&map, rows, columns);
                    let slow =
                        relative_rms(&Emitters::from_lights(&lights).irradiances(300), &slow_reference);
                    let quick =
                        f64::from(ListError::new().relative_error(&lights, &list.reference_irradiance));
                    assert!(
                        (quick / slow - 1.0).abs() < 0.1,
                        "{} lights: {quick} against {slow}",
                        lights.len()
                    );
                }
            }
        }
    }

    #[test]
    fn black_map_has_no_error_and_light_out_of_darkness_has() {
        let shape = PolarShape::hemisphere(36, 9);
        let mut reference = Vec::new();
        MapIrradiance::new(shape).reference(&PolarMap::black(shape), &mut reference);
        let mut error = ListError::new();
        let mut light = Light { id: 0, direction: [0.0, 1.0, 0.0], irradiance: [0.0; 3], spread_rad: 0.0 };
        assert_eq!(error.relative_error(&[light], &reference), 0.0);
        assert_eq!(error.relative_error(&[], &[]), 0.0);
        light.irradiance = [1.0; 3];
        let lit = error.relative_error(&[light], &reference);
        assert!(lit > 1.0 && lit.is_finite(), "{lit}");
    }

    #[test]
    fn one_bright_pixel_and_tiny_maps_are_finite_and_right() {
        for shape in
            [PolarShape::sphere(1, 1), PolarShape::hemisphere(2, 1), PolarShape::hemisphere(1440, 360)]
        {
            let map =
                PolarMap::from_fn(shape, |row, column| if row + column == 0 { [1e8; 3] } else { [0.0; 3] });
            let mut reference = Vec::new();
            MapIrradiance::new(shape).reference(&map, &mut reference);
            let exact = Emitters::from_map(&map).irradiances(300);
            let top = exact.iter().cloned().fold(0.0, f64::max);
            for (quick, slow) in reference.iter().zip(&exact).take(150) {
                assert!((f64::from(*quick) - slow).abs() < 1e-5 * top, "{shape:?}: {quick} {slow}");
            }
        }
    }

    #[test]
    fn prefix_errors_end_with_the_whole_list() {
        let map = sky(PolarShape::hemisphere(360, 90), (40, 100));
        let lights = lights_by_blocks(&map, 15, 30);
        let mut reference = Vec::new();
        MapIrradiance::new(map.shape).reference(&map, &mut reference);
        let mut errors = Vec::new();
        let mut estimator = ListError::new();
        estimator.prefix_errors(&lights, &reference, &mut errors);
        assert_eq!(errors.iter().map(|e| e.0).collect::<Vec<_>>(), [8, 16, 32, 64, 72]);
        assert_eq!(errors[4].1, estimator.relative_error(&lights, &reference));
        estimator.prefix_errors(&[], &reference, &mut errors);
        assert_eq!(errors.len(), 1);
        assert!(errors[0].1 >= 1.0, "no lights at all miss everything: {errors:?}");
    }
}
