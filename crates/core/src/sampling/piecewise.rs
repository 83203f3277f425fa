/// A density that is constant on each of a row of intervals.
#[derive(Clone, Debug)]
pub struct PiecewiseConstant {
    edges: Vec<f64>,
    /// Integral of the values up to each edge.
    cumulative: Vec<f64>,
}

impl PiecewiseConstant {
    /// A uniform distribution over `edges` (ascending, at least two).
    pub fn new(edges: &[f64]) -> Self {
        debug_assert!(edges.len() >= 2 && edges.windows(2).all(|e| e[0] < e[1]), "ascending edges");
        Self { edges: edges.to_vec(), cumulative: vec![0.0; edges.len()] }
    }

    /// Takes the densities of all intervals, which must be finite and >= 0.
    pub fn update(&mut self, values: impl IntoIterator<Item = f64>) {
        let mut sum = 0.0;
        for (i, value) in values.into_iter().take(self.edges.len() - 1).enumerate() {
            sum += value * (self.edges[i + 1] - self.edges[i]);
            self.cumulative[i + 1] = sum;
        }
    }

    /// Integral of the values.
    pub fn integral(&self) -> f64 {
        self.cumulative[self.cumulative.len() - 1]
    }

    /// Position for `u` in [0, 1].
    pub fn sample(&self, u: f64) -> f64 {
        let (u, total) = (unit(u), self.integral());
        let (first, last) = (self.edges[0], self.edges[self.edges.len() - 1]);
        if total <= 0.0 {
            return first + u * (last - first);
        }
        let target = (u * total).min(total.next_down());
        let i = bracket(self.edges.len() - 1, target, |i| self.cumulative[i]);
        let part = (target - self.cumulative[i]) / (self.cumulative[i + 1] - self.cumulative[i]);
        // Stays below the upper edge even after rounding, because the next interval may be empty.
        (self.edges[i] + part * (self.edges[i + 1] - self.edges[i])).min(self.edges[i + 1].next_down())
    }

    /// Density at `x`.
    pub fn pdf(&self, x: f64) -> f64 {
        let (first, last) = (self.edges[0], self.edges[self.edges.len() - 1]);
        if !(first..=last).contains(&x) {
            return 0.0;
        }
        let total = self.integral();
        if total <= 0.0 {
            return 1.0 / (last - first);
        }
        let i = self.interval(x);
        (self.cumulative[i + 1] - self.cumulative[i]) / (self.edges[i + 1] - self.edges[i]) / total
    }

    /// The `u` of a position.
    pub fn invert(&self, x: f64) -> f64 {
        let i = self.interval(x);
        let part = unit((x - self.edges[i]) / (self.edges[i + 1] - self.edges[i]));
        let total = self.integral();
        if total <= 0.0 {
            let (first, last) = (self.edges[0], self.edges[self.edges.len() - 1]);
            return unit((x - first) / (last - first));
        }
        let (c0, c1) = (self.cumulative[i], self.cumulative[i + 1]);
        unit((c0 + part * (c1 - c0)) / total)
    }

    /// Index of the interval that holds `x`; beyond the ends the first or the last.
    pub fn interval(&self, x: f64) -> usize {
        interval(&self.edges, x)
    }
}

/// A density that is linear between nodes.
#[derive(Clone, Debug)]
pub struct PiecewiseLinear {
    nodes: Vec<f64>,
    values: Vec<f64>,
    /// Integral of the density up to each node, by trapezoids, which are exact.
    cumulative: Vec<f64>,
}

impl PiecewiseLinear {
    /// A uniform distribution over `nodes` (ascending, at least two).
    pub fn new(nodes: &[f64]) -> Self {
        debug_assert!(nodes.len() >= 2 && nodes.windows(2).all(|e| e[0] < e[1]), "ascending nodes");
        Self { nodes: nodes.to_vec(), values: vec![0.0; nodes.len()], cumulative: vec![0.0; nodes.len()] }
    }

