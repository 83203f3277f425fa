//! What URIs in glTF files name.

use crate::error::{Error, Result};
use crate::scene::read::files::{Files, short};
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

/// The data of a data URI (base64), or of a file that a relative URI names.
pub(super) fn read_uri(uri: &str, files: &mut Files) -> Result<Vec<u8>> {
    let Some(data) = uri.strip_prefix("data:") else {
        return files.read(&percent_decoded(uri)?);
    };
    let Some((_, text)) = data.split_once(";base64,") else {
        return Err(Error::usage(format!("`{}` is a data URI, but not one of base64", short(uri))));
    };
    // Some writers omit the padding.
    let lenient = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    GeneralPurpose::new(&STANDARD, lenient)
        .decode(text)
        .map_err(|error| Error::usage("holds a data URI that is no base64").because(error))
}

/// RFC 3986: `%20` is a space.
fn percent_decoded(uri: &str) -> Result<String> {
    let wrong =
        || Error::usage(format!("`{}` is no URI: a percent sign without two hexadecimal digits", short(uri)));
    let mut parts = uri.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        let (digits, rest) = part.split_at_checked(2).ok_or_else(wrong)?;
        bytes.push(u8::from_str_radix(digits, 16).map_err(|_| wrong())?);
        bytes.extend_from_slice(rest.as_bytes());
    }
    String::from_utf8(bytes).map_err(|_| wrong())
}
