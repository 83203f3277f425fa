//! What is read of a glTF document. Everything else is removed before anybody checks it: keys that are not
//! read, and all that the shown scene does not refer to. So a damaged or unusual part that is left out anyway
//! does not decide whether the rest loads.

mod reached;

use reached::{LISTS, Reached, empty, list, list_of};
use serde_json::{Map, Value, json};
use std::collections::{BTreeSet, HashSet};

/// The keys that are read and hold neither indices nor anything that is handled by name below.
const VALUES: &str = "alphaCutoff alphaMode attributes baseColorFactor baseColorTexture byteLength byteOffset \
                      byteStride channels componentType count emissiveFactor emissiveStrength emissiveTexture \
                      interpolation matrix metallicFactor metallicRoughnessTexture mode node normalTexture \
                      normalized occlusionTexture offset path pbrMetallicRoughness perspective primitives \
                      rotation roughnessFactor samplers scale sparse target targets texCoord translation type \
                      uri values weights wrapS wrapT yfov znear KHR_materials_emissive_strength \
                      KHR_texture_transform";

/// What was found while the document was cut down.
#[derive(Default)]
pub(super) struct CutDown {
    /// Names of the extensions of parts that are read.
    pub(super) extensions: BTreeSet<String>,
    /// The buffers that what is read lies in.
    pub(super) buffers: BTreeSet<usize>,
    /// For every animation its channels' numbers in the file.
    pub(super) channels: Vec<Vec<usize>>,
    pub(super) notes: Vec<String>,
}

/// Removes from a document what is not read. Parts keep their numbers: those that nothing refers to become
/// empty ones.
pub(super) fn cut_down(root: &mut Map<String, Value>) -> CutDown {
    let mut reached = Reached::default();
    reached.extensions_of(&json!({ "extensions": root.remove("extensions") }));
    let is_read = |key: &str| LISTS.contains(&key) || ["animations", "scene", "scenes"].contains(&key);
    root.retain(|key, _| is_read(key));
    let keys: HashSet<&str> = VALUES.split_whitespace().collect();
    root.values_mut().for_each(|value| keep_known(value, &keys));
    root.get_mut("meshes").into_iter().for_each(keep_drawn);
    root.get_mut("images").into_iter().for_each(give_type);
    match only_shown(root) {
        Some(scene) => reached.visit(scene),
        None => reached.add("nodes", 0..list(root, "nodes").len()),
    }
    reached.follow(root);
    let channels = only_moving(root, &mut reached);
    reached.follow(root);
    only_perspective(root, &mut reached);
    reached.empty_others(root);
    CutDown {
        buffers: reached.all("buffers"),
        extensions: reached.extensions,
        channels,
        notes: reached.notes,
    }
}

/// Removes all keys but the known ones, in all objects.
fn keep_known(value: &mut Value, keys: &HashSet<&str>) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(|item| keep_known(item, keys)),
        Value::Object(fields) => {
            fields.retain(|key, value| match key.as_str() {
                "name" => value.is_string(),
                // Of what other programs say in extras nothing is known.
                "extras" => {
                    let own = value.get_mut("lightcast").map(Value::take);
                    own.is_some_and(|own| {
                        *value = json!({ "lightcast": own });
                        true
                    })
                }
                // Their names are kept, to be reported.
                "extensions" => value.as_object_mut().is_some_and(|extensions| {
                    extensions
                        .iter_mut()
                        .filter(|(name, _)| !keys.contains(name.as_str()))
                        .for_each(|(_, extension)| *extension = Value::Null);
                    extensions.values_mut().for_each(|extension| keep_known(extension, keys));
                    true
                }),
                // Only that there is one is reported.
                "occlusionTexture" => {
                    *value = Value::Null;
                    true
                }
                key if keys.contains(key) || list_of(key).is_some() => {
                    keep_known(value, keys);
                    true
                }
                _ => false,
            });
        }
        _ => {}
    }
}

