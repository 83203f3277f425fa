//! The options of a texture in MTL files: `map_Kd -s 2 2 1 -o 0 0.5 tex.png`.

use glam::{Affine2, Vec2};

/// A texture's name, and what is done to the texture coordinates of a vertex, of which v grows downwards.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TextureOptions<'a> {
    pub name: &'a str,
    pub uv: Affine2,
    /// Options that are not used.
    pub left_out: Vec<&'a str>,
}

/// Options with so many words behind them; those of up to three numbers take as many as there are.
const WORDS: [(&str, usize); 9] = [
    ("-blendu", 1),
    ("-blendv", 1),
    ("-boost", 1),
    ("-mm", 2),
    ("-texres", 1),
    ("-clamp", 1),
    ("-bm", 1),
    ("-imfchan", 1),
    ("-cc", 1),
];

/// Reads what stands behind the keyword. The name is what comes after the options, with its blanks.
pub(super) fn texture_options(text: &str) -> TextureOptions<'_> {
    let mut rest = text.trim_start();
    let (mut scale, mut offset) = (Vec2::ONE, Vec2::ZERO);
    let mut left_out = Vec::new();
    while rest.starts_with('-') {
        let (option, mut behind) = split(rest);
        if let Some((_, words)) = WORDS.iter().find(|(name, _)| *name == option) {
            for _ in 0..*words {
                behind = split(behind).1;
            }
            left_out.push(option);
        } else if matches!(option, "-s" | "-o" | "-t") {
            let mut values = match option {
                "-s" => [1.0; 3],
                _ => [0.0; 3],
            };
            for value in &mut values {
                let (word, after) = split(behind);
                // The last word is the name, also where it is a number.
                let Some(number) =
                    word.parse().ok().filter(|number: &f32| number.is_finite() && !after.is_empty())
                else {
                    break;
                };
                (*value, behind) = (number, after);
            }
            match option {
                "-s" => scale = Vec2::new(values[0], values[1]),
                "-o" => offset = Vec2::new(values[0], values[1]),
                _ => left_out.push(option),
            }
        } else {
            // A name that begins with a dash.
            break;
        }
        rest = behind;
    }
    // In the file v grows upwards: 1 - v' = s (1 - v) + o.
    let uv = Affine2::from_scale_angle_translation(scale, 0.0, Vec2::new(offset.x, 1.0 - scale.y - offset.y));
    TextureOptions { name: rest.trim_end(), uv, left_out }
}

/// The first word, and the text behind the blanks that follow it.
fn split(text: &str) -> (&str, &str) {
    match text.split_once(char::is_whitespace) {
        Some((word, rest)) => (word, rest.trim_start()),
        None => (text, ""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_stand_before_the_name() {
        let plain = texture_options("my tex.png");
        assert_eq!(plain, TextureOptions { name: "my tex.png", uv: Affine2::IDENTITY, left_out: vec![] });
        let scaled = texture_options("-s 2 3 1 -o 0.5 0.25 0 -clamp on -bm 2 a b.png ");
        assert_eq!((scaled.name, &scaled.left_out[..]), ("a b.png", &["-clamp", "-bm"][..]));
        // In the file's coordinates (0.1, 0.2): (0.7, 0.85).
        let found = scaled.uv.transform_point2(Vec2::new(0.1, 1.0 - 0.2));
        assert!(found.abs_diff_eq(Vec2::new(0.7, 1.0 - 0.85), 1e-6), "{found}");
    }

    #[test]
    fn fewer_numbers_and_odd_names_are_read() {
        let one = texture_options("-s 2 tex.png");
        assert_eq!((one.name, one.uv.matrix2.x_axis.x, one.uv.matrix2.y_axis.y), ("tex.png", 2.0, 1.0));
        assert_eq!(texture_options("-s 2 2 7").name, "7");
        assert_eq!(texture_options("-odd.png").name, "-odd.png");
        assert_eq!(texture_options("-o").name, "");
        assert_eq!(texture_options("-s nan tex.png").name, "nan tex.png");
    }
}
