/// Element `index` of the van der Corput sequence: the digits of `index` in `base` mirrored at the radix
/// point, in [0, 1). The Halton sequence takes a prime base per coordinate; index 0 is the corner, so start
/// at 1.
pub fn halton(index: u64, base: u64) -> f64 {
    let (mut rest, mut digits, mut scale) = (index, 0u64, 1.0);
    while rest > 0 {
        // The mirrored digits stay an integer below base^k <= base * index: one rounding at the end.
        digits = digits * base + rest % base;
        rest /= base;
        scale *= base as f64;
    }
    (digits as f64 / scale).min(1.0f64.next_down())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_elements_are_the_published_ones() {
        let base_2: Vec<f64> = (1..=8).map(|i| halton(i, 2)).collect();
        assert_eq!(base_2, [0.5, 0.25, 0.75, 0.125, 0.625, 0.375, 0.875, 0.0625]);
        let base_3: Vec<f64> = (1..=5).map(|i| halton(i, 3)).collect();
        for (value, ninths) in base_3.into_iter().zip([3.0, 6.0, 1.0, 4.0, 7.0]) {
            assert!((value - ninths / 9.0).abs() < 1e-16);
        }
    }

    #[test]
    fn a_full_period_visits_every_interval_once() {
        // 2^4 3^2 points: one in each of the 16 x 9 elementary boxes.
        let mut visits = [0; 144];
        for i in 1..=144 {
            visits[(halton(i, 2) * 16.0) as usize * 9 + (halton(i, 3) * 9.0 + 1e-12) as usize] += 1;
        }
        assert!(visits.iter().all(|&n| n == 1), "{visits:?}");
    }

    #[test]
    fn huge_indices_stay_below_one() {
        assert!(halton(u64::MAX >> 1, 2) < 1.0);
        assert_eq!(halton(0, 3), 0.0);
    }
}
