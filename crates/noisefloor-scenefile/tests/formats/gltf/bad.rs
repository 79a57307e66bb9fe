//! Bad files: what is said of them names the place, and nothing is allocated for what they only claim to
//! have.

use super::kit::{Maker, json, load};
use crate::util::{assert_warns, fails};
use base64::prelude::{BASE64_STANDARD, Engine};
use gltf::json::Value;
use noisefloor_scenefile::LoadError;

/// A lit scene with a textured wall.
fn good() -> Maker {
    let mut maker = Maker::new();
    let mesh = maker.rectangle(
        [-1.0, 1.0],
        [-1.0, 1.0],
        -1.0,
        r#"{"name": "Oak", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}"#,
    );
    maker.texture(1, &[[9, 9, 9, 255]], r#"{"wrapS": 33648}"#);
    maker.root["meshes"][0]["name"] = "Table".into();
    maker.node(&format!(r#"{{"mesh": {mesh}}}"#));
    maker.root["extensions"]["KHR_lights_punctual"]["lights"] = json(r#"[{"type": "point"}]"#);
    maker.node(r#"{"extensions": {"KHR_lights_punctual": {"light": 0}}}"#);
    maker
}

/// What is said of the good scene with `value` at `pointer`.
fn error(pointer: &str, value: &str) -> LoadError {
    let mut maker = good();
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = maker.root.pointer_mut(parent).unwrap_or_else(|| panic!("no {pointer}"));
    match parent {
        Value::Array(elements) => elements[key.parse::<usize>().unwrap()] = json(value),
        parent => parent[key] = json(value),
    }
    match maker.load() {
        Err(error) => error,
        Ok(_) => panic!("{value} at {pointer} is accepted"),
    }
}

#[test]
fn the_good_scene_is_good() {
    let loaded = good().load().unwrap();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    assert_eq!(loaded.scene.surfaces(), 2);
}

#[test]
fn every_error_names_its_place() {
    let table = r#"mesh 0 "Table", primitive 0: "#;
    for (pointer, value, place, what) in [
        // Indices that lead nowhere
        ("/scene", "7", "scene.gltf: ", "scene 7 does not exist"),
        ("/scenes/0/nodes/0", "99", "scene.gltf: ", "node 99 does not exist"),
        ("/nodes/0/camera", "9", "node 0: ", "camera 9 does not exist"),
        ("/nodes/1/mesh", "9", "node 1: ", "mesh 9 does not exist"),
        ("/nodes/2/extensions/KHR_lights_punctual/light", "1", "node 2: ", "light 1 does not exist"),
        ("/meshes/0/primitives/0/attributes/POSITION", "99", table, "accessor 99 does not exist"),
        ("/meshes/0/primitives/0/indices", "99", table, "accessor 99 does not exist"),
        ("/meshes/0/primitives/0/material", "99", table, "material 99 does not exist"),
        ("/accessors/0/bufferView", "99", table, "buffer view 99 does not exist"),
        ("/bufferViews/0/buffer", "1", table, "buffer 1 does not exist"),
        (
            "/materials/0/pbrMetallicRoughness/baseColorTexture/index",
            "5",
            r#"material 0 "Oak": "#,
            "texture 5",
        ),
        ("/textures/0/source", "5", "texture 0: ", "image 5 does not exist"),
        ("/textures/0/sampler", "5", "texture 0: ", "sampler 5 does not exist"),
        // What glTF does not have
        ("/accessors/0/componentType", "5124", table, "componentType of accessor 0"),
        ("/accessors/0/type", r#""VEC2""#, table, "accessor 0: an element must have 3 numbers here, not 2"),
        ("/accessors/0/type", r#""VEC5""#, table, "accessor 0: an element must have 3 numbers here"),
        ("/accessors/2/componentType", "5122", table, "accessor 2: indices are unsigned"),
        ("/meshes/0/primitives/0/mode", "7", table, "mode"),
        ("/samplers/0/wrapS", "1", "texture 0: ", "wrapping mode"),
        ("/samplers/0/magFilter", "1", "texture 0: ", "magFilter"),
        ("/materials/0/alphaMode", r#""FOG""#, r#"material 0 "Oak": "#, "alphaMode"),
        ("/cameras/0/type", r#""fisheye""#, "camera 0: ", "perspective"),
        // A mesh that is lost is an error
        (
            "/accessors/0",
            r#"{"componentType": 5126, "type": "VEC3", "count": 4}"#,
            table,
            "its positions, accessor 0, have no data",
        ),
        ("/extensions/KHR_lights_punctual/lights/0/type", r#""spot""#, "light 0: ", "spot light"),
        // Lengths
        ("/accessors/0/count", "5", table, "accessor 0: 5 elements of 12 bytes"),
        ("/accessors/0/count", "18446744073709551615", table, "vertices up to here"),
        ("/accessors/2/count", "18446744073709551615", table, "surfaces so far"),
        ("/accessors/1/count", "18446744073709551615", table, "4 positions, but 18446744073709551615"),
        ("/accessors/0/byteOffset", "4", table, "accessor 0: 4 elements of 12 bytes"),
        ("/accessors/0/byteOffset", "18446744073709551615", table, "accessor 0"),
        ("/bufferViews/0/byteStride", "8", table, "accessor 0: a byteStride of 8"),
        ("/bufferViews/0/byteStride", "18446744073709551615", table, "accessor 0"),
        ("/bufferViews/0/byteLength", "999999", "buffer view 0: ", "999999 bytes from byte 0"),
        ("/bufferViews/0/byteOffset", "18446744073709551615", "buffer view 0: ", "past the end"),
        ("/bufferViews/1/byteLength", "24", table, "accessor 1: 4 elements of 8 bytes, 8 apart from byte 0"),
        ("/accessors/1/count", "3", table, "4 positions, but 3 texture coordinates"),
        // Hierarchies
        ("/nodes/2/children", "[2]", "node 2: ", "reached twice"),
        ("/nodes/2/children", "[1]", "node 1: ", "reached twice"),
        ("/nodes/1/rotation", "[0, 0, 0, 0]", "node 1: ", "rotation"),
        ("/nodes/1/rotation", "[1e39, 0, 0, 0]", "node 1: ", "rotation"),
        ("/nodes/1/rotation", "[\"a\", 0, 0, 0]", "node 1: ", "not the JSON of a glTF file"),
        // What the renderer does not take
        ("/nodes/1/translation", "[1e9, 0, 0]", table, "outside"),
        ("/nodes/1/scale", "[1e39, 0, 0]", table, "not finite"),
        ("/nodes/0/scale", "[0, 0, 0]", "scene.gltf", "camera has no orientation"),
        ("/cameras/0/perspective/yfov", "4", "scene.gltf", "field of view"),
        ("/extensions/KHR_lights_punctual/lights/0/intensity", "-1", "light 0", "outside"),
        // Images and buffers
        ("/images/0/uri", r#""data:image/png;base64,AAAA""#, "image 0: ", "picture"),
        ("/images/0/uri", "null", "image 0: ", "neither"),
        ("/images/0/uri", r#""data:image/png,AAAA""#, "image 0: ", "not base64"),
        ("/images/0/uri", r#""data:image/png;base64""#, "image 0: ", "comma"),
        ("/images/0/uri", r#""data:;base64,A*AA""#, "image 0: ", "not base64"),
        ("/images/0/uri", r#""../secret.png""#, "image 0: ", "outside the folder"),
        ("/images/0/uri", r#""%2e%2e/secret.png""#, "image 0: ", "outside the folder"),
        ("/images/0/uri", r#""/etc/passwd""#, "image 0: ", "outside the folder"),
        ("/images/0/uri", r#""file:///etc/passwd""#, "image 0: ", "scheme \"file\""),
        ("/images/0/uri", r#""http://localhost/a.png""#, "image 0: ", "scheme \"http\""),
        ("/images/0/uri", r#""missing.png""#, "image 0", "cannot be read"),
        ("/images/0/uri", r#""%zz.png""#, "image 0: ", "not a URI"),
        ("/buffers", r#"[{"byteLength": 4}]"#, "buffer 0: ", "neither"),
        (
            "/buffers",
            r#"[{"name": "B", "byteLength": 4, "uri": "data:;base64,AAAA"}]"#,
            r#"buffer 0 "B": "#,
            "byteLength is 4",
        ),
        (
            "/buffers",
            r#"[{"byteLength": 18446744073709551615, "uri": "data:;base64,AAAA"}]"#,
            "buffer 0: ",
            "byteLength",
        ),
        // The whole
        ("/asset/version", r#""1.0""#, "asset: ", "version \"1.0\""),
        ("/asset/minVersion", r#""2.1""#, "asset: ", "version \"2.1\""),
        ("/asset/version", "2", "asset: ", "not the JSON of a glTF file"),
        (
            "/extensionsRequired",
            r#"["EXT_meshopt_compression"]"#,
            "extensionsRequired: ",
            "EXT_meshopt_compression",
        ),
        ("/scenes", "[]", "scene.gltf: ", "scene 0 does not exist"),
    ] {
        let error = error(pointer, value);
        let text = error.to_string();
        assert!(
            text.contains(place) && text.contains(what),
            "{value} at {pointer}: {text}, expected {place} … {what}"
        );
    }
}

#[test]
fn a_file_must_have_something_to_see() {
    for (scene, what) in
        [(r#""scenes": []"#, "has no scene"), (r#""scenes": [{"nodes": []}]"#, "neither a camera nor a mesh")]
    {
        let text = format!(r#"{{"asset": {{"version": "2.0"}}, {scene}}}"#);
        fails(load("a.gltf", text.as_bytes()), what);
    }
}

#[test]
fn nothing_is_allocated_for_what_is_only_claimed() {
    // Zeros without data: a gigabyte of positions from a few hundred bytes, but for one that is given
    let mut maker = good();
    let (at, value) = (maker.view(&[0], ""), maker.view(&[0; 12], ""));
    let accessor = &mut maker.root["accessors"][0];
    accessor.as_object_mut().unwrap().remove("bufferView");
    accessor["count"] = 90_000_000.into();
    accessor["sparse"] = json(&format!(
        r#"{{"count": 1, "indices": {{"bufferView": {at}, "componentType": 5121}}, "values": {{"bufferView": {value}}}}}"#
    ));
    fails(maker.load(), "elements without data, more than");

    // Three meshes that claim half of the most triangles each; one that is shown three times counts once
    let mut maker = good();
    maker.root["accessors"][2]["count"] = (3u64 << 25).into();
    let mesh = maker.root["meshes"][0].clone();
    for other in 1..3 {
        maker.root["meshes"].as_array_mut().unwrap().push(mesh.clone());
        maker.node(&format!(r#"{{"mesh": {other}}}"#));
    }
    fails(maker.load(), "surfaces so far, more than");

    // An image whose header claims 2³⁰ pixels
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x80\0\0\0\x80\0\x08\x02\0\0\0".to_vec();
    png.extend([0x53, 0x0c, 0x3a, 0x71]);
    let mut maker = good();
    maker.root["images"][0] =
        json(&format!(r#"{{"uri": "data:image/png;base64,{}"}}"#, BASE64_STANDARD.encode(&png)));
    fails(maker.load(), "image 0");

    // Objects of half a kilobyte from three bytes each
    let text = format!(r#"{{"asset": {{"version": "2.0"}}, "nodes": [{}{{}}]}}"#, "{},".repeat(1 << 22));
    fails(load("a.gltf", text.as_bytes()), "JSON values, more than");

    // Deep nesting
    let text = format!(r#"{{"asset": {{"version": "2.0", "extras": {}}}}}"#, "[".repeat(1 << 20));
    fails(load("a.gltf", text.as_bytes()), "line 1 of the JSON");
}

/// glTF allows all of it: any type of `extras`, anywhere, channels of animations without a node, scenes
/// without nodes, `byteStride` and the like aside. The scene stays what it is.
#[test]
fn what_gltf_allows_is_read() {
    let places = [
        "/asset",
        "/scenes/0",
        "/nodes/1",
        "/meshes/0",
        "/meshes/0/primitives/0",
        "/materials/0",
        "/accessors/0",
        "/materials/0/pbrMetallicRoughness",
        "/materials/0/pbrMetallicRoughness/baseColorTexture",
        "/bufferViews/0",
        "/cameras/0",
        "/cameras/0/perspective",
        "/images/0",
        "/textures/0",
        "/samplers/0",
        "/extensions/KHR_lights_punctual/lights/0",
        "",
    ];
    for extras in [r#""note""#, "1", "true", "null", "[1, {}]", "{}"] {
        let mut maker = good();
        for place in places {
            maker.root.pointer_mut(place).unwrap()["extras"] = json(extras);
        }
        let loaded = maker.load().unwrap_or_else(|e| panic!("{extras}: {e}"));
        assert_eq!(
            (loaded.scene.surfaces(), loaded.warnings.len()),
            (2, 0),
            "{extras}: {:?}",
            loaded.warnings
        );
    }
    let mut maker = good();
    maker.root["animations"] = json(
        r#"[{"name": "Walk", "extras": "x", "channels": [{"sampler": 0, "target": {"path": "pointer",
            "extensions": {"KHR_animation_pointer": {"pointer": "/nodes/0"}}}}], "samplers": []}]"#,
    );
    maker.root["scenes"].as_array_mut().unwrap().push(json(r#"{"name": "Empty"}"#));
    let loaded = maker.load().unwrap();
    assert_warns(&loaded, &["animation 0 \"Walk\"", "it is ignored"]);
    maker.root["scene"] = 1.into();
    fails(maker.load(), "neither a camera nor a mesh");
}

/// As some programs write them: a mark before JSON, and zeros after that of a GLB.
#[test]
fn marks_and_padding_are_passed_over() {
    let marked = [b"\xef\xbb\xbf".as_slice(), &good().gltf()].concat();
    assert_eq!(load("a.gltf", &marked).unwrap().scene.surfaces(), 2);
    let mut file = good().glb();
    let words = |file: &[u8], at: usize| u32::from_le_bytes(std::array::from_fn(|i| file[at + i]));
    let (length, json) = (words(&file, 8), words(&file, 12));
    file.splice(20 + json as usize..20 + json as usize, [0; 4]);
    file[8..12].copy_from_slice(&(length + 4).to_le_bytes());
    file[12..16].copy_from_slice(&(json + 4).to_le_bytes());
    assert_eq!(load("a.glb", &file).unwrap().scene.surfaces(), 2);
}

/// What no list knows is named, with what has it.
#[test]
fn unknown_properties_are_warned_of() {
    let mut maker = good();
    let named = [
        ("/asset", "author", "asset"),
        ("", "sceen", "sceen"),
        ("/nodes/1", "visible", "node 1"),
        ("/materials/0", "metalness", "material 0 \"Oak\""),
        ("/materials/0/extensions/KHR_materials_ior", "dispersion", "material 0 \"Oak\""),
        (
            "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform",
            "scales",
            "material 0 \"Oak\"",
        ),
        ("/meshes/0/primitives/0/attributes", "NORMALS", "mesh 0 \"Table\""),
        ("/extensions/KHR_lights_punctual/lights/0", "radius", "extensions"),
    ];
    let material = &mut maker.root["materials"][0];
    material["extensions"] = json(r#"{"KHR_materials_ior": {"ior": 1.5}, "X": {"y": 1}}"#);
    material["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] =
        json(r#"{"KHR_texture_transform": {"scale": [1, 1]}}"#);
    maker.root["meshes"][0]["primitives"][0]["attributes"]["_ID"] = 0.into();
    for (pointer, property, _) in named {
        maker.root.pointer_mut(pointer).unwrap()[property] = 0.into();
    }
    let loaded = maker.load().unwrap();
    for (_, property, place) in named {
        assert_warns(&loaded, &[&format!("{place}: the property `{property}` is ignored")]);
    }
    assert_warns(&loaded, &["material 0 \"Oak\"", "the extension X is ignored"]);
    assert_eq!(loaded.warnings.len(), named.len() + 1, "{:?}", loaded.warnings);
}

#[test]
fn long_chains_of_nodes_are_walked() {
    let mut maker = good();
    for i in 3..50_000 {
        maker.push("nodes", &format!(r#"{{"children": [{}]}}"#, i + 1));
    }
    maker.push("nodes", r#"{"mesh": 0}"#);
    maker.root["nodes"][2] = json(r#"{"children": [3]}"#);
    let scene = maker.load().unwrap().scene;
    assert_eq!((scene.surfaces(), scene.instances()), (2, 2));
    // Back to the start
    maker.root["nodes"][50_000] = json(r#"{"children": [2]}"#);
    fails(maker.load(), "node 2: it is reached twice");
}

#[test]
fn glb_files_that_are_cut_short_say_so() {
    let file = good().glb();
    assert!(load("a.glb", &file).is_ok());
    for length in 0..file.len() {
        fails(load("a.glb", &file[..length]), "a.glb");
    }
    // A header that is shorter than itself
    let mut short = file.clone();
    short[8..12].copy_from_slice(&3u32.to_le_bytes());
    fails(load("a.glb", &short), "it says that the file has 3 bytes");
    // The length in the header is right, but the chunk is longer than the file
    let mut cut = file[..file.len() - 8].to_vec();
    let length = (cut.len() as u32).to_le_bytes();
    cut[8..12].copy_from_slice(&length);
    fails(load("a.glb", &cut), "GLB chunk");
    let mut version = file;
    version[4] = 1;
    fails(load("a.glb", &version), "version 1 of GLB is not supported");
}

/// Files of version 1 have objects where version 2 has lists, and need not say their version.
#[test]
fn version_1_is_named_before_its_lists() {
    for (asset, want) in [
        (r#""asset": {"version": "1.0"},"#, "version \"1.0\" of glTF is not supported"),
        (r#""asset": {"version": 1},"#, "version 1 of glTF is not supported"),
        (r#""asset": {"generator": "x"},"#, "version 1 of glTF"),
        ("", "version 1 of glTF"),
    ] {
        let file =
            format!(r#"{{{asset} "accessors": {{"a": {{}}}}, "meshes": {{"m": {{"primitives": []}}}}}}"#);
        let error = load("a.gltf", file.as_bytes()).unwrap_err().to_string();
        assert!(error.contains(want), "{error}, not {want}");
    }
}