    /// Takes the densities at all nodes, which must be finite and >= 0.
    pub fn update(&mut self, values: impl IntoIterator<Item = f64>) {
        let mut sum = 0.0;
        for (i, value) in values.into_iter().take(self.nodes.len()).enumerate() {
            self.values[i] = value;
            if i > 0 {
                sum += 0.5 * (self.values[i - 1] + value) * (self.nodes[i] - self.nodes[i - 1]);
            }
            self.cumulative[i] = sum;
        }
    }

    /// Integral of the density.
    pub fn integral(&self) -> f64 {
        self.cumulative[self.cumulative.len() - 1]
    }

    /// Position for `u` in [0, 1].
    ///
    /// On a segment of width h whose ends have densities a and b, the integral up to the part x of the
    /// segment is `c = h (a x + (b - a) x^2 / 2)`. Of the two forms of the root, the one with the square root
    /// in the denominator has no cancellation and needs no case for a = b:
    ///
    /// ```text
    /// x = 2 (c/h) / (a + sqrt(a^2 + 2 (b - a) c/h))
    /// ```
    pub fn sample(&self, u: f64) -> f64 {
        let (u, total) = (unit(u), self.integral());
        let (first, last) = (self.nodes[0], self.nodes[self.nodes.len() - 1]);
        if total <= 0.0 {
            return first + u * (last - first);
        }
        let target = (u * total).min(total.next_down());
        let i = bracket(self.nodes.len() - 1, target, |i| self.cumulative[i]);
        let (a, b, h) = (self.values[i], self.values[i + 1], self.nodes[i + 1] - self.nodes[i]);
        let c = (target - self.cumulative[i]) / h;
        // Scaled by the larger density, so that squares of huge or tiny ones neither overflow nor vanish.
        let scale = a.max(b);
        let (a, b, c) = (a / scale, b / scale, c / scale);
        let denominator = a + (a * a + 2.0 * (b - a) * c).max(0.0).sqrt();
        let x = if denominator > 0.0 { unit(2.0 * c / denominator) } else { 0.0 };
        (self.nodes[i] + x * h).min(self.nodes[i + 1])
    }

    /// Density at `x`.
    pub fn pdf(&self, x: f64) -> f64 {
        let (first, last) = (self.nodes[0], self.nodes[self.nodes.len() - 1]);
        if !(first..=last).contains(&x) {
            return 0.0;
        }
        let total = self.integral();
        if total <= 0.0 {
            return 1.0 / (last - first);
        }
        let (i, part) = self.locate(x);
        ((1.0 - part) * self.values[i] + part * self.values[i + 1]) / total
    }

    /// The `u` of a position.
    pub fn invert(&self, x: f64) -> f64 {
        let total = self.integral();
        if total <= 0.0 {
            let (first, last) = (self.nodes[0], self.nodes[self.nodes.len() - 1]);
            return unit((x - first) / (last - first));
        }
        let (i, part) = self.locate(x);
        let (a, b, h) = (self.values[i], self.values[i + 1], self.nodes[i + 1] - self.nodes[i]);
        unit((self.cumulative[i] + h * part * (a + 0.5 * (b - a) * part)) / total)
    }

    /// Segment that holds `x` (beyond the ends the first or the last) and the part of it below `x`, in [0,
    /// 1].
    pub fn locate(&self, x: f64) -> (usize, f64) {
        let i = interval(&self.nodes, x);
        (i, unit((x - self.nodes[i]) / (self.nodes[i + 1] - self.nodes[i])))
    }
}

/// Clamped to [0, 1]; NaN is 0, which `clamp` would pass on.
pub(super) fn unit(u: f64) -> f64 {
    if u > 0.0 { u.min(1.0) } else { 0.0 }
}

/// Index of the interval of ascending `edges` that holds `x`; beyond the ends the first or the last.
fn interval(edges: &[f64], x: f64) -> usize {
    edges.partition_point(|&edge| edge <= x).clamp(1, edges.len() - 1) - 1
}

