//! Irradiances of a map at the estimator's normals, from blocks of pixels instead of pixels.
//!
//! Irradiance is linear in the flux vector `sum f w` of everything in front of a surface, so a block of
//! pixels wholly in front of it counts exactly by its flux vector alone. Only blocks that the horizon of the
//! normal cuts are approximate; there the flux is taken as spread evenly over the block's own second moment.
//! A block of side s that holds the share q of the map's flux is cut with a probability proportional to s,
//! and its error is then proportional to q s, so its part of the RMS error goes as `q s^1.5`. Blocks where
//! that is large, those around a sun or a lamp, are halved until it is small or they are single pixels.

use super::error::{Contribution, NormalSphere};
use crate::image::{PolarMap, PolarShape, luminance};
use glam::DVec3;
use std::f64::consts::TAU;
use std::ops::Range;

/// Side of a block to start with: about 1,300 per hemisphere.
const BLOCK_SIDE_RAD: f64 = 4.0 * std::f64::consts::PI / 180.0;

/// Largest `q s^1.5` of a block that is not halved. An even sky stays below with whole blocks; the tests
/// compare the result with the slow measure, pixel by pixel.
const TOLERANCE: f64 = 2e-5;

/// A rectangle of the map and its flux.
#[derive(Clone, Debug)]
struct Block {
    rows: Range<usize>,
    columns: Range<usize>,
    /// Sum of flux times direction.
    vector: DVec3,
    flux: f64,
}

/// Evaluates maps of one shape.
#[derive(Clone, Debug)]
pub struct MapIrradiance {
    tables: Tables,
    blocks: Vec<Block>,
    contributions: Vec<Contribution>,
    normals: NormalSphere,
}

/// Direction cosines and solid angles of a shape's rows and columns.
#[derive(Clone, Debug)]
struct Tables {
    shape: PolarShape,
    /// Cosine and sine per column.
    azimuths: Vec<[f64; 2]>,
    /// Per row: cosine and sine of theta, solid angle of a pixel.
    rows: Vec<[f64; 3]>,
}

impl MapIrradiance {
    /// Prepares the blocks of a shape.
    pub fn new(shape: PolarShape) -> Self {
        let band_count =
            (shape.theta_max_rad() / BLOCK_SIDE_RAD).ceil().clamp(1.0, shape.rows() as f64) as usize;
        let mut blocks = Vec::new();
        for band in 0..band_count {
            let rows = band * shape.rows() / band_count..(band + 1) * shape.rows() / band_count;
            let middle = 0.5 * (shape.theta_edge_rad(rows.start) + shape.theta_edge_rad(rows.end));
            let count =
                (TAU * middle.sin() / BLOCK_SIDE_RAD).ceil().clamp(1.0, shape.columns() as f64) as usize;
            blocks.extend((0..count).map(|block| Block {
                rows: rows.clone(),
                columns: block * shape.columns() / count..(block + 1) * shape.columns() / count,
                vector: DVec3::ZERO,
                flux: 0.0,
            }));
        }
        // Twice the blocks leaves room for those that are halved.
        let contributions = Vec::with_capacity(2 * blocks.len());
        Self { tables: Tables::new(shape), blocks, contributions, normals: NormalSphere::new() }
    }

    /// Writes the luminous irradiances of `map` into `reference`.
    ///
    /// # Panics
    /// If the map is not of the shape given to [`Self::new`].
    pub fn reference(&mut self, map: &PolarMap, reference: &mut Vec<f32>) {
        assert!(map.shape == self.tables.shape, "the map's shape");
        self.contributions.clear();
        let mut total = 0.0;
        for block in &mut self.blocks {
            self.tables.fill(map, block);
            total += block.flux;
        }
        for block in self.blocks.iter().filter(|block| block.flux > 0.0) {
            self.tables.add(map, block, total, &mut self.contributions);
        }
        reference.clear();
        reference.extend_from_slice(self.normals.irradiances(&self.contributions));
    }

    /// The blocks into which the last map was divided.
    pub(super) fn blocks(&self) -> &[Contribution] {
        &self.contributions
    }
}

impl Tables {
    fn new(shape: PolarShape) -> Self {
        let rows = (0..shape.rows()).map(|row| {
            let (sin, cos) = (shape.theta_max_rad() * (row as f64 + 0.5) / shape.rows() as f64).sin_cos();
            [cos, sin, shape.pixel_solid_angle(row)]
        });
        Self { shape, azimuths: shape.column_azimuths(), rows: rows.collect() }
    }

    /// Sums up the pixels of a block.
    fn fill(&self, map: &PolarMap, block: &mut Block) {
        (block.vector, block.flux) = (DVec3::ZERO, 0.0);
        let azimuths = &self.azimuths[block.columns.clone()];
        for row in block.rows.clone() {
            let pixels = &map.pixels[row * self.shape.columns()..][block.columns.clone()];
            let (mut x, mut z, mut sum) = (0.0f64, 0.0f64, 0.0f64);
            for (&pixel, &[cos_phi, sin_phi]) in pixels.iter().zip(azimuths) {
                let radiance = f64::from(luminance(pixel));
                x += radiance * cos_phi;
                z += radiance * sin_phi;
                sum += radiance;
            }
            let [cos_theta, sin_theta, solid_angle] = self.rows[row];
            block.vector += DVec3::new(x * sin_theta, sum * cos_theta, z * sin_theta) * solid_angle;
            block.flux += sum * solid_angle;
        }
    }

