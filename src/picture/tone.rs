use lightcast_core::image::luminance;
use lightcast_core::math::srgb_from_linear;

/// Luminance that the log-average of the picture is mapped to: middle grey.
const KEY: f64 = 0.18;
/// Luminance, in log-averages, that becomes white: brighter values clip.
const WHITE_IN_LOG_AVERAGES: f32 = 40.0;

/// Reinhard's global operator (2002, eq. 1, 2 and 4), its exposure taken from the log-average luminance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToneCurve {
    exposure: f32,
}

impl ToneCurve {
    /// Exposure for a picture with these pixels (linear RGB). Black pixels do not count; an all-black picture
    /// gets exposure 1.
    pub fn for_pixels<'a>(pixels: impl IntoIterator<Item = &'a [f32; 3]>) -> Self {
        let (mut sum, mut count) = (0.0f64, 0u64);
        for &pixel in pixels {
            let luminance = luminance(pixel);
            if luminance > 0.0 {
                sum += f64::from(luminance).ln();
                count += 1;
            }
        }
        let exposure = if count == 0 { 1.0 } else { KEY / (sum / count as f64).exp() };
        Self { exposure: exposure as f32 }
    }

    /// 8-bit sRGB of linear RGB.
    pub fn apply(&self, rgb: [f32; 3]) -> [u8; 3] {
        let white = KEY as f32 * WHITE_IN_LOG_AVERAGES;
        let bright = luminance(rgb) * self.exposure;
        let scale = self.exposure * (1.0 + bright / (white * white)) / (1.0 + bright);
        rgb.map(|value| (srgb_from_linear(value * scale).clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_does_not_matter_and_order_is_kept() {
        let pixels: Vec<[f32; 3]> = (1..100).map(|i| [0.01 * i as f32; 3]).collect();
        let brighter: Vec<[f32; 3]> = pixels.iter().map(|p| p.map(|v| v * 1e4)).collect();
        let (dim, bright) = (ToneCurve::for_pixels(&pixels), ToneCurve::for_pixels(&brighter));
        let mut last = 0;
        for (a, b) in pixels.iter().zip(&brighter) {
            let value = dim.apply(*a)[0];
            assert!(value.abs_diff(bright.apply(*b)[0]) <= 1);
            assert!(value >= last);
            last = value;
        }
        assert!(last > 150);
    }

    #[test]
    fn black_and_enormous_values_stay_in_range() {
        assert_eq!(ToneCurve::for_pixels(&[[0.0; 3]]).apply([0.0; 3]), [0; 3]);
        assert_eq!(ToneCurve::for_pixels(&[[1.0; 3]]).apply([1e30; 3]), [255; 3]);
    }
}
