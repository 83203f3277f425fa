//! Which site is nearest to each pixel: the Voronoi cells of METHODS section 6, exactly.
//!
//! The map is cut into blocks of about the same angular size. A site can only win a pixel of a block if its
//! bisector with the site t that is nearest to the block's centre c crosses the block. With the block inside
//! a cap of radius rho < pi/2 about c, a site s loses everywhere in it if `c . (t - s) > |t - s| sin rho`,
//! because then every direction p of the cap has `p . (t - s) > 0`. What is left, a handful of sites, is
//! compared pixel by pixel.

use crate::image::PolarShape;
use multiversion::multiversion;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

/// Pixels that are compared together.
const LANES: usize = 16;

/// Angular size of a block. Larger blocks keep more candidates for every pixel, smaller ones look at all
/// sites more often; at 8 degrees, 300 sites and 360 x 90 pixels both cost about the same.
const BLOCK_SIZE_RAD: f64 = 8.0 * TAU / 360.0;

/// By how much more than the bound a site must lose to be ruled out for a block. It then loses by at least
/// 0.7 of this at every pixel, and dot products in f32 are off by up to 3e-7, the bound by less than 1e-6:
/// whatever is ruled out would also have lost in f32, and the result is that of comparing all sites.
const SLACK: f32 = 4e-6;

/// Assigns every pixel of maps of one shape to its nearest site.
#[derive(Clone, Debug)]
pub struct NearestSites {
    shape: PolarShape,
    blocks: Vec<Block>,
    tables: Tables,
    /// Of the frame: sites by coordinate, padded to a multiple of [`LANES`], and those that a block needs.
    sites: Sites,
    candidates: Vec<Candidate>,
}

/// Directions of the pixel centres, as factors.
#[derive(Clone, Debug)]
struct Tables {
    columns: usize,
    /// Per column, padded to a multiple of [`LANES`].
    cos_phi: Vec<f32>,
    sin_phi: Vec<f32>,
    /// Per row.
    sin_theta: Vec<f32>,
    cos_theta: Vec<f32>,
}

#[derive(Clone, Debug)]
struct Block {
    rows: Range<usize>,
    /// A multiple of [`LANES`] long; may reach into the padding.
    columns: Range<usize>,
    centre: [f32; 3],
    /// Sine of the radius of the cap about `centre` that holds all pixel centres; infinite from a right angle
    /// on.
    sin_radius: f32,
}

#[derive(Clone, Debug, Default)]
struct Sites {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    /// Scratch: above 0 for sites that are ruled out for the block.
    margin: Vec<f32>,
}

#[derive(Clone, Copy, Debug)]
struct Candidate {
    direction: [f32; 3],
    index: u32,
}

impl NearestSites {
    /// Tables for maps of a shape and at most `site_count` sites; nothing is allocated later.
    pub fn new(shape: PolarShape, site_count: usize) -> Self {
        let padded = shape.columns().next_multiple_of(LANES);
        let phi =
            |column: usize| TAU * (column.min(shape.columns() - 1) as f64 + 0.5) / shape.columns() as f64;
        let theta = |row: usize| shape.theta_max_rad() * (row as f64 + 0.5) / shape.rows() as f64;
        let capacity = site_count.next_multiple_of(LANES);
        let scratch = || Vec::with_capacity(capacity);
        Self {
            shape,
            blocks: blocks(shape, padded),
            tables: Tables {
                columns: shape.columns(),
                cos_phi: (0..padded).map(|c| phi(c).cos() as f32).collect(),
                sin_phi: (0..padded).map(|c| phi(c).sin() as f32).collect(),
                sin_theta: (0..shape.rows()).map(|r| theta(r).sin() as f32).collect(),
                cos_theta: (0..shape.rows()).map(|r| theta(r).cos() as f32).collect(),
            },
            sites: Sites { x: scratch(), y: scratch(), z: scratch(), margin: scratch() },
            candidates: Vec::with_capacity(site_count),
        }
    }

    /// Writes the index of the nearest of `sites` (unit vectors, at least one) for every pixel of the map,
    /// row-major; of equally near ones the lowest.
    ///
    /// # Panics
    /// If there is no site or `nearest` has not one element for each pixel.
    pub fn assign(&mut self, sites: &[[f32; 3]], nearest: &mut [u32]) {
        assert!(!sites.is_empty() && nearest.len() == self.shape.len(), "sites, and a slot for each pixel");
        self.sites.load(sites);
        let columns = self.shape.columns();
        for block in &self.blocks {
            self.candidates.clear();
            self.sites.margins(block.centre, block.sin_radius);
            for (index, (&direction, &margin)) in sites.iter().zip(&self.sites.margin).enumerate() {
                if margin <= 0.0 {
                    self.candidates.push(Candidate { direction, index: index as u32 });
                }
            }
            if let [only] = self.candidates[..] {
                let end = block.columns.end.min(columns);
                for row in block.rows.clone() {
                    nearest[row * columns..][block.columns.start..end].fill(only.index);
                }
                continue;
            }
            compare_dispatched(&self.candidates, block, &self.tables, nearest);
        }
    }
}

