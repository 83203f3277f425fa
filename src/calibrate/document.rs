//! Calibration files of other programs as one tree of values, whichever notation they are in: JSON, YAML, or
//! the XML of OpenCV's FileStorage. The text is not trusted: nesting, aliases and numbers that are not finite
//! are refused by the parsers.

use crate::error::{Error, Place, Result};
use serde_json::{Map, Value};

/// Deepest nesting of elements: OpenCV writes three levels.
const XML_DEPTH_MAX: usize = 16;

/// Reads a document of any of the three notations.
pub(super) fn parse(text: &str) -> Result<Value> {
    let text = text.trim_start();
    if text.starts_with('{') {
        serde_json::from_str(text).map_err(|error| Error::usage("is not valid JSON").because(error))
    } else if text.starts_with('<') {
        let document = roxmltree::Document::parse(text)
            .map_err(|error| Error::usage("is not valid XML").because(error))?;
        xml_value(document.root_element(), 0)
    } else {
        serde_saphyr::from_str(&yaml_body(text))
            .map_err(|error| Error::usage("is not valid YAML").because(error.to_string()))
    }
}

/// OpenCV begins its files with `%YAML:1.0`, which is not YAML (the directive has a space and needs `---`
/// after it). The line is replaced by blanks, so that positions in messages stay correct. `rostopic echo`
/// ends every message with `---`, behind which no other document comes.
fn yaml_body(text: &str) -> String {
    let body = match text.split_once('\n') {
        Some((first, rest)) if first.starts_with("%YAML") => format!("\n{rest}"),
        _ => text.to_owned(),
    };
    match body.trim_end().strip_suffix("\n---").or_else(|| body.trim_end().strip_suffix("\r\n---")) {
        Some(message) => message.to_owned(),
        None => body,
    }
}

fn xml_value(node: roxmltree::Node<'_, '_>, depth: usize) -> Result<Value> {
    if depth > XML_DEPTH_MAX {
        return Err(Error::usage(format!("has XML elements more than {XML_DEPTH_MAX} levels deep")));
    }
    let mut children = node.children().filter(roxmltree::Node::is_element).peekable();
    if children.peek().is_some() {
        let mut map = Map::new();
        for child in children {
            map.insert(child.tag_name().name().to_owned(), xml_value(child, depth + 1)?);
        }
        return Ok(Value::Object(map));
    }
    let text = node.text().unwrap_or_default().trim();
    let numbers: Option<Vec<Value>> = text
        .split_whitespace()
        .map(|word| word.parse::<f64>().ok().and_then(serde_json::Number::from_f64).map(Value::Number))
        .collect();
    Ok(match numbers {
        Some(mut numbers) if numbers.len() == 1 => numbers.remove(0),
        Some(numbers) if !numbers.is_empty() => Value::Array(numbers),
        _ => Value::String(text.to_owned()),
    })
}

/// Exactly `N` numbers under `key`: a list, a list of lists, or OpenCV's matrix with its `data`.
pub(super) fn numbers<const N: usize>(value: &Value, key: &str) -> Result<[f64; N]> {
    numbers_of(value).map_err(|error| error.at(Place::key(key)))
}

/// The same, where the caller names the key.
pub(super) fn numbers_of<const N: usize>(value: &Value) -> Result<[f64; N]> {
    let data = value.get("data").unwrap_or(value);
    let mut found = Vec::with_capacity(N);
    collect(data, &mut found)?;
    <[f64; N]>::try_from(found)
        .map_err(|found| Error::usage(format!("{N} numbers expected, {} found", found.len())))
}

fn collect(value: &Value, found: &mut Vec<f64>) -> Result<()> {
    match value {
        Value::Array(items) => items.iter().try_for_each(|item| collect(item, found)),
        _ => match value.as_f64() {
            Some(number) if number.is_finite() => {
                found.push(number);
                Ok(())
            }
            _ => Err(Error::usage("a finite number expected")),
        },
    }
}

/// A number in a form that every reader recognises: all digits, a point, and no exponent (in YAML 1.1, which
/// Kalibr reads, `1e-7` is a string).
pub(super) fn decimal(value: f64) -> String {
    let text = value.to_string();
    if text.contains('.') { text } else { text + ".0" }
}

/// A number of pixels under `key`.
pub(super) fn size(number: f64, key: &str) -> Result<usize> {
    if number.fract() != 0.0 || !(1.0..=65_535.0).contains(&number) {
        return Err(Error::usage("is not a size in pixels, a whole number from 1 to 65535 expected")
            .at(Place::value(key, number)));
    }
    Ok(number as usize)
}
