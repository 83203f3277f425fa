//! The body of an ascii PLY file: one element a line.

use super::files::short;
use crate::error::{Error, Place, Result};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

/// The lines after the header that are still to be read.
pub(super) struct AsciiBody<'a> {
    rest: &'a [u8],
    /// Number of the last line that was read, from 1.
    line: u64,
}

impl<'a> AsciiBody<'a> {
    /// The body of `bytes`, a whole file with this header; `None` where it is not text.
    pub fn of(header: &Header, bytes: &'a [u8]) -> Option<Self> {
        let mut body = Self { rest: bytes, line: 0 };
        match header.encoding {
            Encoding::Ascii => {
                while body.next_line()?.trim_ascii() != b"end_header" {}
                Some(body)
            }
            _ => None,
        }
    }

    /// The next element.
    ///
    /// # Errors
    /// The end of the file; a word that is no number, with its line.
    pub fn element<T: PropertyAccess>(&mut self, definition: &ElementDef) -> Result<T> {
        let line = loop {
            match self.next_line() {
                None => {
                    return Err(Error::usage(format!(
                        "is truncated: it ends before the last of the {} elements `{}` of its header",
                        definition.count,
                        short(&definition.name)
                    )));
                }
                Some(line) if line.trim_ascii().is_empty() => {}
                Some(line) => break line,
            }
        };
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let mut number = || -> Result<f64> {
            let word = String::from_utf8_lossy(words.next().unwrap_or_default());
            word.parse().map_err(|_| {
                let fault = match &*word {
                    "" => format!("has too few numbers for an element `{}`", short(&definition.name)),
                    word => format!("`{}` is no number", short(word)),
                };
                Error::usage(fault).at(Place::line(self.line))
            })
        };
        let mut element = T::new();
        for (name, property) in &definition.properties {
            let property = match &property.data_type {
                PropertyType::Scalar(kind) => scalar(kind, number()?),
                PropertyType::List(_, kind) => {
                    let count = number()?;
                    // Each number takes two bytes of the line.
                    if !(0.0..=line.len() as f64).contains(&count) {
                        let fault = format!("has a list of {count} numbers, for which it is too short");
                        return Err(Error::usage(fault).at(Place::line(self.line)));
                    }
                    list(kind, (0..count as usize).map(|_| number()).collect::<Result<_>>()?)
                }
            };
            if let PropertyAccessResult::UnsupportedType = element.set_property(name, property) {
                let fault = format!("its property `{}` has a type that it cannot have", short(name));
                return Err(Error::usage(fault));
            }
        }
        Ok(element)
    }

    fn next_line(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|byte| *byte == b'\n').unwrap_or(self.rest.len());
        let line = &self.rest[..end];
        self.rest = self.rest.get(end + 1..).unwrap_or_default();
        self.line += 1;
        Some(line)
    }
}

/// A number as the type of its property; numbers beyond a type become its limits.
fn scalar(kind: &ScalarType, value: f64) -> Property {
    match kind {
        ScalarType::Char => Property::Char(value as i8),
        ScalarType::UChar => Property::UChar(value as u8),
        ScalarType::Short => Property::Short(value as i16),
        ScalarType::UShort => Property::UShort(value as u16),
        ScalarType::Int => Property::Int(value as i32),
        ScalarType::UInt => Property::UInt(value as u32),
        ScalarType::Float => Property::Float(value as f32),
        ScalarType::Double => Property::Double(value),
    }
}

fn list(kind: &ScalarType, values: Vec<f64>) -> Property {
    let values = values.into_iter();
    match kind {
        ScalarType::Char => Property::ListChar(values.map(|value| value as i8).collect()),
        ScalarType::UChar => Property::ListUChar(values.map(|value| value as u8).collect()),
        ScalarType::Short => Property::ListShort(values.map(|value| value as i16).collect()),
        ScalarType::UShort => Property::ListUShort(values.map(|value| value as u16).collect()),
        ScalarType::Int => Property::ListInt(values.map(|value| value as i32).collect()),
        ScalarType::UInt => Property::ListUInt(values.map(|value| value as u32).collect()),
        ScalarType::Float => Property::ListFloat(values.map(|value| value as f32).collect()),
        ScalarType::Double => Property::ListDouble(values.collect()),
    }
}
