//! Converts the bytes of a capture buffer to samples of a frame.

use super::pixel_format::Samples;

/// Memory layout of a picture in a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) samples: Samples,
    pub(super) width: usize,
    pub(super) height: usize,
    /// Bytes from the start of one row to the next; at least the bytes of one row.
    pub(super) stride: usize,
    /// Whether luma and chroma use all codes from 0 to 255 and not the narrow range of television (16 to 235,
    /// 240).
    pub(super) is_full_range: bool,
}

impl Layout {
    /// Fewest bytes of a whole picture: the last row may lack its padding.
    pub(super) fn least_bytes(&self) -> usize {
        self.stride * self.height.saturating_sub(1) + self.samples.row_bytes(self.width)
    }

    /// Fills `codes` with `width * height * channels` samples, row-major, without further processing. Returns
    /// false, with `codes` unspecified, when there are too few bytes. Allocates only when `codes` has another
    /// length. It does not handle compressed pictures.
    pub(super) fn unpack(&self, bytes: &[u8], codes: &mut Vec<u16>) -> bool {
        if bytes.len() < self.least_bytes() || self.samples == Samples::Jpeg {
            return false;
        }
        let row_codes = self.width * self.samples.channels();
        codes.resize(row_codes * self.height, 0);
        let row_bytes = self.samples.row_bytes(self.width);
        for (from, to) in bytes.chunks(self.stride.max(1)).zip(codes.chunks_exact_mut(row_codes.max(1))) {
            self.unpack_row(&from[..row_bytes], to);
        }
        true
    }

    fn unpack_row(&self, from: &[u8], to: &mut [u16]) {
        match self.samples {
            Samples::Bytes => to.iter_mut().zip(from).for_each(|(to, &byte)| *to = byte.into()),
            Samples::LittleEndian => {
                to.iter_mut().zip(from.as_chunks().0).for_each(|(to, &pair)| *to = u16::from_le_bytes(pair));
            }
            Samples::BigEndian => {
                to.iter_mut().zip(from.as_chunks().0).for_each(|(to, &pair)| *to = u16::from_be_bytes(pair));
            }
            Samples::Packed10 => {
                for (to, from) in to.chunks_mut(4).zip(from.chunks(5)) {
                    let low = u16::from(from[from.len() - 1]);
                    for (index, (to, &high)) in to.iter_mut().zip(from).enumerate() {
                        *to = u16::from(high) << 2 | low >> (2 * index) & 3;
                    }
                }
            }
            Samples::Packed12 => {
                for (to, from) in to.chunks_mut(2).zip(from.chunks(3)) {
                    let low = u16::from(from[from.len() - 1]);
                    for (index, (to, &high)) in to.iter_mut().zip(from).enumerate() {
                        *to = u16::from(high) << 4 | low >> (4 * index) & 15;
                    }
                }
            }
            Samples::Packed14 => {
                for (to, from) in to.chunks_mut(4).zip(from.chunks(7)) {
                    // Where a row ends within a group, the low bits follow the high bytes that are present.
                    let (high, low) = from.split_at(to.len().min(from.len()));
                    let bits = low.iter().rev().fold(0u32, |bits, &byte| bits << 8 | u32::from(byte));
                    for (index, (to, &high)) in to.iter_mut().zip(high).enumerate() {
                        *to = u16::from(high) << 6 | (bits >> (6 * index)) as u16 & 63;
                    }
                }
            }
            Samples::Yuyv => {
                for (to, from) in to.chunks_mut(6).zip(from.as_chunks::<4>().0) {
                    let [y0, cb, y1, cr] = *from;
                    let chroma = Chroma::new(cb, cr, self.is_full_range);
                    for (to, y) in to.chunks_exact_mut(3).zip([y0, y1]) {
                        to.copy_from_slice(&chroma.rgb(y));
                    }
                }
            }
            Samples::Jpeg => {}
        }
    }
}

/// What the chroma of a pixel adds to red, green and blue, in 1/65536 of a code, by Rec. ITU-R BT.601.
struct Chroma {
    add: [i32; 3],
    luma: i32,
    black: i32,
}

impl Chroma {
    fn new(cb: u8, cr: u8, is_full_range: bool) -> Self {
        let (cb, cr) = (i32::from(cb) - 128, i32::from(cr) - 128);
        // Kr = 0.299, Kb = 0.114: R adds 2 (1 - Kr) Cr, B adds 2 (1 - Kb) Cb, G what preserves the luma. The
        // narrow range has 219 steps of luma and 224 of chroma for full scale.
        let (luma, scale, black) = if is_full_range { (65_536, 1.0, 0) } else { (76_309, 255.0 / 224.0, 16) };
        let fixed = |factor: f64| (65_536.0 * scale * factor).round() as i32;
        let add = [fixed(1.402) * cr, -fixed(0.344_136) * cb - fixed(0.714_136) * cr, fixed(1.772) * cb];
        Self { add, luma, black }
    }

