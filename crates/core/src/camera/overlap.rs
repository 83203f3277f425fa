//! Exact overlap of a polygon in the equal-area cylinder with the pixels of a polar map.

use super::chart::ChartPoint;
use crate::image::PolarShape;
use std::f64::consts::TAU;

/// The rectangles of a polar map, and a window of cells to sum overlaps in.
pub(super) struct OverlapGrid {
    columns: usize,
    /// cos theta of the row edges, from 1 down.
    z_edges: Vec<f64>,
    /// Row of the last polygon's top, where the search for that of a neighbour starts.
    row: usize,
    /// Overlaps of the cells in the window of the current polygon, row-major.
    window: Vec<f64>,
}

impl OverlapGrid {
    pub(super) fn new(shape: PolarShape) -> Self {
        Self {
            columns: shape.columns(),
            z_edges: (0..=shape.rows()).map(|row| shape.theta_edge_rad(row).cos()).collect(),
            row: 0,
            window: Vec::new(),
        }
    }

    /// Calls `emit(cell, solid_angle_sr)` for every pixel of the map that a closed polygon (first point =
    /// last point, `integral z dphi` positive) overlaps, and returns the polygon's solid angle, 0 where the
    /// polygon lies outside the map.
    ///
    /// Green's theorem cell by cell: the overlap with a cell between z_low and z_high is the integral of
    /// `clamp(z, z_low, z_high) - z_low` over the boundary's dphi inside the cell's columns. Every boundary
    /// segment adds its share independently, so polygons with a common boundary share out the cells exactly,
    /// whatever their form.
    pub(super) fn overlaps(&mut self, polygon: &[ChartPoint], mut emit: impl FnMut(usize, f64)) -> f64 {
        let [mut phi_low, mut z_low] = [f64::INFINITY; 2];
        let [mut phi_high, mut z_high] = [f64::NEG_INFINITY; 2];
        for &[phi, z] in polygon {
            (phi_low, phi_high) = (phi_low.min(phi), phi_high.max(phi));
            (z_low, z_high) = (z_low.min(z), z_high.max(z));
        }
        let total_sr: f64 = polygon.windows(2).map(|p| 0.5 * (p[0][1] + p[1][1]) * (p[1][0] - p[0][0])).sum();
        let rows = self.z_edges.len() - 1;
        // A polygon without positive area is a sliver from rounding; one below the map's rim is not seen.
        if polygon.len() < 4 || total_sr.is_nan() || total_sr <= 0.0 || z_high <= self.z_edges[rows] {
            return 0.0;
        }
        let per_radian = self.columns as f64 / TAU;
        let top = self.row_of(z_high, self.row);
        self.row = top;
        let bottom = self.row_of(z_low, top);
        let first_column = (phi_low * per_radian).floor() as i64;
        let last_column = (phi_high * per_radian).floor() as i64;
        let cell =
            |row: usize, column: i64| row * self.columns + column.rem_euclid(self.columns as i64) as usize;
        if top == bottom && first_column == last_column && z_low >= self.z_edges[rows] {
            emit(cell(top, first_column), total_sr);
            return total_sr;
        }
        let width = (last_column - first_column + 1) as usize;
        self.window.clear();
        self.window.resize(width * (bottom - top + 1), 0.0);
        for pair in polygon.windows(2) {
            let ([phi_a, z_a], [phi_b, z_b]) = (pair[0], pair[1]);
            if phi_a == phi_b {
                continue;
            }
            let slope = (z_b - z_a) / (phi_b - phi_a);
            let (low, high) = (phi_a.min(phi_b) * per_radian, phi_a.max(phi_b) * per_radian);
            for column in low.floor() as i64..=high.floor() as i64 {
                let from = low.max(column as f64) / per_radian;
                let to = high.min(column as f64 + 1.0) / per_radian;
                let turn_rad = if phi_b > phi_a { to - from } else { from - to };
                let (z_from, z_to) = (z_a + slope * (from - phi_a), z_a + slope * (to - phi_a));
                let index = (column - first_column).clamp(0, width as i64 - 1) as usize;
                for row in top..=bottom {
                    let (upper, lower) = (self.z_edges[row], self.z_edges[row + 1]);
                    self.window[(row - top) * width + index] +=
                        turn_rad * mean_above(z_from - lower, z_to - lower, upper - lower);
                }
            }
        }
        // Columns may occur twice where the window goes all the way round: the caller adds them up. Slivers
        // that come only from rounding are added to the largest part, so that nothing is lost.
        let (mut largest, mut slivers) = (0, 0.0);
        for index in 0..self.window.len() {
            if self.window[index] > self.window[largest] {
                largest = index;
            }
            let row = top + index / width;
            let cell_sr = (self.z_edges[row] - self.z_edges[row + 1]) / per_radian;
            if self.window[index] < (SLIVER * total_sr).min(SLIVER_OF_CELL * cell_sr) {
                slivers += self.window[index];
                self.window[index] = 0.0;
            }
        }
        self.window[largest] += slivers;
        for (index, &overlap_sr) in self.window.iter().enumerate() {
            if overlap_sr > 0.0 {
                emit(cell(top + index / width, first_column + (index % width) as i64), overlap_sr);
            }
        }
        total_sr
    }

