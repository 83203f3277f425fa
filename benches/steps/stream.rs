//! The bandwidth of memory.

/// Reads every word once, eight sums side by side.
pub fn read(words: &[u64]) -> [u64; 8] {
    let mut sums = [0u64; 8];
    for chunk in words.as_chunks::<8>().0 {
        for lane in 0..8 {
            sums[lane] = sums[lane].wrapping_add(chunk[lane]);
        }
    }
    sums
}
