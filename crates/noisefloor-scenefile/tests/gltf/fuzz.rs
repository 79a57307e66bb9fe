//! Seeded damage: whatever the bytes, loading ends with a scene or an error, never a panic. The targets of `fuzz` try many
//! more.

use crate::kit::{Maker, json};
use std::path::Path;

/// A little of everything.
fn everything() -> Maker {
    let mut maker = Maker::new();
    let mesh = maker.rectangle(
        [-1.0, 1.0],
        [-1.0, 1.0],
        -1.0,
        r#"{"alphaMode": "MASK", "alphaCutoff": 0.4, "emissiveFactor": [1, 0, 1], "doubleSided": true,
            "emissiveTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"rotation": 1, "scale": [2, 2]}}},
            "normalTexture": {"index": 0}, "extensions": {
                "KHR_materials_emissive_strength": {"emissiveStrength": 2}, "KHR_materials_ior": {"ior": 1.4},
                "KHR_materials_transmission": {"transmissionFactor": 0.9}, "EXT_other": {}},
            "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0, 0.9], "baseColorTexture": {"index": 0},
                "metallicFactor": 0.5, "roughnessFactor": 0}}"#,
    );
    maker.texture(
        2,
        &[[1, 2, 3, 255], [4, 5, 6, 0]],
        r#"{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}"#,
    );
    let (at, values) = (maker.view(&[0, 3], ""), maker.view(&[0; 24], r#", "byteStride": 12"#));
    maker.root["accessors"][0]["sparse"] = json(&format!(
        r#"{{"count": 2, "indices": {{"bufferView": {at}, "componentType": 5121}}, "values": {{"bufferView": {values}}}}}"#
    ));
    let normals = maker.floats(&[[0.0f32, 0.0, 1.0]; 4]);
    maker.root["meshes"][mesh]["primitives"][0]["attributes"]["NORMAL"] = normals.into();
    maker.node(r#"{"mesh": 0, "rotation": [0, 0.6, 0, 0.8], "scale": [1, -2, 1], "children": [2]}"#);
    maker.push("nodes", r#"{"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]}"#);
    maker.root["extensions"]["KHR_lights_punctual"]["lights"] =
        json(r#"[{"type": "spot", "intensity": 2, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}}]"#);
    maker.node(r#"{"extensions": {"KHR_lights_punctual": {"light": 0}}}"#);
    maker
}

/// Damages some bytes: flips bits, writes digits, copies or removes a stretch, cuts the end.
fn damaged(file: &[u8], random: &mut fastrand::Rng) -> Vec<u8> {
    let mut file = file.to_vec();
    for _ in 0..=random.usize(..3) {
        let at = random.usize(..file.len());
        let length = random.usize(..12).min(file.len() - at);
        match random.usize(..8) {
            0 => file[at] ^= 1 << random.usize(..8),
            1 => file[at] = random.u8(..),
            // Another number: what damages most
            2..=4 => match (0..file.len()).map(|i| (at + i) % file.len()).find(|i| file[*i].is_ascii_digit())
            {
                Some(digit) => file[digit] = random.u8(b'0'..=b'9'),
                None => file[at] = 0xff,
            },
            5 => {
                let stretch = file[at..at + length].to_vec();
                let to = random.usize(..file.len());
                file.splice(to..to, stretch);
            }
            6 => drop(file.drain(at..at + length)),
            _ => {
                if random.usize(..8) == 0 {
                    file.truncate(at.max(1));
                }
            }
        }
    }
    file
}

/// Returns how many of `count` damaged files could be loaded.
fn loaded(file: &[u8], path: &Path, count: u32, seed: u64) -> u32 {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut loaded = 0;
    for _ in 0..count {
        std::fs::write(path, damaged(file, &mut random)).unwrap();
        match noisefloor_scenefile::load(path) {
            Ok(_) => loaded += 1,
            Err(error) => assert!(error.to_string().contains("a.gl"), "{error}"),
        }
    }
    loaded
}

#[test]
fn damage_never_panics() {
    let maker = everything();
    let folder = tempfile::tempdir().unwrap();
    for (name, file, seed) in [("a.gltf", maker.gltf(), 1), ("a.glb", maker.glb(), 2)] {
        let path = folder.path().join(name);
        std::fs::write(&path, &file).unwrap();
        noisefloor_scenefile::load(&path).unwrap();
        let loaded = loaded(&file, &path, 800, seed);
        // Damage that is never noticed, or always, tests nothing
        assert!((40..720).contains(&loaded), "{loaded} of 800 damaged {name} were loaded");
    }
}
