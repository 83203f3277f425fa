use super::piecewise::{bracket, unit};
use std::f64::consts::TAU;

/// Cumulative tables of rows of columns with equal steps in azimuth: for every row the unnormalised integral
/// over phi up to each column edge, in value times radian.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    columns: usize,
    cumulative: Vec<f64>,
}

impl Rows {
    /// Rows of zeros.
    pub(super) fn new(columns: usize, rows: usize) -> Self {
        Self { columns, cumulative: vec![0.0; (columns + 1) * rows] }
    }

    /// Takes new values, row-major. Negative values and NaN count as 0, infinity as `f32::MAX`.
    ///
    /// # Panics
    /// If the number of values is not that of the columns times the rows.
    pub(super) fn update(&mut self, values: &[f32]) {
        let stride = self.columns + 1;
        assert_eq!(values.len(), self.cumulative.len() / stride * self.columns, "one value for every column");
        // A running sum waits four cycles for each addition: several rows at once hide that.
        const TOGETHER: usize = 4;
        let step = TAU / self.columns as f64;
        for (tables, rows) in
            self.cumulative.chunks_mut(TOGETHER * stride).zip(values.chunks(TOGETHER * self.columns))
        {
            if rows.len() == TOGETHER * self.columns {
                let mut sums = [0.0f64; TOGETHER];
                for column in 0..self.columns {
                    for k in 0..TOGETHER {
                        sums[k] += clean(rows[k * self.columns + column]) * step;
                        tables[k * stride + column + 1] = sums[k];
                    }
                }
            } else {
                for (table, row) in tables.chunks_exact_mut(stride).zip(rows.chunks_exact(self.columns)) {
                    let mut sum = 0.0;
                    for (entry, &value) in table[1..].iter_mut().zip(row) {
                        sum += clean(value) * step;
                        *entry = sum;
                    }
                }
            }
        }
    }

    /// Makes the integral over each row 1, and a row of zeros uniform.
    pub(super) fn normalise(&mut self) {
        let columns = self.columns;
        for table in self.cumulative.chunks_exact_mut(columns + 1) {
            let total = table[columns];
            for (column, entry) in table.iter_mut().enumerate() {
                *entry = if total > 0.0 { *entry / total } else { column as f64 / columns as f64 };
            }
        }
    }

    /// Integral over each row.
    pub(super) fn totals(&self) -> impl DoubleEndedIterator<Item = f64> + Clone {
        self.cumulative.chunks_exact(self.columns + 1).map(|table| table[self.columns])
    }

    /// The distribution over azimuth of one row.
    pub(super) fn row(&self, row: usize) -> Ring<'_> {
        self.between(row, row, 0.0)
    }

    /// The distribution over azimuth at the part `x` of the way from row `lower` to row `upper`.
    pub(super) fn between(&self, lower: usize, upper: usize, x: f64) -> Ring<'_> {
        let stride = self.columns + 1;
        let table = |row: usize| &self.cumulative[row * stride..][..stride];
        Ring { lower: table(lower), upper: table(upper), x }
    }
}

/// Finite and not negative; NaN is 0, which `clamp` would pass on.
fn clean(value: f32) -> f64 {
    f64::from(if value > 0.0 { value.min(f32::MAX) } else { 0.0 })
}

/// Distribution over azimuth on a ring between two rows, whose unnormalised CDFs are mixed linearly.
pub(super) struct Ring<'a> {
    lower: &'a [f64],
    upper: &'a [f64],
    x: f64,
}

impl Ring<'_> {
    fn cumulative(&self, i: usize) -> f64 {
        (1.0 - self.x) * self.lower[i] + self.x * self.upper[i]
    }

    fn columns(&self) -> usize {
        self.lower.len() - 1
    }

    /// Integral over the ring, in value times radian.
    pub(super) fn integral(&self) -> f64 {
        self.cumulative(self.columns())
    }

    /// Azimuth in [0, 2 pi) for `u` in [0, 1].
    pub(super) fn sample(&self, u: f64) -> f64 {
        let (u, total) = (unit(u), self.integral());
        let turns = if total > 0.0 {
            let target = (u * total).min(total.next_down());
            let i = bracket(self.columns(), target, |i| self.cumulative(i));
            let (c0, c1) = (self.cumulative(i), self.cumulative(i + 1));
            (i as f64 + (target - c0) / (c1 - c0)) / self.columns() as f64
        } else {
            u
        };
        (turns * TAU).min(TAU.next_down())
    }

    /// Density of the values (not normalised) at azimuth `phi`.
    pub(super) fn value(&self, phi: f64) -> f64 {
        let (i, _) = self.locate(phi);
        (self.cumulative(i + 1) - self.cumulative(i)) * self.columns() as f64 / TAU
    }

    /// The `u` of an azimuth.
    pub(super) fn invert(&self, phi: f64) -> f64 {
        let total = self.integral();
        if total <= 0.0 {
            return unit(phi / TAU);
        }
        let (i, part) = self.locate(phi);
        let (c0, c1) = (self.cumulative(i), self.cumulative(i + 1));
        unit((c0 + part * (c1 - c0)) / total)
    }

    /// Column of an azimuth, and the part of the column below it.
    fn locate(&self, phi: f64) -> (usize, f64) {
        let position = unit(phi / TAU) * self.columns() as f64;
        let i = (position as usize).min(self.columns() - 1);
        (i, unit(position - i as f64))
    }
}
