use super::halton;

/// Lattice points per side over which Voronoi cells are measured. 256 x 256 are the points of METHODS'
/// tables.
const LATTICE: usize = 256;

/// The `count` points at which distributions are sampled: 2D Halton from index 1 (bases 2 and 3), then
/// `relaxation_steps` steps of [`relax`]. Start-up work: it allocates.
pub fn sample_points(count: usize, relaxation_steps: usize) -> Vec<[f64; 2]> {
    let mut points: Vec<[f64; 2]> = (1..=count as u64).map(|i| [halton(i, 2), halton(i, 3)]).collect();
    for _ in 0..relaxation_steps {
        relax(&mut points);
    }
    points
}

/// One step of Lloyd's relaxation on the torus: every point of the unit square moves to the mean of the 256 x
/// 256 lattice points (at cell centres) that are nearest to it. A few steps bring a Halton set towards blue
/// noise. Coordinates stay in [0, 1); of two coinciding points the first gets the cell and the other stays.
pub fn relax(points: &mut [[f64; 2]]) {
    if points.is_empty() {
        return;
    }
    let grid = Grid::new(points);
    let mut sums = vec![([0.0; 2], 0u32); points.len()];
    for row in 0..LATTICE {
        for column in 0..LATTICE {
            let x = [(column as f64 + 0.5) / LATTICE as f64, (row as f64 + 0.5) / LATTICE as f64];
            let (index, offset) = grid.nearest(points, x);
            let (sum, count) = &mut sums[index];
            sum[0] += offset[0];
            sum[1] += offset[1];
            *count += 1;
        }
    }
    for (point, (sum, count)) in points.iter_mut().zip(sums) {
        if count > 0 {
            for axis in 0..2 {
                // rem_euclid rounds tiny negative values up to 1.
                let moved = (point[axis] + sum[axis] / f64::from(count)).rem_euclid(1.0);
                point[axis] = if moved >= 1.0 { 0.0 } else { moved };
            }
        }
    }
}

/// Vector from `a` to `b` on the torus: the shortest one, components in [-0.5, 0.5].
fn torus_offset(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|axis| {
        let d = b[axis] - a[axis];
        // Both lie in [0, 1). Comparing is much faster than `d - d.round()`, a library call on plain x86-64.
        if d > 0.5 {
            d - 1.0
        } else if d < -0.5 {
            d + 1.0
        } else {
            d
        }
    })
}

/// Points sorted into square buckets, for nearest-point searches on the torus.
struct Grid {
    side: usize,
    starts: Vec<usize>,
    order: Vec<usize>,
}

impl Grid {
    fn new(points: &[[f64; 2]]) -> Self {
        // About two points a bucket: most searches end after the first ring.
        let side = ((points.len() as f64 / 2.0).sqrt() as usize).max(1);
        let bucket = |p: &[f64; 2]| Self::cell(side, p[1]) * side + Self::cell(side, p[0]);
        let mut starts = vec![0; side * side + 1];
        for point in points {
            starts[bucket(point) + 1] += 1;
        }
        for i in 0..side * side {
            starts[i + 1] += starts[i];
        }
        let mut order: Vec<usize> = (0..points.len()).collect();
        order.sort_by_key(|&i| bucket(&points[i])); // stable: ascending indices within a bucket
        Self { side, starts, order }
    }

    fn cell(side: usize, x: f64) -> usize {
        ((x * side as f64) as usize).min(side - 1)
    }

