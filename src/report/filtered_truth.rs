//! The truth that filtered lists are judged against.

/// The truth of every frame passed through the taps as the light filter passes lists: the first frame, and
/// the first after a gap longer than the filter, stands for all earlier times; in a shorter gap the last one
/// is held.
pub(super) fn filtered(
    truth: &[Vec<f64>],
    lost_before: impl Iterator<Item = u64>,
    taps: &[f64],
) -> Vec<Vec<f64>> {
    // Indices of frames, the newest last, limited to the filter's length.
    let mut history: Vec<usize> = Vec::new();
    let mut filtered = Vec::with_capacity(truth.len());
    for (t, lost) in lost_before.enumerate() {
        if t == 0 || lost > taps.len() as u64 {
            history = vec![t; taps.len()];
        } else {
            history.extend(std::iter::repeat_n(t - 1, lost as usize));
            history.push(t);
            history.drain(..history.len() - taps.len());
        }
        let newest_first = || history.iter().rev();
        let at =
            |place: usize| taps.iter().zip(newest_first()).map(|(tap, &age)| tap * truth[age][place]).sum();
        filtered.push((0..truth[t].len()).map(at).collect());
    }
    filtered
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_truth_is_filtered_as_lists_are_over_gaps_too() {
        let taps = [0.5, 0.3, 0.2];
        let truth: Vec<Vec<f64>> = [1.0, 2.0, 4.0, 8.0].iter().map(|&value| vec![value]).collect();
        let of = |lost: [u64; 4]| -> Vec<f64> {
            filtered(&truth, lost.into_iter(), &taps).into_iter().flatten().collect()
        };
        let expect = |found: Vec<f64>, wanted: [f64; 4]| {
            assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {wanted:?}");
        };
        expect(of([0; 4]), [1.0, 1.5, 2.8, 5.6]);
        // One lost frame is the last one again; the filter starts afresh after four.
        expect(of([0, 0, 1, 0]), [1.0, 1.5, 2.0 + 0.6 + 0.4, 4.0 + 1.2 + 0.4]);
        expect(of([9, 0, 4, 0]), [1.0, 1.5, 4.0, 6.0]);
    }
}