    /// The row that holds z (the last one for what lies below the map), searched from a neighbour's row.
    fn row_of(&self, z: f64, near: usize) -> usize {
        let mut row = near;
        while row > 0 && z > self.z_edges[row] {
            row -= 1;
        }
        while row + 2 < self.z_edges.len() && z < self.z_edges[row + 1] {
            row += 1;
        }
        row
    }
}

/// Overlaps below this fraction of the frame's pixel are rounding, not light: 1e-9 of a sun of 1e6 is 1e-3.
const SLIVER: f64 = 1e-9;

/// They must also be below this fraction of the map's pixel, which may be far smaller than the frame's.
const SLIVER_OF_CELL: f64 = 1e-6;

/// Mean of `clamp(z, 0, height)` for z going linearly from a to b.
fn mean_above(a: f64, b: f64, height: f64) -> f64 {
    if a <= 0.0 && b <= 0.0 {
        return 0.0;
    }
    if a >= height && b >= height {
        return height;
    }
    if a >= 0.0 && b >= 0.0 && a <= height && b <= height {
        return 0.5 * (a + b);
    }
    // The integral of the clamp from 0 to z. The segment crosses 0 or the height, so a and b differ.
    let integral = |z: f64| 0.5 * z.clamp(0.0, height).powi(2) + height * (z - height).max(0.0);
    if (b - a).abs() < 1e-12 * height {
        return (0.5 * (a + b)).clamp(0.0, height);
    }
    (integral(b) - integral(a)) / (b - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn overlaps(shape: PolarShape, polygon: &[ChartPoint]) -> (Vec<f64>, f64) {
        let mut cells = vec![0.0; shape.len()];
        let total = OverlapGrid::new(shape).overlaps(polygon, |cell, sr| cells[cell] += sr);
        (cells, total)
    }

    #[test]
    fn a_rectangle_over_the_seam_shares_out_by_products() {
        // Two rows: z from 1 to 0 and from 0 to -1 with theta edges 0, pi/2, pi; four columns.
        let shape = PolarShape::sphere(4, 2);
        let (west, east, low, high) = (-0.2, 0.5, -0.1, 0.3);
        let (cells, total) =
            overlaps(shape, &[[west, high], [east, high], [east, low], [west, low], [west, high]]);
        assert!((total - 0.7 * 0.4).abs() < 1e-15);
        for (cell, expected) in
            [(0, 0.5 * 0.3), (3, 0.2 * 0.3), (4, 0.5 * 0.1), (7, 0.2 * 0.1), (1, 0.0), (6, 0.0)]
        {
            assert!((cells[cell] - expected).abs() < 1e-15, "{cell}: {}", cells[cell]);
        }
    }

    #[test]
    fn a_concave_polygon_agrees_with_counting_points() {
        let shape = PolarShape::sphere(16, 8);
        let polygon = [[1.0, 0.8], [2.9, 0.7], [2.0, 0.2], [3.3, -0.6], [0.7, -0.9], [1.6, 0.1], [1.0, 0.8]];
        let (cells, total) = overlaps(shape, &polygon);
        let inside = |x: f64, y: f64| {
            polygon.windows(2).fold(false, |inside, p| {
                let ([xa, ya], [xb, yb]) = (p[0], p[1]);
                inside ^ ((ya > y) != (yb > y) && x < (xb - xa) * (y - ya) / (yb - ya) + xa)
            })
        };
        let mut counted = vec![0.0; shape.len()];
        let steps = 2000;
        let unit = 3.0 / f64::from(steps) * 2.0 / f64::from(steps);
        for i in 0..steps {
            for j in 0..steps {
                let (x, y) = (
                    0.5 + 3.0 * (f64::from(i) + 0.5) / f64::from(steps),
                    1.0 - 2.0 * (f64::from(j) + 0.5) / f64::from(steps),
                );
                if inside(x, y) {
                    let row = (0..8).find(|&row| y > shape.theta_edge_rad(row + 1).cos()).unwrap();
                    counted[row * 16 + (x * 16.0 / TAU) as usize] += unit;
                }
            }
        }
        for (exact, counted) in cells.iter().zip(&counted) {
            // A cell's border crosses about 500 of the counted points.
            assert!((exact - counted).abs() < 500.0 * unit, "{exact} {counted}");
        }
        assert!((cells.iter().sum::<f64>() - total).abs() < 1e-14);
    }

    #[test]
    fn what_lies_below_the_rim_is_cut_off() {
        let shape = PolarShape::hemisphere(4, 1);
        let (cells, total) = overlaps(shape, &[[0.1, 0.5], [0.3, 0.5], [0.3, -0.5], [0.1, -0.5], [0.1, 0.5]]);
        assert!((total - 0.2).abs() < 1e-15);
        assert!((cells[0] - 0.1).abs() < 1e-15, "{}", cells[0]);
        assert_eq!(
            overlaps(shape, &[[0.1, -0.2], [0.3, -0.2], [0.3, -0.5], [0.1, -0.5], [0.1, -0.2]]).1,
            0.0
        );
    }
}
