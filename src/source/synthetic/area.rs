//! Resampling of lat-long grids by exact areas: overlaps in azimuth times overlaps in the cosine of theta.

use std::f64::consts::PI;

/// The source cells under one target cell: consecutive ones from `first` on, wrapping, with their fractions
/// of its area.
struct Overlap {
    first: usize,
    shares: Vec<f64>,
}

/// Overlaps of `to` columns with `from` columns of a full turn, the target shifted by `shift` source columns.
/// Computed in source columns, so that grids whose columns coincide give fractions of exactly 1.
fn column_overlaps(from: usize, to: usize, shift: f64) -> Vec<Overlap> {
    let step = from as f64 / to as f64;
    let cells = (0..to).map(|column| {
        let (start, end) = (column as f64 * step + shift, (column + 1) as f64 * step + shift);
        let first = start.floor();
        let count = (end.ceil() - first) as usize;
        let share = |i: usize| {
            let left = first + i as f64;
            (end.min(left + 1.0) - start.max(left)) / (end - start)
        };
        Overlap {
            first: first.rem_euclid(from as f64) as usize % from,
            shares: (0..count).map(share).collect(),
        }
    });
    cells.collect()
}

/// Overlaps of `to` rows with `from` rows, both covering the whole sphere, by solid angle.
fn row_overlaps(from: usize, to: usize) -> Vec<Overlap> {
    let edge = |row: usize, rows: usize| (PI * (row as f64 / rows as f64)).cos();
    let cells = (0..to).map(|row| {
        let (top, bottom) = (edge(row, to), edge(row + 1, to));
        // Integer arithmetic determines which source rows overlap.
        let (first, last) = (row * from / to, ((row + 1) * from).div_ceil(to));
        let share = |i: usize| (edge(i, from).min(top) - edge(i + 1, from).max(bottom)) / (top - bottom);
        Overlap { first, shares: (first..last).map(share).collect() }
    });
    cells.collect()
}

/// Means over target cells.
pub struct AreaMean {
    /// Columns of the source.
    from: usize,
    columns: Vec<Overlap>,
    rows: Vec<Overlap>,
    /// One target row, before it is written.
    line: Vec<[f64; 3]>,
}

impl AreaMean {
    /// From a grid of `[columns, rows]` to another, the target shifted by `shift` source columns; 0 means no
    /// shift.
    pub fn new(from: [usize; 2], to: [usize; 2], shift: f64) -> Self {
        Self {
            from: from[0],
            columns: column_overlaps(from[0], to[0], shift),
            rows: row_overlaps(from[1], to[1]),
            line: vec![[0.0; 3]; to[0]],
        }
    }

    /// Reads the source by (row, column) and writes every target cell.
    pub fn write(
        &mut self,
        source: impl Fn(usize, usize) -> [f64; 3],
        mut write: impl FnMut(usize, usize, [f64; 3]),
    ) {
        for (row, rows) in self.rows.iter().enumerate() {
            self.line.fill([0.0; 3]);
            for (source_row, row_share) in (rows.first..).zip(&rows.shares) {
                for (sum, columns) in self.line.iter_mut().zip(&self.columns) {
                    for (i, column_share) in columns.shares.iter().enumerate() {
                        let value = source(source_row, (columns.first + i) % self.from);
                        for channel in 0..3 {
                            sum[channel] += row_share * column_share * value[channel];
                        }
                    }
                }
            }
            for (column, value) in self.line.iter().enumerate() {
                write(row, column, *value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A smooth source with a spike, and its power per channel 0.
    fn source(row: usize, column: usize) -> [f64; 3] {
        let spike = if (row, column) == (5, 0) { 1e6 } else { 0.0 };
        [1.0 + (row * column % 7) as f64 + spike, 1.0, 0.0]
    }

    fn power(columns: usize, rows: usize, value: impl Fn(usize, usize) -> f64) -> f64 {
        let edge = |row: usize| (PI * (row as f64 / rows as f64)).cos();
        let line = |row: usize| (0..columns).map(|column| value(row, column)).sum::<f64>();
        (0..rows).map(|row| line(row) * (edge(row) - edge(row + 1)) / columns as f64).sum()
    }

    #[test]
    fn power_and_constants_are_kept_for_grids_that_do_not_fit() {
        for (from, to, shift) in [
            ([32, 16], [9, 5], 8.0),
            ([32, 16], [9, 5], -3.7),
            ([10, 7], [10, 7], 2.5),
            ([6, 4], [35, 19], 0.1),
            ([1, 1], [3, 2], 0.25),
        ] {
            let mut target = vec![[0.0; 3]; to[0] * to[1]];
            AreaMean::new(from, to, shift)
                .write(source, |row, column, value| target[row * to[0] + column] = value);
            let before = power(from[0], from[1], |row, column| source(row, column)[0]);
            let after = power(to[0], to[1], |row, column| target[row * to[0] + column][0]);
            assert!((after / before - 1.0).abs() < 1e-12, "{from:?} {to:?} {shift}");
            assert!(target.iter().all(|v| (v[1] - 1.0).abs() < 1e-12 && v[2] == 0.0));
        }
    }

    #[test]
    fn a_whole_shift_moves_every_bit() {
        let mut seen = 0;
        AreaMean::new([12, 6], [12, 6], -3.0).write(source, |row, column, value| {
            assert_eq!(value, source(row, (column + 9) % 12));
            seen += 1;
        });
        assert_eq!(seen, 72);
    }

    #[test]
    fn half_a_shift_shares_evenly_across_the_seam() {
        AreaMean::new([4, 2], [4, 2], 3.5).write(
            |_, column| [column as f64; 3],
            |_, column, value| assert_eq!(value[0], [1.5, 0.5, 1.5, 2.5][column]),
        );
    }
}
