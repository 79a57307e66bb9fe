//! The properties of glTF 2.0: what of them is read, and what else a file has.

use super::parts::name;
use crate::{LoadError, Place};
use gltf::json::{Root, Value, deserialize};
use std::path::Path;

/// The top-level arrays, and what one of their elements is called.
const KINDS: [(&str, &str); 15] = [
    ("accessors", "accessor"),
    ("animations", "animation"),
    ("bufferViews", "buffer view"),
    ("buffers", "buffer"),
    ("cameras", "camera"),
    ("images", "image"),
    ("materials", "material"),
    ("meshes", "mesh"),
    ("nodes", "node"),
    ("samplers", "sampler"),
    ("scenes", "scene"),
    ("skins", "skin"),
    ("textures", "texture"),
    ("extensionsRequired", "extension"),
    ("extensionsUsed", "extension"),
];

/// What each kind of object may have besides `name` and `extensions`: what is read, and what makes no
/// difference to a path tracer: bounds, targets, hints and authors (min, max, target, skeleton, copyright,
/// generator), mip maps (minFilter), what rasterisers clip (znear, zfar), and the aspect of a picture, which
/// the caller gives. What makes one is said where it is met. Objects of other extensions are not looked into:
/// those are named whole.
#[rustfmt::skip]
const KNOWN: [(&str, &[&str]); 46] = [
    ("", &["accessors", "animations", "asset", "bufferViews", "buffers", "cameras", "extensionsRequired",
        "extensionsUsed", "images", "materials", "meshes", "nodes", "samplers", "scene", "scenes", "skins", "textures"]),
    ("accessors", &["bufferView", "byteOffset", "componentType", "count", "max", "min", "normalized", "sparse", "type"]),
    ("accessors/sparse", &["count", "indices", "values"]),
    ("accessors/sparse/indices", &["bufferView", "byteOffset", "componentType"]),
    ("accessors/sparse/values", &["bufferView", "byteOffset"]),
    ("asset", &["copyright", "generator", "minVersion", "version"]),
    ("bufferViews", &["buffer", "byteLength", "byteOffset", "byteStride", "target"]),
    ("buffers", &["byteLength", "uri"]),
    ("cameras", &["orthographic", "perspective", "type"]),
    ("cameras/orthographic", &["xmag", "ymag", "zfar", "znear"]),
    ("cameras/perspective", &["aspectRatio", "yfov", "zfar", "znear"]),
    ("images", &["bufferView", "mimeType", "uri"]),
    ("materials", &["alphaCutoff", "alphaMode", "doubleSided", "emissiveFactor", "emissiveTexture", "normalTexture",
        "occlusionTexture", "pbrMetallicRoughness"]),
    ("materials/emissiveTexture", &["index", "texCoord"]),
    ("materials/normalTexture", &["index", "scale", "texCoord"]),
    ("materials/occlusionTexture", &["index", "strength", "texCoord"]),
    ("materials/pbrMetallicRoughness", &["baseColorFactor", "baseColorTexture", "metallicFactor",
        "metallicRoughnessTexture", "roughnessFactor"]),
    ("materials/pbrMetallicRoughness/baseColorTexture", &["index", "texCoord"]),
    ("materials/pbrMetallicRoughness/metallicRoughnessTexture", &["index", "texCoord"]),
    ("materials/KHR_materials_clearcoat", &["clearcoatFactor", "clearcoatNormalTexture", "clearcoatRoughnessFactor",
        "clearcoatRoughnessTexture", "clearcoatTexture"]),
    ("materials/KHR_materials_clearcoat/clearcoatTexture", &["index", "texCoord"]),
    ("materials/KHR_materials_clearcoat/clearcoatRoughnessTexture", &["index", "texCoord"]),
    ("materials/KHR_materials_emissive_strength", &["emissiveStrength"]),
    ("materials/KHR_materials_ior", &["ior"]),
    ("materials/KHR_materials_pbrSpecularGlossiness", &["diffuseFactor", "diffuseTexture", "glossinessFactor",
        "specularFactor", "specularGlossinessTexture"]),
    ("materials/KHR_materials_pbrSpecularGlossiness/diffuseTexture", &["index", "texCoord"]),
    ("materials/KHR_materials_pbrSpecularGlossiness/specularGlossinessTexture", &["index", "texCoord"]),
    ("materials/KHR_materials_specular", &["specularColorFactor", "specularColorTexture", "specularFactor",
        "specularTexture"]),
    ("materials/KHR_materials_transmission", &["transmissionFactor", "transmissionTexture"]),
    ("materials/KHR_materials_unlit", &[]),
    // Of a traced volume, the thickness is that of the mesh
    ("materials/KHR_materials_volume", &["attenuationColor", "attenuationDistance", "thicknessFactor",
        "thicknessTexture"]),
    ("meshes", &["primitives", "weights"]),
    ("meshes/primitives", &["attributes", "indices", "material", "mode", "targets"]),
    ("meshes/primitives/targets", &["NORMAL", "POSITION", "TANGENT"]),
    ("nodes", &["camera", "children", "matrix", "mesh", "rotation", "scale", "skin", "translation", "weights"]),
    ("nodes/EXT_mesh_gpu_instancing", &["attributes"]),
    ("nodes/KHR_lights_punctual", &["light"]),
    ("nodes/KHR_node_visibility", &["visible"]),
    ("samplers", &["magFilter", "minFilter", "wrapS", "wrapT"]),
    ("scenes", &["nodes"]),
    ("skins", &["inverseBindMatrices", "joints", "skeleton"]),
    ("textures", &["sampler", "source"]),
    ("/KHR_lights_punctual", &["lights"]),
    ("/KHR_lights_punctual/lights", &["color", "intensity", "range", "spot", "type"]),
    ("/KHR_lights_punctual/lights/spot", &["innerConeAngle", "outerConeAngle"]),
    ("/KHR_texture_transform", &["offset", "rotation", "scale", "texCoord"]),
];