/// The interval `i` of `count` with `cumulative(i) <= target < cumulative(i + 1)`, by bisection: never one
/// without mass. `cumulative` does not decrease, starts at 0 <= target and ends above it.
pub(super) fn bracket(count: usize, target: f64, cumulative: impl Fn(usize) -> f64) -> usize {
    let (mut low, mut high) = (0, count);
    while high - low > 1 {
        let middle = low.midpoint(high);
        if cumulative(middle) <= target {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `sample` and `invert` undo each other, `pdf` is the derivative of `invert`.
    fn check(name: &str, sample: impl Fn(f64) -> f64, pdf: impl Fn(f64) -> f64, invert: impl Fn(f64) -> f64) {
        for i in 0..1000 {
            let u = (f64::from(i) + 0.5) / 1000.0;
            let x = sample(u);
            assert!((invert(x) - u).abs() < 1e-12, "{name}: {u} to {x} to {}", invert(x));
            let h = 1e-7;
            let slope = (invert(x + h) - invert(x - h)) / (2.0 * h);
            // A node within h, or the end, has a kink: there the slope is that of neither side.
            let kink = (pdf(x + 2.0 * h) - pdf(x - 2.0 * h)).abs() > 1e-3;
            assert!(
                kink || (slope - pdf(x)).abs() < 1e-5 * (1.0 + pdf(x)),
                "{name}: {x}: {slope} {}",
                pdf(x)
            );
        }
    }

    #[test]
    fn constant_pieces_by_hand() {
        let mut d = PiecewiseConstant::new(&[0.0, 1.0, 3.0, 4.0]);
        d.update([1.0, 0.0, 3.0]);
        assert_eq!(d.integral(), 4.0);
        assert_eq!((d.sample(0.125), d.sample(0.25), d.sample(0.625)), (0.5, 3.0, 3.5));
        assert_eq!((d.pdf(0.5), d.pdf(2.0), d.pdf(3.5), d.pdf(-1.0)), (0.25, 0.0, 0.75, 0.0));
        check("constant", |u| d.sample(u), |x| d.pdf(x), |x| d.invert(x));
        assert!(d.sample(1.0) <= 4.0 && d.sample(f64::NAN) == 0.0);
    }

    #[test]
    fn linear_pieces_by_hand() {
        let mut d = PiecewiseLinear::new(&[0.0, 1.0, 2.0, 4.0]);
        d.update([0.0, 2.0, 0.0, 0.0]);
        assert_eq!(d.integral(), 2.0);
        // A tent: u = x^2 / 2 on its first half.
        assert!((d.sample(0.125) - 0.5).abs() < 1e-15 && (d.sample(0.5) - 1.0).abs() < 1e-15);
        assert!((d.sample(0.875) - 1.5).abs() < 1e-15 && d.sample(1.0) <= 2.0);
        assert_eq!((d.pdf(0.5), d.pdf(3.0)), (0.5, 0.0));
        check("linear", |u| d.sample(u), |x| d.pdf(x), |x| d.invert(x));
    }

    #[test]
    fn no_mass_is_uniform_and_updates_forget() {
        let mut constant = PiecewiseConstant::new(&[0.0, 0.5, 2.0]);
        let mut linear = PiecewiseLinear::new(&[0.0, 0.5, 2.0]);
        for _ in 0..2 {
            constant.update([0.0, 0.0]);
            linear.update([0.0, 0.0, 0.0]);
            assert_eq!((constant.sample(0.25), constant.invert(0.5), constant.pdf(1.0)), (0.5, 0.25, 0.5));
            assert_eq!((linear.sample(0.25), linear.invert(0.5), linear.pdf(1.0)), (0.5, 0.25, 0.5));
            constant.update([1e300, 1e-300]);
            linear.update([1e300, 0.0, 1e-300]);
            assert!(constant.sample(0.5).is_finite() && linear.sample(0.5).is_finite());
        }
    }
}
