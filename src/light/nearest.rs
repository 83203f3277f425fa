//! Which site is nearest to each pixel: the Voronoi cells of METHODS section 6, exactly.
//!
//! The map is cut into blocks of about the same angular size. A site can only win a pixel of a block if its
//! bisector with the site t that is nearest to the block's centre c crosses the block. With the block inside a cap
//! of radius rho < pi/2 about c, a site s loses everywhere in it if `c . (t - s) > |t - s| sin rho`, because then
//! every direction p of the cap has `p . (t - s) > 0`. What is left, a handful of sites, is compared pixel by pixel.

use crate::image::PolarShape;
use multiversion::multiversion;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

/// Pixels that are compared together.
const LANES: usize = 16;

/// Angular size of a block. Larger blocks keep more candidates for every pixel, smaller ones look at all sites more
/// often; of 3 to 12 degrees this was the fastest at 300 sites.
const BLOCK_SIZE_RAD: f64 = 8.0 * TAU / 360.0;

/// A site is ruled out for a block if it loses by more than this. Dot products in f32 are off by up to 3e-7: with
/// the slack whatever is ruled out would also have lost in f32, and the result is that of comparing all sites.
const SLACK: f32 = 2e-6;

/// Assigns every pixel of maps of one shape to its nearest site.
#[derive(Clone, Debug)]
pub struct NearestSites {
    shape: PolarShape,
    blocks: Vec<Block>,
    /// Per column, padded to a multiple of [`LANES`].
    cos_phi: Vec<f32>,
    sin_phi: Vec<f32>,
    /// Per row.
    sin_theta: Vec<f32>,
    cos_theta: Vec<f32>,
    /// Of the frame: sites by coordinate, padded to a multiple of [`LANES`], and those that a block needs.
    sites: Sites,
    candidates: Vec<Candidate>,
}

#[derive(Clone, Debug)]
struct Block {
    rows: Range<usize>,
    /// A multiple of [`LANES`] long; may reach into the padding.
    columns: Range<usize>,
    centre: [f32; 3],
    /// Sine of the radius of the cap about `centre` that holds all pixel centres; infinite from a right angle on.
    sin_radius: f32,
}

#[derive(Clone, Debug, Default)]
struct Sites {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    /// Scratch: how much each loses to the best at the centre of the block, less the bound; <= 0 is a candidate.
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
        let padded = shape.columns.next_multiple_of(LANES);
        let phi = |column: usize| TAU * (column.min(shape.columns - 1) as f64 + 0.5) / shape.columns as f64;
        let theta = |row: usize| shape.theta_max_rad * (row as f64 + 0.5) / shape.rows as f64;
        let capacity = site_count.next_multiple_of(LANES);
        let scratch = || Vec::with_capacity(capacity);
        Self {
            shape,
            blocks: blocks(shape, padded),
            cos_phi: (0..padded).map(|c| phi(c).cos() as f32).collect(),
            sin_phi: (0..padded).map(|c| phi(c).sin() as f32).collect(),
            sin_theta: (0..shape.rows).map(|r| theta(r).sin() as f32).collect(),
            cos_theta: (0..shape.rows).map(|r| theta(r).cos() as f32).collect(),
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
        let columns = self.shape.columns;
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
            for row in block.rows.clone() {
                for start in block.columns.clone().step_by(LANES) {
                    let best = nearest_of(
                        &self.candidates,
                        self.sin_theta[row],
                        self.cos_theta[row],
                        lanes(&self.cos_phi[start..]),
                        lanes(&self.sin_phi[start..]),
                    );
                    let end = (start + LANES).min(columns);
                    nearest[row * columns..][start..end].copy_from_slice(&best[..end - start]);
                }
            }
        }
    }
}

fn lanes(values: &[f32]) -> &[f32; LANES] {
    values.first_chunk().expect("tables are padded to whole lanes")
}

/// Blocks that tile the map.
fn blocks(shape: PolarShape, padded: usize) -> Vec<Block> {
    let row_height = shape.theta_max_rad / shape.rows as f64;
    let height = ((BLOCK_SIZE_RAD / row_height).round() as usize).clamp(1, shape.rows);
    let mut blocks = Vec::new();
    for first in (0..shape.rows).step_by(height) {
        let rows = first..(first + height).min(shape.rows);
        let middle = 0.5 * (shape.theta_edge_rad(rows.start) + shape.theta_edge_rad(rows.end));
        let step = middle.sin() * TAU / shape.columns as f64;
        let width = ((BLOCK_SIZE_RAD / step).min(padded as f64) as usize).next_multiple_of(LANES).max(LANES);
        for first in (0..padded).step_by(width) {
            let columns = first..(first + width).min(padded);
            let end = columns.end.min(shape.columns);
            let phi = TAU * 0.5 * (columns.start + end) as f64 / shape.columns as f64;
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

/// For every site s, with t the nearest to `centre`: `c . (t - s) - |t - s| sin_radius - SLACK`.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
fn margins(x: &[f32], y: &[f32], z: &[f32], margin: &mut [f32], centre: [f32; 3], sin_radius: f32) {
    let mut best = [f32::NEG_INFINITY; LANES];
    let chunks = x.as_chunks::<LANES>().0.iter().zip(y.as_chunks::<LANES>().0).zip(z.as_chunks::<LANES>().0);
    for (((x, y), z), margin) in chunks.clone().zip(margin.as_chunks_mut::<LANES>().0) {
        for lane in 0..LANES {
            let dot = centre[0] * x[lane] + centre[1] * y[lane] + centre[2] * z[lane];
            margin[lane] = dot;
            best[lane] = if dot > best[lane] { dot } else { best[lane] };
        }
    }
    let top = best.into_iter().fold(f32::NEG_INFINITY, f32::max);
    let nearest = margin.iter().position(|&dot| dot >= top).unwrap_or(0);
    let t = [x[nearest], y[nearest], z[nearest]];
    for (((x, y), z), margin) in chunks.zip(margin.as_chunks_mut::<LANES>().0) {
        for lane in 0..LANES {
            let (dx, dy, dz) = (t[0] - x[lane], t[1] - y[lane], t[2] - z[lane]);
            let length = (dx * dx + dy * dy + dz * dz).sqrt();
            // An infinite sine times a length of 0 is NaN; `max` against the finite bound takes it out.
            let reach = (length * sin_radius).max(0.0);
            margin[lane] = top - margin[lane] - reach - SLACK;
        }
    }
}

/// Index of the candidate with the largest dot product, for [`LANES`] pixels of a row; the first of equals.
///
/// The dot product is `(px sx + py sy) + pz sz` without fused operations, on every target: results are the same
/// bit for bit.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2", "aarch64+neon"))]
fn nearest_of(
    candidates: &[Candidate],
    sin_theta: f32,
    cos_theta: f32,
    cos_phi: &[f32; LANES],
    sin_phi: &[f32; LANES],
) -> [u32; LANES] {
    let (mut px, mut pz) = ([0.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        px[lane] = sin_theta * cos_phi[lane];
        pz[lane] = sin_theta * sin_phi[lane];
    }
    let mut best = [f32::NEG_INFINITY; LANES];
    let mut index = [0; LANES];
    for candidate in candidates {
        let [x, y, z] = candidate.direction;
        for lane in 0..LANES {
            let dot = px[lane] * x + cos_theta * y + pz[lane] * z;
            let better = dot > best[lane];
            best[lane] = if better { dot } else { best[lane] };
            index[lane] = if better { candidate.index } else { index[lane] };
        }
    }
    index
}
