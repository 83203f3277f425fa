//! Pictures to feed: pixels without any order, so that a byte that goes astray is seen.

use crate::kernel::Layout;

/// A picture of `layout` whose 16-bit words keep to `mask`. It stays for good: a driver may hold on to it.
pub fn noise(layout: Layout, seed: u32, mask: u16) -> &'static [u8] {
    let mut bytes = Vec::with_capacity(layout.size as usize);
    // Marsaglia's xorshift; the factor spreads small seeds.
    let mut state = seed.wrapping_mul(2_654_435_761) | 1;
    for _ in 0..layout.size / 2 {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        bytes.extend_from_slice(&((state >> 7) as u16 & mask).to_le_bytes());
    }
    bytes.leak()
}
