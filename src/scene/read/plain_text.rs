//! The text of OBJ and MTL files as their readers want it.

use crate::error::without_mark;
use std::borrow::Cow;

/// A text without a mark, in UTF-8 (what is not is taken as Latin-1, which gives every name one of its own),
/// and with continued lines (`\` at the end) joined: empty lines make up for those, so that lines keep their
/// numbers.
pub(super) fn plain_text(bytes: &[u8]) -> Cow<'_, [u8]> {
    let bytes = without_mark(bytes);
    let text = match std::str::from_utf8(bytes) {
        Ok(_) => Cow::Borrowed(bytes),
        Err(_) => Cow::Owned(bytes.iter().map(|&byte| char::from(byte)).collect::<String>().into_bytes()),
    };
    let is_continued = |line: &[u8]| line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\");
    if !text.split(|byte| *byte == b'\n').any(is_continued) {
        return text;
    }
    let mut joined = Vec::with_capacity(text.len());
    let mut open = 0;
    let mut lines = text.split(|byte| *byte == b'\n').peekable();
    while let Some(line) = lines.next() {
        if is_continued(line) {
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            joined.extend(&line[..line.len() - 1]);
            joined.push(b' ');
            open += 1;
            continue;
        }
        joined.extend(line);
        joined.extend(vec![b'\n'; open + usize::from(lines.peek().is_some())]);
        open = 0;
    }
    Cow::Owned(joined)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(bytes: &[u8]) -> String {
        String::from_utf8(plain_text(bytes).into_owned()).unwrap()
    }

    #[test]
    fn marks_go_and_latin_1_becomes_utf_8() {
        assert_eq!(text(b"\xef\xbb\xbfv 1 2 3\n"), "v 1 2 3\n");
        assert_eq!(text("o Würfel\n".as_bytes()), "o Würfel\n");
        assert_eq!(text(b"o W\xfcrfel\n"), "o Würfel\n");
        assert!(matches!(plain_text(b"v 1 2 3\n"), Cow::Borrowed(_)));
    }

    #[test]
    fn continued_lines_are_joined_and_lines_keep_their_numbers() {
        assert_eq!(text(b"f 1 2 \\\n3\nv 1\n"), "f 1 2  3\n\nv 1\n");
        assert_eq!(text(b"f 1 \\\r\n2 \\\r\n3\r\nx"), "f 1  2  3\r\n\n\nx");
        assert_eq!(text(b"f 1 \\"), "f 1  ");
    }
}
