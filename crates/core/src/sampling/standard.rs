use super::PiecewiseConstant;
use super::ring::Rows;
use std::f64::consts::TAU;

/// The standard inverse transform: first the row by its marginal, then the azimuth within the row. The
/// baseline: it has a seam at phi = 0 and crowds samples at the pole.
///
/// The first coordinate of the unit square is the azimuth's, the second the polar angle's.
#[derive(Clone, Debug)]
pub struct Standard {
    marginal: PiecewiseConstant,
    rows: Rows,
}

impl Standard {
    /// A uniform distribution over rows between `z_edges` (z = 1 - cos theta, ascending, one more than rows),
    /// each of `columns` equal steps in azimuth.
    pub fn new(columns: usize, z_edges: &[f64]) -> Self {
        Self { marginal: PiecewiseConstant::new(z_edges), rows: Rows::new(columns, z_edges.len() - 1) }
    }

    /// Takes new densities per solid angle, row-major.
    ///
    /// # Panics
    /// If the number of values is not that of the columns times the rows.
    pub fn update(&mut self, values: &[f32]) {
        self.rows.update(values);
        self.marginal.update(self.rows.totals());
    }

    /// Integral of the values over solid angle.
    pub fn integral(&self) -> f64 {
        self.marginal.integral()
    }

    /// Position `[z, phi]` for a point of the unit square.
    pub fn sample(&self, u: [f64; 2]) -> [f64; 2] {
        let z = self.marginal.sample(u[1]);
        [z, self.rows.row(self.marginal.interval(z)).sample(u[0])]
    }

    /// Density per solid angle.
    pub fn pdf(&self, [z, phi]: [f64; 2]) -> f64 {
        let marginal = self.marginal.pdf(z);
        if !(0.0..TAU).contains(&phi) {
            return 0.0;
        }
        let ring = self.rows.row(self.marginal.interval(z));
        let total = ring.integral();
        marginal * if total > 0.0 { ring.value(phi) / total } else { 1.0 / TAU }
    }

    /// The point of the unit square of a position.
    pub fn invert(&self, [z, phi]: [f64; 2]) -> [f64; 2] {
        [self.rows.row(self.marginal.interval(z)).invert(phi), self.marginal.invert(z)]
    }
}
