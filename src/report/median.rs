/// The middle one, of an even number the upper of the two middle ones; `None` for none.
pub fn median<T: Ord + Copy>(values: &mut [T]) -> Option<T> {
    values.sort_unstable();
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_in_the_middle() {
        assert_eq!(median(&mut [5, 1, 9]), Some(5));
        assert_eq!(median(&mut [5, 1, 9, 7]), Some(7));
        assert_eq!(median::<u32>(&mut []), None);
    }
}