fn lanes(values: &[f32]) -> &[f32; LANES] {
    values.first_chunk().expect("tables are padded to whole lanes")
}

/// Blocks that tile the map.
fn blocks(shape: PolarShape, padded: usize) -> Vec<Block> {
    let row_height = shape.theta_max_rad() / shape.rows() as f64;
    let height = ((BLOCK_SIZE_RAD / row_height).round() as usize).clamp(1, shape.rows());
    let mut blocks = Vec::new();
    for first in (0..shape.rows()).step_by(height) {
        let rows = first..(first + height).min(shape.rows());
        let middle = 0.5 * (shape.theta_edge_rad(rows.start) + shape.theta_edge_rad(rows.end));
        let step = middle.sin() * TAU / shape.columns() as f64;
        let width = ((BLOCK_SIZE_RAD / step).min(padded as f64) as usize).next_multiple_of(LANES).max(LANES);
        for first in (0..padded).step_by(width) {
            let columns = first..(first + width).min(padded);
            let end = columns.end.min(shape.columns());
            let phi = TAU * 0.5 * (columns.start + end) as f64 / shape.columns() as f64;
            let centre = crate::math::direction(middle, phi);
            let mut radius = 0f64;
            for row in rows.clone() {
                for column in columns.start..end {
                    radius =
                        radius.max(crate::math::angle_between(centre, shape.pixel_direction(row, column)));
                }
            }
            blocks.push(Block {
                rows: rows.clone(),
                columns,
                centre: centre.as_vec3().to_array(),
                // Rounding of the tables and of the centre to f32 is far below a micro-radian.
                sin_radius: if radius + 1e-6 < FRAC_PI_2 {
                    (radius + 1e-6).sin() as f32
                } else {
                    f32::INFINITY
                },
            });
        }
    }
    blocks
}

impl Sites {
    fn load(&mut self, sites: &[[f32; 3]]) {
        let padded = sites.len().next_multiple_of(LANES);
        for (axis, values) in [&mut self.x, &mut self.y, &mut self.z].into_iter().enumerate() {
            values.clear();
            values.extend(sites.iter().map(|site| site[axis]));
            // Repeats of the first site: never better than it, so they change no maximum.
            values.resize(padded, sites[0][axis]);
        }
        self.margin.clear();
        self.margin.resize(padded, 0.0);
    }

    /// Fills `margin` for a block.
    fn margins(&mut self, centre: [f32; 3], sin_radius: f32) {
        margins(&self.x, &self.y, &self.z, &mut self.margin, centre, sin_radius);
    }
}

/// For every site s, with t the nearest to `centre`, a number above 0 if `c . (t - s) - SLACK > |t - s|
/// sin_radius`.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
fn margins(x: &[f32], y: &[f32], z: &[f32], margin: &mut [f32], centre: [f32; 3], sin_radius: f32) {
    // Slices of one length and plain loops: this is what compilers turn into vector code.
    let count = margin.len();
    let (x, y, z) = (&x[..count], &y[..count], &z[..count]);
    for i in 0..count {
        margin[i] = centre[0] * x[i] + centre[1] * y[i] + centre[2] * z[i];
    }
    let (mut best, mut place) = ([f32::NEG_INFINITY; LANES], [0; LANES]);
    for (chunk, dots) in margin.as_chunks::<LANES>().0.iter().enumerate() {
        for lane in 0..LANES {
            let better = dots[lane] > best[lane];
            best[lane] = if better { dots[lane] } else { best[lane] };
            place[lane] = if better { chunk as u32 } else { place[lane] };
        }
    }
    let mut winner = 0;
    for lane in 1..LANES {
        winner = if best[lane] > best[winner] { lane } else { winner };
    }
    let (top, nearest) = (best[winner], place[winner] as usize * LANES + winner);
    let t = [x[nearest], y[nearest], z[nearest]];
    for i in 0..count {
        let (dx, dy, dz) = (t[0] - x[i], t[1] - y[i], t[2] - z[i]);
        // Squares with their sign compare as the values do, and spare a root. An infinite sine times a
        // distance of 0 is NaN; `max` takes it out.
        let reach = ((dx * dx + dy * dy + dz * dz) * (sin_radius * sin_radius)).max(0.0);
        let lost = top - margin[i] - SLACK;
        margin[i] = lost * lost.abs() - reach;
    }
}

/// [`compare`] with the vector units of the machine.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
fn compare_dispatched(candidates: &[Candidate], block: &Block, tables: &Tables, nearest: &mut [u32]) {
    compare(candidates, block, tables, nearest);
}

