/// Value below which a fraction of sorted values lies, linear between neighbours; 0 for no values.
pub fn percentile(sorted: &[f64], fraction: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let position = fraction * last as f64;
    let below = (position as usize).min(last);
    let above = (below + 1).min(last);
    sorted[below] + (sorted[above] - sorted[below]) * (position - below as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_lie_between_neighbours() {
        let sorted = [1.0, 2.0, 4.0];
        assert_eq!([0.0, 0.25, 0.5, 0.75, 1.0].map(|p| percentile(&sorted, p)), [1.0, 1.5, 2.0, 3.0, 4.0]);
        assert_eq!((percentile(&[], 0.5), percentile(&[3.0], 0.97)), (0.0, 3.0));
    }
}
