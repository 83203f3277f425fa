use crate::error::Result;
use std::path::Path;

/// A small 8-bit sRGB picture to draw on.
#[derive(Clone, Debug, PartialEq)]
pub struct Canvas {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    rgb: Vec<u8>,
}

impl Canvas {
    /// A picture whose pixels have the colour `colour(x, y)`.
    pub fn from_fn(width: usize, height: usize, mut colour: impl FnMut(usize, usize) -> [u8; 3]) -> Self {
        let rgb = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .flat_map(|(x, y)| colour(x, y))
            .collect();
        Self { width, height, rgb }
    }

    /// Colour of a pixel.
    pub fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let start = (y * self.width + x) * 3;
        [self.rgb[start], self.rgb[start + 1], self.rgb[start + 2]]
    }

    /// Draws an antialiased ring, 1.5 px wide, in `colour` on a dark outline that keeps it visible on white.
    pub fn ring(&mut self, centre_x: f64, centre_y: f64, radius: f64, colour: [u8; 3]) {
        self.disc_shell(centre_x, centre_y, radius, 1.5, [0; 3]);
        self.disc_shell(centre_x, centre_y, radius, 0.75, colour);
    }

    fn disc_shell(&mut self, centre_x: f64, centre_y: f64, radius: f64, half_width: f64, colour: [u8; 3]) {
        let reach = radius + half_width + 1.0;
        let range = |centre: f64, size: usize| {
            let from = (centre - reach).floor().clamp(0.0, size as f64) as usize;
            from..((centre + reach).ceil().clamp(0.0, size as f64) as usize)
        };
        for y in range(centre_y, self.height) {
            for x in range(centre_x, self.width) {
                let distance = (x as f64 + 0.5 - centre_x).hypot(y as f64 + 0.5 - centre_y);
                let cover = (half_width + 0.5 - (distance - radius).abs()).clamp(0.0, 1.0);
                let start = (y * self.width + x) * 3;
                for (value, target) in self.rgb[start..start + 3].iter_mut().zip(colour) {
                    *value =
                        (f64::from(*value) + cover * (f64::from(target) - f64::from(*value))).round() as u8;
                }
            }
        }
    }

    /// Writes a PNG.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        crate::files::write_png8(path, self.width, self.height, &self.rgb)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ring_lies_on_its_radius_and_is_cut_at_the_border() {
        let mut canvas = Canvas::from_fn(40, 30, |_, _| [200; 3]);
        canvas.ring(20.5, 15.5, 8.0, [0, 255, 0]);
        assert_eq!(canvas.pixel(28, 15), [0, 255, 0]);
        assert_eq!(canvas.pixel(20, 15), [200; 3]);
        assert_eq!(canvas.pixel(39, 29), [200; 3]);
        canvas.ring(-5.0, 100.0, 1e4, [0, 255, 0]);
        canvas.ring(39.5, 0.5, 3.0, [255, 0, 0]);
        assert_eq!(canvas.pixel(36, 0), [255, 0, 0]);
    }
}
