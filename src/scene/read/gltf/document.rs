//! The JSON text of a glTF file, and the buffer that comes with it: taken apart, cut down to what is read,
//! checked.

use super::cut_down::{CutDown, cut_down};
use crate::error::{Error, Result};
use crate::scene::read::files::short;
use gltf::json::validation::{Error as Fault, Validate};
use gltf::json::{Path, Root};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

/// Most objects in the JSON text: each takes a few hundred bytes of memory, however short its text.
const MAX_OBJECTS: usize = 1 << 20;

/// Most commas in the JSON text, which separate values of 32 bytes.
const MAX_COMMAS: usize = 1 << 23;

/// Extensions that are read.
const READ: [&str; 3] = ["KHR_materials_emissive_strength", "KHR_mesh_quantization", "KHR_texture_transform"];

/// What the names of extensions begin with that change how a surface looks or add lights, but not where
/// anything is: they are left out even where a file requires them.
const LOOKS: [&str; 3] = ["KHR_materials_", "KHR_lights_", "EXT_lights_"];

/// A document of which every part that is read is sound, and every other part is empty.
pub(super) struct Document {
    pub(super) gltf: gltf::Document,
    /// The binary chunk of a `.glb`.
    pub(super) blob: Option<Vec<u8>>,
    /// The buffers that what is read lies in.
    pub(super) buffers: BTreeSet<usize>,
    /// For every animation its channels' numbers in the file.
    pub(super) channels: Vec<Vec<usize>>,
    pub(super) notes: Vec<String>,
}

impl Document {
    /// Takes a `.glb` or `.gltf` file apart.
    ///
    /// # Errors
    /// Of kind `Usage`: damage in a part that is read; other versions of glTF; extensions without which what
    /// is read cannot be read; more JSON than the limits of this file.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self> {
        let (text, blob) = if bytes.starts_with(b"glTF") { chunks(bytes)? } else { (bytes, None) };
        for (symbol, most, what) in [(b'{', MAX_OBJECTS, "objects"), (b',', MAX_COMMAS, "values")] {
            if text.iter().filter(|byte| **byte == symbol).count() > most {
                return Err(Error::usage(format!("has more than {most} JSON {what}")));
            }
        }
        let mut root: Map<String, Value> = serde_json::from_slice(text)
            .map_err(|error| Error::usage("cannot be read as glTF 2.0; is it complete?").because(error))?;
        check_version(root.get("asset"))?;
        let names = |root: &Map<String, Value>, key: &str| -> Vec<String> {
            let list = root.get(key).and_then(Value::as_array).into_iter().flatten();
            list.filter_map(Value::as_str).filter(|name| !READ.contains(name)).map(str::to_owned).collect()
        };
        let (used, required) = (names(&root, "extensionsUsed"), names(&root, "extensionsRequired"));
        let CutDown { extensions, buffers, channels, mut notes } = cut_down(&mut root);
        let (refused, harmless): (Vec<String>, Vec<String>) = required.into_iter().partition(|name| {
            extensions.contains(name) && !LOOKS.iter().any(|beginning| name.starts_with(beginning))
        });
        if !refused.is_empty() {
            return Err(Error::usage(format!(
                "requires extensions that are not read ({}); export it without them",
                short(&refused.join(", "))
            )));
        }
        if !used.is_empty() {
            notes.insert(0, format!("extensions left out: {}", short(&used.join(", "))));
        }
        if !harmless.is_empty() {
            notes.push(format!(
                "the file asks not to be shown without these extensions, without which it is shown: {}",
                short(&harmless.join(", "))
            ));
        }
        let blob = blob.map(<[u8]>::to_vec);
        Ok(Self { gltf: checked(root)?, blob, buffers, channels, notes })
    }
}

/// The JSON text and the binary chunk of a `.glb`; chunks of other types are skipped, as the specification
/// (section 4.4.3) asks.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>)> {
    let number = |bytes: &[u8], at: usize| -> Option<usize> {
        let four = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes([four[0], four[1], four[2], four[3]]) as usize)
    };
    let truncated = || Error::usage("cannot be read as glTF 2.0: the file is truncated");
    let (version, length) = number(bytes, 4).zip(number(bytes, 8)).ok_or_else(truncated)?;
    if version != 2 {
        return Err(Error::usage(format!("is binary glTF {version}; 2 is read: convert it")));
    }
    let mut rest = bytes.get(12..length).ok_or_else(truncated)?;
    let (mut text, mut blob) = (None, None);
    while !rest.is_empty() {
        let (length, kind) = number(rest, 0).zip(rest.get(4..8)).ok_or_else(truncated)?;
        let data = length.checked_add(8).and_then(|end| rest.get(8..end)).ok_or_else(truncated)?;
        rest = &rest[8 + length..];
        match kind {
            b"JSON" if text.is_none() => text = Some(data),
            b"BIN\0" if blob.is_none() => blob = Some(data),
            _ => {}
        }
    }
    Ok((text.ok_or_else(|| Error::usage("is damaged: it has no JSON chunk"))?, blob))
}

/// Refuses documents of other versions; one that says nothing is taken for 2.0.
fn check_version(asset: Option<&Value>) -> Result<()> {
    let says = |key: &str| asset.and_then(|asset| asset.get(key)).and_then(Value::as_str);
    let (version, least) = (says("version").unwrap_or("2.0"), says("minVersion").unwrap_or("2.0"));
    if version.split('.').next() == Some("2") && least == "2.0" {
        return Ok(());
    }
    let least = says("minVersion").map(|least| format!(" (at least {})", short(least))).unwrap_or_default();
    Err(Error::usage(format!("is glTF {}{least}; 2.0 is read: convert it", short(version))))
}

/// The document with all its indices in range.
fn checked(mut root: Map<String, Value>) -> Result<gltf::Document> {
    root.insert("asset".to_owned(), json!({ "version": "2.0" }));
    let root = Value::Object(root);
    let root = Root::deserialize(&root).map_err(|error| of_wrong_type(&root, error))?;
    let mut fault = None;
    root.validate(&root, Path::new, &mut |path, error| {
        let path = path().to_string();
        // The smallest and largest values of an accessor are not used. One without a view is all zeros.
        // Without positions a primitive is not drawn.
        let not_needed = [".min", ".max", "].bufferView", "[\"POSITION\"]"];
        if error != Fault::Missing || !not_needed.iter().any(|end| path.ends_with(end)) {
            fault.get_or_insert_with(|| Error::usage(format!("is damaged: {error}")).at(short(&path)));
        }
    });
    match fault {
        None => Ok(gltf::Document::from_json_without_validation(root)),
        Some(fault) => Err(fault),
    }
}

/// Says which part of the document is not as it should be: the reader of JSON values does not.
fn of_wrong_type(root: &Value, error: serde_json::Error) -> Error {
    let damaged = |error: serde_json::Error| Error::usage("is damaged").because(error);
    for (list, parts) in root.as_object().into_iter().flatten() {
        for (number, part) in parts.as_array().into_iter().flatten().enumerate() {
            let alone = json!({ "asset": { "version": "2.0" }, list: [part] });
            if let Err(error) = Root::deserialize(&alone) {
                return damaged(error).at(format!("{list}[{number}]"));
            }
        }
    }
    damaged(error)
}
