use std::str::FromStr;

/// A number of columns and of rows, written as in `360x90`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Resolution {
    pub columns: usize,
    pub rows: usize,
}

impl FromStr for Resolution {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides = text.split_once('x').and_then(|(columns, rows)| {
            Some(Self { columns: columns.parse().ok()?, rows: rows.parse().ok()? })
        });
        sides.ok_or("write COLUMNSxROWS, such as 360x90".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resolutions_are_two_numbers() {
        assert_eq!("360x90".parse(), Ok(Resolution { columns: 360, rows: 90 }));
        for text in ["360", "360x", "x90", "-3x4", "360 x 90", "360x90x3"] {
            assert!(text.parse::<Resolution>().is_err(), "{text}");
        }
    }
}
