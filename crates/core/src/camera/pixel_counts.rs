/// Pixels of one frame that do not hold the radiance that they saw. They are counted per pixel (a pixel of
/// three channels counts once where any of them is affected), among the pixels that the polar map sees:
/// corners outside the lens's circle are always black and would dominate the counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelCounts {
    /// At or above the saturation code, or the frame's saturation: brighter than the sensor can tell.
    pub saturated: u64,
    /// At or below the black-clip code.
    pub black_clipped: u64,
    /// Not a number; counts as no light.
    pub nan: u64,
    /// Infinite, such as a half float that overflowed; counts as no light.
    pub infinite: u64,
    /// Below zero; counts as no light.
    pub negative: u64,
}

impl PixelCounts {
    /// Adds another frame's or row's counts.
    pub fn add(&mut self, other: &Self) {
        self.saturated += other.saturated;
        self.black_clipped += other.black_clipped;
        self.nan += other.nan;
        self.infinite += other.infinite;
        self.negative += other.negative;
    }
}
