use super::PiecewiseLinear;
use super::ring::{Ring, Rows};
use crate::math::{disc_from_square, square_from_disc};
use std::f64::consts::TAU;

/// The bicontinuous inverse transform of Havran et al. (2003, 2005), METHODS section 5.
///
/// A point of the unit square goes by the concentric map to the disc, where `t = r^2` is uniform and chooses
/// the height by the inverse of the radial CDF, and `phi_d / 2 pi` the azimuth by that of the ring at this
/// height. Both are continuous in the point and in the map's values, so that a small change of the map moves
/// samples little.
///
/// The density is the map interpolated linearly in z between row centres and constant beyond the first and
/// the last. With the row integrals `T_i` and the *unnormalised* row CDFs `C_i(phi)`, at the part x of the
/// way between two rows `T(x) = (1 - x) T_i + x T_(i+1)` and C likewise; normalising rows first would move
/// power off a sun that is one row high.
#[derive(Clone, Debug)]
pub struct Bicontinuous {
    /// Nodes: the pole, the row centres, the rim.
    radial: PiecewiseLinear,
    rows: Rows,
    row_count: usize,
    z_max: f64,
    is_normalised: bool,
}

impl Bicontinuous {
    /// A uniform distribution over rows with centres at `z_centres` (z = 1 - cos theta, ascending, within (0,
    /// `z_max`)), each of `columns` equal steps in azimuth.
    pub fn new(columns: usize, z_centres: &[f64], z_max: f64) -> Self {
        let nodes: Vec<f64> =
            std::iter::once(0.0).chain(z_centres.iter().copied()).chain(std::iter::once(z_max)).collect();
        Self {
            radial: PiecewiseLinear::new(&nodes),
            rows: Rows::new(columns, z_centres.len()),
            row_count: z_centres.len(),
            z_max,
            is_normalised: false,
        }
    }

    /// Normalises every row's CDF before rows are interpolated, as in the papers: the azimuth at the part x
    /// of the way between two rows then has the mean, with weights 1 - x and x, of their normalised
    /// distributions, however bright each is; a dark row counts as uniform.
    pub fn with_normalised_rows(self) -> Self {
        Self { is_normalised: true, ..self }
    }

    /// Takes new densities per solid angle, row-major.
    ///
    /// # Panics
    /// If the number of values is not that of the columns times the rows.
    pub fn update(&mut self, values: &[f32]) {
        self.rows.update(values);
        let first = self.rows.totals().take(1);
        let last = self.rows.totals().rev().take(1);
        self.radial.update(first.chain(self.rows.totals()).chain(last));
        if self.is_normalised {
            self.rows.normalise();
        }
    }

    /// Integral over solid angle of the interpolated values; only approximately that of the map.
    pub fn integral(&self) -> f64 {
        self.radial.integral()
    }

    /// Position `[z, phi]` for a point of the unit square.
    pub fn sample(&self, u: [f64; 2]) -> [f64; 2] {
        let [r, phi_d] = disc_from_square(u);
        let z = self.radial.sample(r * r);
        [z, self.ring(z).sample(phi_d / TAU)]
    }

    /// Density per solid angle.
    pub fn pdf(&self, [z, phi]: [f64; 2]) -> f64 {
        if !(0.0..=self.z_max).contains(&z) || !(0.0..TAU).contains(&phi) {
            return 0.0;
        }
        let total = self.integral();
        if total <= 0.0 {
            1.0 / (TAU * self.z_max)
        } else if self.is_normalised {
            self.radial.pdf(z) * self.ring(z).value(phi)
        } else {
            self.ring(z).value(phi) / total
        }
    }

    /// The point of the unit square of a position.
    pub fn invert(&self, [z, phi]: [f64; 2]) -> [f64; 2] {
        square_from_disc([self.radial.invert(z).sqrt(), TAU * self.ring(z).invert(phi)])
    }

    fn ring(&self, z: f64) -> Ring<'_> {
        // Segment i lies between nodes i and i + 1, that is between rows i - 1 and i.
        let (segment, x) = self.radial.locate(z);
        self.rows.between(segment.saturating_sub(1), segment.min(self.row_count - 1), x)
    }
}