/// Attributes of vertices that are read, or warned of where they are met.
const ATTRIBUTES: [&str; 10] = [
    "COLOR_0",
    "COLOR_1",
    "JOINTS_0",
    "JOINTS_1",
    "NORMAL",
    "POSITION",
    "TANGENT",
    "WEIGHTS_0",
    "WEIGHTS_1",
    "TEXCOORD",
];

/// Brings JSON that glTF allows to the types of the crate, which are stricter: `extras` may be anything, so
/// they are dropped; so are channels of animations, which need no node; and a scene need not have nodes.
pub(super) fn tidy(root: &mut Value) {
    drop_extras(root);
    let arrays = |root: &mut Value, key: &str| match root.get_mut(key) {
        Some(Value::Array(elements)) => std::mem::take(elements),
        _ => vec![],
    };
    let mut animations = arrays(root, "animations");
    for animation in &mut animations {
        let name = animation.get("name").filter(|name| name.is_string()).cloned();
        *animation = Value::Object(
            [("channels", vec![]), ("samplers", vec![])]
                .map(|(key, none)| (key.to_owned(), Value::Array(none)))
                .into_iter()
                .chain(name.map(|name| ("name".to_owned(), name)))
                .collect(),
        );
    }
    if !animations.is_empty() {
        root["animations"] = Value::Array(animations);
    }
    if let Some(Value::Array(scenes)) = root.get_mut("scenes") {
        for scene in scenes.iter_mut().filter_map(Value::as_object_mut) {
            scene.entry("nodes").or_insert_with(|| Value::Array(vec![]));
        }
    }
}

fn drop_extras(value: &mut Value) {
    match value {
        Value::Array(elements) => elements.iter_mut().for_each(drop_extras),
        Value::Object(object) => {
            object.remove("extras");
            object.values_mut().for_each(drop_extras);
        }
        _ => {}
    }
}

