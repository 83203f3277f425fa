//! Which parts of a glTF document others refer to, beginning at the scene.

use crate::scene::read::notes::add_note;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// The lists of parts that others refer to.
pub(super) const LISTS: [&str; 11] = [
    "accessors",
    "bufferViews",
    "buffers",
    "cameras",
    "images",
    "materials",
    "meshes",
    "nodes",
    "samplers",
    "skins",
    "textures",
];

/// The list that an index, or a list of indices, with this key points into.
pub(super) fn list_of(key: &str) -> Option<&'static str> {
    Some(match key {
        "POSITION" | "NORMAL" | "TEXCOORD_0" | "COLOR_0" => "accessors",
        "JOINTS_0" | "JOINTS_1" | "JOINTS_2" | "JOINTS_3" => "accessors",
        "WEIGHTS_0" | "WEIGHTS_1" | "WEIGHTS_2" | "WEIGHTS_3" => "accessors",
        "indices" | "input" | "output" | "inverseBindMatrices" => "accessors",
        "buffer" => "buffers",
        "bufferView" => "bufferViews",
        "camera" => "cameras",
        "index" => "textures",
        "joints" | "children" | "nodes" => "nodes",
        "material" => "materials",
        "mesh" => "meshes",
        "sampler" => "samplers",
        "skin" => "skins",
        "source" => "images",
        _ => return None,
    })
}

/// The parts of a list; none where the document does not have it.
pub(super) fn list<'a>(root: &'a Map<String, Value>, key: &str) -> &'a [Value] {
    root.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// A part of a list that refers to nothing, and that nothing refers to.
pub(super) fn empty(list: &str) -> Value {
    match list {
        "accessors" => json!({ "componentType": 5126, "count": 1, "type": "SCALAR" }),
        // There is a buffer where a view is read.
        "bufferViews" => json!({ "buffer": 0, "byteLength": 1 }),
        "cameras" => json!({
            "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "zfar": 1, "znear": 0 }
        }),
        "meshes" => json!({ "primitives": [] }),
        "skins" => json!({ "joints": [] }),
        _ => json!({}),
    }
}

/// Parts that are read because others refer to them.
#[derive(Default)]
pub(super) struct Reached {
    /// By their lists.
    parts: BTreeMap<&'static str, BTreeSet<usize>>,
    /// Those whose own indices were not looked at yet.
    new: Vec<(&'static str, usize)>,
    /// Names of the extensions of these parts.
    pub(super) extensions: BTreeSet<String>,
    pub(super) notes: Vec<String>,
}

impl Reached {
    pub(super) fn has(&self, list: &str, number: usize) -> bool {
        self.parts.get(list).is_some_and(|parts| parts.contains(&number))
    }

    /// The numbers of the parts of a list that are reached.
    pub(super) fn all(&self, list: &str) -> BTreeSet<usize> {
        self.parts.get(list).cloned().unwrap_or_default()
    }

    pub(super) fn note(&mut self, note: &str) {
        add_note(&mut self.notes, note);
    }

    /// Adds parts of a list.
    pub(super) fn add(&mut self, list: &'static str, numbers: impl IntoIterator<Item = usize>) {
        let parts = self.parts.entry(list).or_default();
        self.new
            .extend(numbers.into_iter().filter(|number| parts.insert(*number)).map(|number| (list, number)));
    }

    /// Adds what `value` refers to.
    pub(super) fn visit(&mut self, value: &Value) {
        match value {
            Value::Array(items) => items.iter().for_each(|item| self.visit(item)),
            Value::Object(fields) => {
                self.extensions_of(value);
                for (key, value) in fields {
                    match list_of(key).filter(|_| !value.is_object()) {
                        _ if key == "extras" => {}
                        Some(list) => {
                            let numbers = value.as_array().into_iter().flatten().chain([value]);
                            self.add(list, numbers.filter_map(Value::as_u64).map(|number| number as usize));
                        }
                        None if key == "occlusionTexture" => {
                            self.note(
                                "occlusion textures left out: the lights' own shadows take their place",
                            );
                        }
                        None => self.visit(value),
                    }
                }
            }
            _ => {}
        }
    }

    /// Notes the names of a part's extensions.
    pub(super) fn extensions_of(&mut self, part: &Value) {
        let extensions = part.get("extensions").and_then(Value::as_object);
        self.extensions.extend(extensions.into_iter().flatten().map(|(name, _)| name.clone()));
    }

    /// Adds what the parts refer to that are reached so far, and so on.
    pub(super) fn follow(&mut self, root: &Map<String, Value>) {
        while let Some((key, number)) = self.new.pop() {
            if let Some(part) = list(root, key).get(number) {
                self.visit(part);
            }
        }
    }

    /// Makes empty parts of those that are not reached, and removes lists of which nothing is reached.
    pub(super) fn empty_others(&self, root: &mut Map<String, Value>) {
        for key in LISTS {
            let Some(reached) = self.parts.get(key).filter(|reached| !reached.is_empty()) else {
                root.remove(key);
                continue;
            };
            let parts = root.get_mut(key).and_then(Value::as_array_mut).into_iter().flatten().enumerate();
            for (_, part) in parts.filter(|(number, _)| !reached.contains(number)) {
                *part = empty(key);
            }
        }
    }
}
