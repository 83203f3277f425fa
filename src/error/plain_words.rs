//! What a reader of structured text says of a value, in words for who wrote it.

/// Names of types, as the readers have them, and in plain words.
const KINDS: [(&str, &str); 18] = [
    ("usize", "a whole number, 0 or more"),
    ("u64", "a whole number, 0 or more"),
    ("u32", "a whole number, 0 or more"),
    ("u16", "a whole number from 0 to 65535"),
    ("u8", "a whole number from 0 to 255"),
    ("i64", "a whole number"),
    ("i32", "a whole number"),
    ("f64", "a number"),
    ("f32", "a number"),
    ("a boolean", "true or false"),
    ("a string", "a text"),
    ("a borrowed string", "a text"),
    ("path string", "a path"),
    ("a map", "a table"),
    ("a sequence", "a list"),
    ("an array of length 3", "a list of 3"),
    ("an array of length 2", "a list of 2"),
    ("string or map", "a name or a table"),
];

/// A message of `serde` about a value, without the names of a programming language: `invalid type: string
/// "x", expected usize` becomes `"x" given where a whole number, 0 or more is wanted`. Messages of another
/// form stay as they are.
pub fn plain_words(message: &str) -> String {
    if let Some((variant, known)) =
        message.strip_prefix("unknown variant ").and_then(|rest| rest.split_once(", expected "))
    {
        return format!("{variant} is unknown; give {known}");
    }
    let fault = ["invalid type: ", "invalid value: "].iter().find_map(|start| message.strip_prefix(start));
    let Some((given, wanted)) = fault.and_then(|rest| rest.rsplit_once(", expected ")) else {
        return message.to_owned();
    };
    // JSON's reader adds the place.
    let (wanted, place) = match wanted.split_once(" at line ") {
        Some((wanted, place)) => (wanted, format!(" at line {place}")),
        None => (wanted, String::new()),
    };
    let wanted = KINDS.iter().find(|(name, _)| *name == wanted).map_or(wanted, |(_, plain)| plain);
    let given = ["floating point ", "integer ", "string "]
        .iter()
        .find_map(|kind| given.strip_prefix(kind))
        .unwrap_or(given);
    format!("{given} given where {wanted} is wanted{place}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_and_variants_become_words() {
        for (message, plain) in [
            (
                "invalid type: string \"x\", expected usize",
                "\"x\" given where a whole number, 0 or more is wanted",
            ),
            (
                "invalid type: floating point `1.5`, expected u8",
                "`1.5` given where a whole number from 0 to 255 is wanted",
            ),
            (
                "invalid type: string \"x\", expected u64 at line 1 column 27",
                "\"x\" given where a whole number, 0 or more is wanted at line 1 column 27",
            ),
            ("invalid value: integer `-3`, expected f64", "`-3` given where a number is wanted"),
            (
                "unknown variant `slow`, expected `real-time` or `fast`",
                "`slow` is unknown; give `real-time` or `fast`",
            ),
            (
                "invalid type: string \"a string of mine\", expected f32",
                "\"a string of mine\" given where a number is wanted",
            ),
            ("unknown variant `x`, expected one of `a`, `b`", "`x` is unknown; give one of `a`, `b`"),
            ("invalid type: map, expected a thing", "map given where a thing is wanted"),
            ("unknown field `colour`, expected `color`", "unknown field `colour`, expected `color`"),
            ("missing field `path`", "missing field `path`"),
        ] {
            assert_eq!(plain_words(message), plain);
        }
    }
}