/// Checks that the file is of version 2, and requires no later one. Version 1 may leave out that it is.
pub(super) fn check_version(path: &Path, root: &Value) -> Result<(), LoadError> {
    let unsupported =
        |version: &Value| Place::part(path, "asset").unsupported(format_args!("version {version} of glTF"));
    let stated = |key: &str| root.get("asset").and_then(|asset| asset.get(key));
    match stated("minVersion") {
        Some(Value::String(version)) if version != "2.0" => {
            return Err(unsupported(&version.as_str().into()));
        }
        _ => {}
    }
    match stated("version") {
        Some(Value::String(version)) if version.starts_with("2.") => Ok(()),
        // Not what version 2 writes, but meant so
        Some(Value::Number(number)) if number.as_f64().is_some_and(|n| (2.0..3.0).contains(&n)) => Ok(()),
        Some(version) => Err(unsupported(version)),
        None if root.get("meshes").or(root.get("accessors")).is_some_and(Value::is_object) => {
            Err(Place::file(path).unsupported("version 1 of glTF, whose meshes are no list,"))
        }
        None => Ok(()),
    }
}

/// The part of the file that the types of the crate do not take: the first that alone is an error, too.
pub(super) fn culprit(root: &Value) -> Option<String> {
    for (key, value) in root.as_object()? {
        let is_bad = |value: Value| {
            let mut small: Value =
                deserialize::from_str(r#"{"asset": {"version": "2.0"}}"#).unwrap_or_default();
            small[key] = value;
            deserialize::from_value::<Root>(small).is_err()
        };
        let elements = value.as_array().map(Vec::as_slice).unwrap_or_default();
        for (index, element) in elements.iter().enumerate() {
            if is_bad(Value::Array(vec![element.clone()])) {
                return Some(name(kind(key), index, element.get("name").and_then(Value::as_str)));
            }
        }
        if elements.is_empty() && is_bad(value.clone()) {
            return Some(key.clone());
        }
    }
    None
}

fn kind(array: &str) -> &str {
    KINDS.iter().find(|kind| kind.0 == array).map_or(array, |kind| kind.1)
}

/// Properties that nobody knows, each with what has it.
pub(super) fn unread(root: &Value) -> Vec<(String, String)> {
    let mut found = Vec::new();
    visit("", root, "", &mut found);
    found
}

/// Adds the unknown properties of a value of the kind `path` to `found`, and of what is in it. `place` is the
/// element that it is in.
fn visit(path: &str, value: &Value, place: &str, found: &mut Vec<(String, String)>) {
    match value {
        Value::Array(elements) => {
            for (index, element) in elements.iter().enumerate() {
                let is_top = !path.is_empty() && !path.contains('/');
                let called = || name(kind(path), index, element.get("name").and_then(Value::as_str));
                let inner = if is_top { called() } else { place.to_owned() };
                visit(path, element, &inner, found);
            }
        }
        Value::Object(object) => {
            if path == "meshes/primitives/attributes" {
                let known = |key: &str| {
                    let stem = if key.starts_with("TEXCOORD_") { "TEXCOORD" } else { key };
                    // Names of applications begin so
                    key.starts_with('_') || ATTRIBUTES.contains(&stem)
                };
                let unknown = object.keys().filter(|key| !known(key));
                found.extend(unknown.map(|key| (place.to_owned(), key.clone())));
                return;
            }
            let Some((_, known)) = KNOWN.iter().find(|known| {
                // The transform of a texture is the same wherever that is
                known.0 == path
                    || path.ends_with("/KHR_texture_transform") && known.0 == "/KHR_texture_transform"
            }) else {
                return;
            };
            for (key, value) in object {
                let inner = if path.is_empty() { key.clone() } else { format!("{path}/{key}") };
                let place = if place.is_empty() { key } else { place };
                match (key.as_str(), value) {
                    ("name", _) => {}
                    ("extensions", Value::Object(extensions)) => {
                        for (extension, value) in extensions {
                            visit(&format!("{path}/{extension}"), value, place, found);
                        }
                    }
                    _ if known.contains(&key.as_str()) => visit(&inner, value, place, found),
                    ("extensions", _) => {}
                    _ => found.push((place.to_owned(), key.clone())),
                }
            }
        }
        _ => {}
    }
}
