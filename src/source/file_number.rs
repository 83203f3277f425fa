//! Numbers in the names of files.

/// Splits `name.0017.exr` into `name.`, 17 and `.exr`. A minus is a sign where the name begins with it, or a
/// dot, a blank or an underscore stands before it; elsewhere it joins words.
pub(super) fn numbered(name: &str) -> Option<(&str, i64, &str)> {
    let (stem, _) = name.rsplit_once('.')?;
    let digits_at = stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let before = match stem[..digits_at].strip_suffix('-') {
        Some(before) if before.is_empty() || before.ends_with(['.', '_', ' ']) => before,
        _ => &stem[..digits_at],
    };
    let number = stem[before.len()..].parse().ok()?;
    Some((before, number, &name[stem.len()..]))
}

/// Splits `name_1403636579.763555.png` into `name_`, the time in nanoseconds, and `.png`: seconds since 1970,
/// with a fraction.
pub(super) fn seconds(name: &str) -> Option<(&str, i64, &str)> {
    let (stem, _) = name.rsplit_once('.')?;
    let (whole, fraction) = stem.rsplit_once('.')?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let before = whole.trim_end_matches(|c: char| c.is_ascii_digit());
    let seconds = &whole[before.len()..];
    if seconds.len() != 10 || !is_number(fraction) || fraction.len() > 9 {
        return None;
    }
    let nanoseconds = format!("{seconds}{fraction:0<9}").parse().ok()?;
    Some((before, nanoseconds, &name[stem.len()..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minus_is_a_sign_where_nothing_is_joined() {
        for (name, expected) in [
            ("f.0017.exr", Some(("f.", 17, ".exr"))),
            ("f.-001.exr", Some(("f.", -1, ".exr"))),
            ("f_-12.exr", Some(("f_", -12, ".exr"))),
            ("-3.exr", Some(("", -3, ".exr"))),
            ("take-003.exr", Some(("take-", 3, ".exr"))),
            ("2026-12-01.exr", Some(("2026-12-", 1, ".exr"))),
            ("map_1k.hdr", None),
            ("7", None),
            ("a.99999999999999999999.exr", None),
        ] {
            assert_eq!(numbered(name), expected, "{name}");
        }
    }

    #[test]
    fn seconds_have_ten_digits_and_a_fraction() {
        assert_eq!(seconds("1403636579.763555.png"), Some(("", 1_403_636_579_763_555_000, ".png")));
        assert_eq!(seconds("cam0_1403636579.5.png"), Some(("cam0_", 1_403_636_579_500_000_000, ".png")));
        for name in [
            "f.0001.exr",
            "1403636579.png",
            "1403636579.7635551234.png",
            "140363657.5.png",
            "1403636579.x.png",
        ] {
            assert_eq!(seconds(name), None, "{name}");
        }
    }
}