    /// Index of the point nearest to `x` (the lowest of equals) and the offset from it to `x`.
    fn nearest(&self, points: &[[f64; 2]], x: [f64; 2]) -> (usize, [f64; 2]) {
        let side = self.side as isize;
        let home = x.map(|c| Self::cell(self.side, c) as isize);
        // The index is at most one side beyond either end: comparing saves two divisions for every bucket.
        let wrap = |i: isize| {
            (if i < 0 {
                i + side
            } else if i >= side {
                i - side
            } else {
                i
            }) as usize
        };
        let (mut best, mut best_square, mut best_offset) = (usize::MAX, f64::INFINITY, [0.0; 2]);
        for ring in 0..=side / 2 {
            for dy in -ring..=ring {
                // Inner columns of a ring are its first and last only.
                let step = if dy.abs() == ring { 1 } else { (2 * ring).max(1) };
                let mut dx = -ring;
                while dx <= ring {
                    let bucket = wrap(home[1] + dy) * self.side + wrap(home[0] + dx);
                    for &i in &self.order[self.starts[bucket]..self.starts[bucket + 1]] {
                        let offset = torus_offset(points[i], x);
                        let square = offset[0] * offset[0] + offset[1] * offset[1];
                        if square < best_square || (square == best_square && i < best) {
                            (best, best_square, best_offset) = (i, square, offset);
                        }
                    }
                    dx += step;
                }
            }
            // Whatever lies outside of this ring is at least `ring` buckets from the home bucket's sides.
            let reached = ring as f64 / side as f64;
            if best_square < reached * reached {
                break;
            }
        }
        (best, best_offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn relax_slowly(points: &mut [[f64; 2]]) {
        let mut sums = vec![([0.0; 2], 0.0); points.len()];
        for row in 0..LATTICE {
            for column in 0..LATTICE {
                let x = [(column as f64 + 0.5) / LATTICE as f64, (row as f64 + 0.5) / LATTICE as f64];
                let mut best = (f64::INFINITY, 0);
                for (i, &point) in points.iter().enumerate() {
                    let offset = torus_offset(point, x);
                    let square = offset[0] * offset[0] + offset[1] * offset[1];
                    if square < best.0 {
                        best = (square, i);
                    }
                }
                let offset = torus_offset(points[best.1], x);
                sums[best.1].0[0] += offset[0];
                sums[best.1].0[1] += offset[1];
                sums[best.1].1 += 1.0;
            }
        }
        for (point, (sum, count)) in points.iter_mut().zip(sums) {
            for axis in 0..2 {
                if count > 0.0 {
                    point[axis] = (point[axis] + sum[axis] / count).rem_euclid(1.0);
                }
            }
        }
    }

    #[test]
    fn a_step_equals_the_slow_one_for_any_count() {
        for count in [1, 2, 3, 7, 64, 300] {
            let mut fast = sample_points(count, 0);
            let mut slow = fast.clone();
            relax(&mut fast);
            relax_slowly(&mut slow);
            for (f, s) in fast.iter().zip(&slow) {
                assert!(torus_offset(*f, *s).iter().all(|d| d.abs() < 1e-12), "{count}: {f:?} {s:?}");
            }
        }
    }

    #[test]
    fn relaxation_drives_the_closest_pair_apart() {
        let closest = |points: &[[f64; 2]]| {
            let mut least = f64::INFINITY;
            for i in 0..points.len() {
                for j in 0..i {
                    let d = torus_offset(points[i], points[j]);
                    least = least.min(d[0].hypot(d[1]));
                }
            }
            least
        };
        let (halton, relaxed) = (closest(&sample_points(256, 0)), closest(&sample_points(256, 4)));
        // The densest packing of 256 points has distance 1.07 / 16; blue noise reaches about 0.7 of it.
        assert!(relaxed > 1.5 * halton && relaxed > 0.5 * 1.07 / 16.0, "{halton} to {relaxed}");
    }

    #[test]
    fn coinciding_points_and_more_points_than_lattice_cells_stay_finite() {
        let mut twins = vec![[0.3, 0.3]; 5];
        relax(&mut twins);
        assert_eq!(&twins[1..], [[0.3, 0.3]; 4]);
        let mut crowd = sample_points(70_000, 0);
        relax(&mut crowd);
        assert!(crowd.iter().flatten().all(|x| (0.0..1.0).contains(x)));
        assert!(sample_points(0, 4).is_empty());
    }
}
