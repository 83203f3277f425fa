//! Pictures to feed.

use crate::kernel::Layout;

/// Random pixels, so that a misplaced byte is detected; 16-bit words limited to `mask`. The memory is leaked,
/// because a driver may keep using it.
pub fn noise(layout: Layout, seed: u32, mask: u16) -> &'static [u8] {
    words(layout, seed, mask).leak()
}

fn words(layout: Layout, seed: u32, mask: u16) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(layout.size as usize);
    // Marsaglia's xorshift; the factor spreads small seeds.
    let mut state = seed.wrapping_mul(2_654_435_761) | 1;
    for _ in 0..layout.size / 2 {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        bytes.extend_from_slice(&((state >> 7) as u16 & mask).to_le_bytes());
    }
    bytes
}

/// A lamp in front of darker noise; the lamp moves with every `number`, so that no two pictures have the same
/// lights. Codes up to `mask`.
pub fn lamp(layout: Layout, number: u32, mask: u16) -> &'static [u8] {
    let mut bytes = words(layout, number, mask >> 3);
    let side = layout.height / 16;
    let (left, top) =
        (layout.width / 2 - 2 * side + (number * side / 2) % (3 * side), layout.height / 2 - side);
    for row in top..top + side {
        let start = (row * layout.stride + 2 * left) as usize;
        for code in bytes[start..start + 2 * side as usize].chunks_exact_mut(2) {
            let noise = u16::from_le_bytes([code[0], code[1]]);
            code.copy_from_slice(&(mask - noise).to_le_bytes());
        }
    }
    bytes.leak()
}

/// The 16-bit words of a picture's pixels, without the padding of rows.
pub fn codes(picture: &[u8], layout: Layout) -> Vec<u16> {
    let row = 2 * layout.width as usize;
    picture
        .chunks_exact(layout.stride as usize)
        .flat_map(|bytes| bytes[..row].chunks_exact(2))
        .map(|code| u16::from_le_bytes([code[0], code[1]]))
        .collect()
}