    /// Adds a filled block, or its halves if its share of `total` is too large for its size.
    fn add(&self, map: &PolarMap, block: &Block, total: f64, contributions: &mut Vec<Contribution>) {
        let Block { rows, columns, vector, flux } = block;
        let height_rad = self.shape.theta_max_rad() * rows.len() as f64 / self.shape.rows() as f64;
        let sin_theta = self.rows[rows.start.midpoint(rows.end)][1];
        let width_rad = sin_theta * TAU * columns.len() as f64 / self.shape.columns() as f64;
        let is_pixel = rows.len() == 1 && columns.len() == 1;
        let side_rad = height_rad.max(width_rad);
        if is_pixel || flux * side_rad * side_rad.sqrt() <= TOLERANCE * total {
            // |V|^2 = F^2 (1 - s^2), s^2 the flux's variance over both tangential axes; an even spread of
            // variance s^2 / 2 on one axis is sqrt(3 s^2 / 2) to either side.
            let variance = if is_pixel { 0.0 } else { (flux * flux - vector.length_squared()).max(0.0) };
            contributions.push(Contribution::new(vector.as_vec3(), (1.5 * variance).sqrt() as f32));
            return;
        }
        let (mut first, mut second) = (block.clone(), block.clone());
        if rows.len() > 1 && (height_rad >= width_rad || columns.len() == 1) {
            first.rows.end = rows.start.midpoint(rows.end);
            second.rows.start = first.rows.end;
        } else {
            first.columns.end = columns.start.midpoint(columns.end);
            second.columns.start = first.columns.end;
        }
        for mut half in [first, second] {
            self.fill(map, &mut half);
            if half.flux > 0.0 {
                self.add(map, &half, total, contributions);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::error::ListError;
    use crate::light::measure::{Emitters, relative_rms};
    use crate::light::{Light, LightList, ReferencedList};

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
        for (id, (block_row, block_column)) in (0..map.shape.rows() / rows)
            .flat_map(|r| (0..map.shape.columns() / columns).map(move |c| (r, c)))
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
                let mut reference = Vec::new();
                MapIrradiance::new(shape).reference(&map, &mut reference);
                for (rows, columns) in blocks {
                    let lights = lights_by_blocks(&map, rows, columns);
                    let slow =
                        relative_rms(&Emitters::from_lights(&lights).irradiances(300), &slow_reference);
                    let quick = f64::from(ListError::new().relative_error(&lights, &reference));
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
            for (quick, slow) in reference.iter().zip(&exact) {
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
        let mut estimator = ListError::new();
        let list = LightList { lights, ..LightList::default() };
        let mut referenced = ReferencedList { list, reference_irradiance: reference };
        estimator.measure(&mut referenced);
        let ReferencedList { list, reference_irradiance } = &referenced;
        assert_eq!(list.prefix_errors.iter().map(|e| e.0).collect::<Vec<_>>(), [8, 16, 32, 64, 72]);
        assert_eq!(list.error, Some(estimator.relative_error(&list.lights, reference_irradiance)));
        referenced.list.lights.clear();
        estimator.measure(&mut referenced);
        let list = &referenced.list;
        assert_eq!(list.prefix_errors.len(), 1);
        assert!(list.error.unwrap() >= 1.0, "no lights at all miss everything: {:?}", list.error);
    }

    #[test]
    fn estimate_is_within_a_tenth_of_the_slow_measure_on_every_real_map() {
        use crate::light::{Extractor, Options, Sampler};
        use crate::test_data::real_maps;
        let shape = PolarShape::hemisphere(360, 90);
        let mut worst = 1.0f64;
        for (name, map) in real_maps(shape) {
            let slow_reference = Emitters::from_map(&map).irradiances(300);
            for sampler in [Sampler::Refined, Sampler::EqualPower] {
                for count in [4, 16, 64, 256, 1024] {
                    let options = Options { count, sampler, ..Options::default() };
                    let mut list = ReferencedList::default();
                    Extractor::new(shape, &options).unwrap().step(&map, &mut list);
                    ListError::new().measure(&mut list);
                    let slow = relative_rms(
                        &Emitters::from_lights(&list.list.lights).irradiances(300),
                        &slow_reference,
                    );
                    let error = f64::from(list.list.error.unwrap());
                    let ratio = error / slow;
                    println!("{name:32} {sampler:?} {count:5}: {error:.6} slow {slow:.6} ratio {ratio:.3}");
                    worst = worst.max(ratio.max(1.0 / ratio));
                }
            }
        }
        assert!(worst < 1.1, "off by a factor of {worst}");
    }
}