    fn rgb(&self, y: u8) -> [u16; 3] {
        let luma = (i32::from(y) - self.black) * self.luma;
        self.add.map(|add| ((luma + add + 32_768) >> 16).clamp(0, 255) as u16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unpack(samples: Samples, [width, height, stride]: [usize; 3], bytes: &[u8]) -> Vec<u16> {
        let layout = Layout { samples, width, height, stride, is_full_range: true };
        let mut codes = vec![9; 3];
        assert!(layout.unpack(bytes, &mut codes));
        assert!(!layout.unpack(&bytes[..layout.least_bytes() - 1], &mut codes), "one byte short");
        codes
    }

    #[test]
    fn padded_rows_give_the_samples_and_not_the_padding() {
        assert_eq!(unpack(Samples::Bytes, [2, 2, 3], &[1, 2, 99, 3, 4]), [1, 2, 3, 4]);
        let bytes = [0x34, 0x12, 0xff, 0xff, 99, 99, 0x00, 0x01, 0x02, 0x00];
        assert_eq!(unpack(Samples::LittleEndian, [2, 2, 6], &bytes), [0x1234, 0xffff, 0x0100, 2]);
        assert_eq!(unpack(Samples::BigEndian, [2, 2, 6], &bytes), [0x3412, 0xffff, 1, 0x0200]);
    }

    #[test]
    fn packed_samples_come_apart_and_rows_may_end_within_a_group() {
        // 10 bits: 0x3ff, 0x001, 0x202, 0x155; then a row of two more, followed by their low bits.
        let low = 0b01_10_01_11;
        let bytes = [0xff, 0x00, 0x80, 0x55, low];
        assert_eq!(unpack(Samples::Packed10, [4, 1, 5], &bytes), [0x3ff, 0x001, 0x202, 0x155]);
        assert_eq!(Samples::Packed10.row_bytes(6), 8);
        let bytes = [0xab, 0x12, 0x4c, 0xff, 0x00, 0xf0];
        assert_eq!(unpack(Samples::Packed12, [4, 1, 6], &bytes), [0xabc, 0x124, 0xff0, 0x00f]);
        assert_eq!(unpack(Samples::Packed12, [2, 2, 3], &bytes), [0xabc, 0x124, 0xff0, 0x00f]);
        assert_eq!(unpack(Samples::Packed12, [3, 1, 5], &bytes[..5]), [0xabc, 0x124, 0xff0]);
        // 14 bits: low parts 1, 2, 3 and 63 from the least significant bit on.
        let low = 1 | 2 << 6 | 3 << 12 | 63 << 18_u32;
        let [a, b, c, _] = u32::to_le_bytes(low);
        let bytes = [0xff, 0x00, 0x80, 0x01, a, b, c];
        assert_eq!(
            unpack(Samples::Packed14, [4, 1, 7], &bytes),
            [0xff << 6 | 1, 2, 0x80 << 6 | 3, 1 << 6 | 63]
        );
    }

    #[test]
    fn luma_and_chroma_become_the_colours_of_the_standard() {
        // Closed form of BT.601, rounded, for all corners and some values in between.
        for is_full_range in [false, true] {
            for y in [0u8, 16, 80, 128, 235, 255] {
                for cb in [0u8, 16, 100, 128, 240, 255] {
                    for cr in [0u8, 16, 128, 150, 240, 255] {
                        let (luma, scale) = if is_full_range {
                            (f64::from(y), 1.0)
                        } else {
                            ((f64::from(y) - 16.0) * 255.0 / 219.0, 255.0 / 224.0)
                        };
                        let (b, r) = ((f64::from(cb) - 128.0) * scale, (f64::from(cr) - 128.0) * scale);
                        let green = -(2.0 * 0.114 * 0.886 * b + 2.0 * 0.299 * 0.701 * r) / 0.587;
                        let exact = [luma + 2.0 * 0.701 * r, luma + green, luma + 2.0 * 0.886 * b];
                        let found = Chroma::new(cb, cr, is_full_range).rgb(y);
                        for (found, exact) in found.into_iter().zip(exact) {
                            assert!(
                                (f64::from(found) - exact.clamp(0.0, 255.0)).abs() < 0.51,
                                "{y} {cb} {cr}"
                            );
                        }
                    }
                }
            }
        }
        let grey = unpack(Samples::Yuyv, [2, 1, 4], &[10, 128, 200, 128]);
        assert_eq!(grey, [10, 10, 10, 200, 200, 200]);
    }

    #[test]
    fn nothing_is_allocated_for_the_second_frame() {
        let layout = Layout { samples: Samples::Bytes, width: 4, height: 2, stride: 4, is_full_range: true };
        let mut codes = Vec::new();
        assert!(layout.unpack(&[7; 8], &mut codes));
        let place = codes.as_ptr();
        assert!(layout.unpack(&[8; 8], &mut codes));
        assert_eq!((codes.as_ptr(), codes[7]), (place, 8));
    }
}
