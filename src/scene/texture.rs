use crate::error::{Error, Result};
use image::{ImageDecoder, ImageFormat, ImageReader};
use std::io::Cursor;

/// Longest side of a texture that is read, which every GPU supports.
pub const MAX_TEXTURE_SIDE_PX: u32 = 8192;

/// Most pixels of all textures of a scene together (512 MB).
pub const MAX_TEXTURE_PIXELS: u64 = 1 << 27;

/// What lies beyond a texture's edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The texture again.
    #[default]
    Repeat,
    /// The texture again, every other copy mirrored.
    MirroredRepeat,
    /// The pixels of the edge.
    ClampToEdge,
}

/// A picture on a surface. Row 0 is at v = 0, the top. The renderer decides how it is filtered; the filters
/// of glTF files are not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texture {
    /// Columns, > 0.
    pub width: u32,
    /// Rows, > 0.
    pub height: u32,
    /// `4 * width * height` bytes, rows from the top.
    pub rgba8: Vec<u8>,
    /// Whether red, green and blue are coded as sRGB (colours) or linear (normals, roughness). Alpha is
    /// linear.
    pub is_srgb: bool,
    /// Wrapping beyond the left and right edges.
    pub wrap_u: Wrap,
    /// Wrapping beyond the top and bottom edges.
    pub wrap_v: Wrap,
}

impl Texture {
    /// Decodes a PNG or JPEG picture, whatever its name. `pixels_left` is the number of pixels that the
    /// textures of a scene may still have; the picture's pixels are subtracted from it. Samples of more than
    /// 8 bits are rounded, grey becomes red, green and blue.
    pub(super) fn decode(bytes: &[u8], is_srgb: bool, pixels_left: &mut u64) -> Result<Self> {
        let format = match bytes {
            [0x89, b'P', b'N', b'G', ..] => ImageFormat::Png,
            [0xff, 0xd8, 0xff, ..] => ImageFormat::Jpeg,
            [] => return Err(Error::usage("is empty")),
            _ => {
                return Err(Error::usage(format!(
                    "is neither PNG nor JPEG (it begins with the bytes {:02x?}); convert it",
                    &bytes[..bytes.len().min(12)]
                )));
            }
        };
        let damaged = |error| Error::usage("cannot be decoded; is it complete?").because(error);
        let mut decoder =
            ImageReader::with_format(Cursor::new(bytes), format).into_decoder().map_err(damaged)?;
        let (width, height) = decoder.dimensions();
        let pixels = u64::from(width) * u64::from(height);
        if width == 0 || height == 0 || width.max(height) > MAX_TEXTURE_SIDE_PX || pixels > *pixels_left {
            return Err(Error::usage(format!(
                "is {width} x {height}; textures have at most {MAX_TEXTURE_SIDE_PX} pixels a side and \
                 {MAX_TEXTURE_PIXELS} all together: make it smaller"
            )));
        }
        let mut limits = image::Limits::default();
        // 16-bit RGBA, and what a decoder needs in addition.
        limits.max_alloc = Some(8 * pixels + (64 << 20));
        decoder.set_limits(limits).map_err(damaged)?;
        let picture = image::DynamicImage::from_decoder(decoder).map_err(damaged)?;
        *pixels_left -= pixels;
        let rgba8 = picture.into_rgba8().into_raw();
        Ok(Self { width, height, rgba8, is_srgb, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(format: ImageFormat, width: u32, height: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        let picture = image::RgbImage::from_fn(width, height, |x, y| image::Rgb([x as u8, y as u8, 200]));
        picture.write_to(&mut Cursor::new(&mut bytes), format).unwrap();
        bytes
    }

    #[test]
    fn png_is_exact_and_jpeg_near() {
        let mut left = 1000;
        let png = Texture::decode(&encoded(ImageFormat::Png, 3, 2), true, &mut left).unwrap();
        assert_eq!((png.width, png.height, png.rgba8.len(), left), (3, 2, 24, 994));
        assert_eq!(png.rgba8[16..], [1, 1, 200, 255, 2, 1, 200, 255]);
        let jpeg = Texture::decode(&encoded(ImageFormat::Jpeg, 8, 8), false, &mut left).unwrap();
        assert!(jpeg.rgba8.chunks(4).all(|p| p[0] < 16 && p[2].abs_diff(200) < 8 && p[3] == 255));
        assert!(!jpeg.is_srgb && png.is_srgb);
    }

    #[test]
    fn pictures_that_cannot_be_used_say_why() {
        let mut left = 5;
        let mut failure = |bytes: &[u8]| Texture::decode(bytes, true, &mut left).unwrap_err().to_string();
        assert!(failure(&encoded(ImageFormat::Png, 3, 2)).contains("is 3 x 2; textures have at most"));
        assert!(failure(&encoded(ImageFormat::Png, 2, 2)[..60]).contains("is it complete?"));
        assert!(failure(b"\xabKTX 20\xbb\r\n\x1a\n").contains("neither PNG nor JPEG"));
        assert!(failure(b"").contains("is empty"));
        // A header that claims 2^31 columns.
        let mut huge = encoded(ImageFormat::Png, 2, 2);
        huge[16] = 0x7f;
        assert!(!failure(&huge).is_empty());
    }
}