/// Writes for every pixel of a block the index of the candidate with the largest dot product; the first of
/// equals.
///
/// The dot product is `(px sx + py sy) + pz sz` without fused operations, so that every target gives the same
/// bits.
#[inline(always)]
fn compare(candidates: &[Candidate], block: &Block, tables: &Tables, nearest: &mut [u32]) {
    for row in block.rows.clone() {
        let (sin_theta, cos_theta) = (tables.sin_theta[row], tables.cos_theta[row]);
        for start in block.columns.clone().step_by(LANES) {
            let (cos_phi, sin_phi) = (lanes(&tables.cos_phi[start..]), lanes(&tables.sin_phi[start..]));
            let (mut px, mut pz) = ([0.0; LANES], [0.0; LANES]);
            for lane in 0..LANES {
                px[lane] = sin_theta * cos_phi[lane];
                pz[lane] = sin_theta * sin_phi[lane];
            }
            let mut best = [f32::NEG_INFINITY; LANES];
            let mut index = [0; LANES];
            // Copied to local variables: a choice between memory locations would not be vectorised.
            for &Candidate { direction: [x, y, z], index: candidate } in candidates {
                for lane in 0..LANES {
                    let dot = px[lane] * x + cos_theta * y + pz[lane] * z;
                    let better = dot > best[lane];
                    best[lane] = if better { dot } else { best[lane] };
                    index[lane] = if better { candidate } else { index[lane] };
                }
            }
            let end = (start + LANES).min(tables.columns);
            nearest[row * tables.columns..][start..end].copy_from_slice(&index[..end - start]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::fibonacci_sphere;

    /// Every site against every pixel, with the arithmetic of [`compare`].
    fn assign_slowly(tables: &NearestSites, sites: &[[f32; 3]]) -> Vec<u32> {
        let mut nearest = Vec::new();
        for row in 0..tables.shape.rows() {
            for column in 0..tables.shape.columns() {
                let px = tables.tables.sin_theta[row] * tables.tables.cos_phi[column];
                let pz = tables.tables.sin_theta[row] * tables.tables.sin_phi[column];
                let mut best = (f32::NEG_INFINITY, 0);
                for (index, [x, y, z]) in sites.iter().enumerate() {
                    let dot = px * x + tables.tables.cos_theta[row] * y + pz * z;
                    if dot > best.0 {
                        best = (dot, index as u32);
                    }
                }
                nearest.push(best.1);
            }
        }
        nearest
    }

    /// Sites spread evenly, in one tight bunch, in a bunch and evenly, coinciding, and on one great circle.
    fn site_sets() -> Vec<(&'static str, Vec<[f32; 3]>)> {
        let even = |count| fibonacci_sphere(count).map(|d| d.as_vec3().to_array()).collect::<Vec<_>>();
        let bunch = |size: f64, count| -> Vec<[f32; 3]> {
            let about = crate::math::direction(0.7, 3.0);
            fibonacci_sphere(count)
                .map(|d| (about + size * d).as_vec3().normalize_or(glam::Vec3::Y).to_array())
                .collect()
        };
        let circle =
            (0..100).map(|i| crate::math::direction(1.2, 0.0628 * f64::from(i)).as_vec3().to_array());
        vec![
            ("even", even(300)),
            ("one", even(1)),
            ("two", even(2)),
            ("bunch of a degree", bunch(0.02, 300)),
            ("bunch of a pixel", bunch(1e-4, 300)),
            ("bunch within rounding", bunch(1e-7, 50)),
            ("bunch and even", [bunch(0.02, 200), even(100)].concat()),
            ("coinciding", vec![[0.0, 1.0, 0.0]; 40]),
            ("twice each", [even(50), even(50)].concat()),
            ("on a circle", circle.collect()),
        ]
    }

    #[test]
    fn every_pixel_gets_its_nearest_site_as_by_comparing_all() {
        for shape in [
            PolarShape::hemisphere(360, 90),
            PolarShape::sphere(90, 45),
            PolarShape::new(128, 40, 1.92).unwrap(),
            PolarShape::hemisphere(1, 1),
            PolarShape::sphere(1, 1),
            PolarShape::sphere(3, 2),
            PolarShape::hemisphere(17, 200),
            PolarShape::new(400, 3, 0.01).unwrap(),
        ] {
            for (case, sites) in site_sets() {
                let mut tables = NearestSites::new(shape, sites.len());
                let mut nearest = vec![u32::MAX; shape.len()];
                tables.assign(&sites, &mut nearest);
                let expected = assign_slowly(&tables, &sites);
                let wrong = nearest.iter().zip(&expected).filter(|(a, b)| a != b).count();
                assert_eq!(wrong, 0, "{case} {shape:?}");
            }
        }
    }

    #[test]
    fn vector_form_equals_the_scalar_one_bit_for_bit() {
        let candidates: Vec<Candidate> = fibonacci_sphere(77)
            .enumerate()
            .map(|(i, d)| Candidate { direction: d.as_vec3().to_array(), index: i as u32 })
            .collect();
        let shape = PolarShape::hemisphere(100, 24);
        let tables = NearestSites::new(shape, 1);
        let (mut vector, mut scalar) = (vec![u32::MAX; shape.len()], vec![u32::MAX; shape.len()]);
        for block in &tables.blocks {
            compare_dispatched(&candidates, block, &tables.tables, &mut vector);
            compare(&candidates, block, &tables.tables, &mut scalar);
        }
        assert_eq!(vector, scalar);
        assert!(!vector.contains(&u32::MAX));
    }
}