/// Empties primitives that are not drawn: points, lines, and what has no positions.
fn keep_drawn(meshes: &mut Value) {
    let meshes = meshes.as_array_mut().into_iter().flatten();
    let primitives = meshes.filter_map(|mesh| mesh.get_mut("primitives")?.as_array_mut()).flatten();
    for primitive in primitives.filter(|primitive| primitive.is_object()) {
        let has_triangles = primitive["mode"].as_u64().is_none_or(|mode| mode > 3);
        if !has_triangles || primitive["attributes"]["POSITION"].is_null() {
            let mode = primitive["mode"].as_u64().unwrap_or(4);
            *primitive = json!({ "attributes": {}, "mode": mode });
        }
    }
}

/// Gives the type to pictures that `gltf` wants to know, although their bytes tell it.
fn give_type(images: &mut Value) {
    for image in images.as_array_mut().into_iter().flatten().filter_map(Value::as_object_mut) {
        image.insert("mimeType".to_owned(), json!("image/png"));
    }
}

/// Empties all scenes but the one that is shown, which is returned; `None` where there is no scene.
fn only_shown(root: &mut Map<String, Value>) -> Option<&Value> {
    let shown = root.get("scene").and_then(Value::as_u64).unwrap_or(0);
    let scenes = root.get_mut("scenes")?.as_array_mut()?;
    for (number, scene) in scenes.iter_mut().enumerate() {
        let nodes = scene.get_mut("nodes").map(Value::take).filter(|_| number as u64 == shown);
        *scene = json!({ "nodes": nodes.unwrap_or_else(|| json!([])) });
    }
    scenes.get(usize::try_from(shown).ok()?).or(scenes.first())
}

/// Keeps the channels that move a node which is reached; returns their numbers.
fn only_moving(root: &mut Map<String, Value>, reached: &mut Reached) -> Vec<Vec<usize>> {
    let Some(animations) = root.get_mut("animations").and_then(Value::as_array_mut) else {
        return Vec::new();
    };
    let mut kept = Vec::new();
    for animation in animations {
        let (mut numbers, mut channels, mut used) = (Vec::new(), Vec::new(), BTreeSet::new());
        let all = animation.get_mut("channels").map(Value::take);
        for (number, channel) in all.iter().filter_map(Value::as_array).flatten().enumerate() {
            let target = &channel["target"];
            let is_known =
                ["translation", "rotation", "scale", "weights"].iter().any(|path| target["path"] == *path);
            let Some(node) = target["node"].as_u64().filter(|_| is_known) else {
                reached.extensions_of(target);
                reached.note(
                    "animations left out of what is no translation, rotation, scale or weight of a node",
                );
                continue;
            };
            if reached.has("nodes", node as usize) {
                used.extend(channel["sampler"].as_u64());
                numbers.push(number);
                channels.push(channel.clone());
            }
        }
        let samplers = animation.get("samplers").and_then(Value::as_array).cloned().unwrap_or_default();
        let sampler = |number: &u64| samplers.get(*number as usize);
        used.iter().filter_map(sampler).for_each(|sampler| reached.visit(sampler));
        // A sampler that is not used becomes one that is.
        let samplers: Vec<&Value> = match used.iter().find_map(sampler) {
            Some(any) => {
                (0..).zip(&samplers).map(|(i, own)| if used.contains(&i) { own } else { any }).collect()
            }
            None => Vec::new(),
        };
        *animation = json!({ "channels": channels, "samplers": samplers });
        kept.push(numbers);
    }
    kept
}

/// Makes orthographic cameras, which are not shown, of reached ones that are no sound perspective ones.
fn only_perspective(root: &mut Map<String, Value>, reached: &mut Reached) {
    let cameras = root.get_mut("cameras").and_then(Value::as_array_mut);
    for (number, camera) in cameras.into_iter().flatten().enumerate() {
        let is_perspective = camera["type"] == "perspective";
        let is_sound = ["yfov", "znear"].iter().all(|key| camera["perspective"][key].is_number());
        if is_perspective && is_sound {
            continue;
        }
        if is_perspective && reached.has("cameras", number) {
            reached.note(&format!("camera {number} left out: it has no angle of view or no near plane"));
        }
        *camera = empty("cameras");
    }
}
