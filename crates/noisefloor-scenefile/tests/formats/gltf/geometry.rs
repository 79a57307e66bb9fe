//! Where triangles and cameras are. A lamp is drawn as it is seen directly: its place in the image says where
//! it is.

use super::kit::{Maker, drawing, json, load};
use crate::util::{assert_warns, fails};

/// Shines to the front.
const LAMP: &str = r#"{"emissiveFactor": [1, 1, 1]}"#;
/// The left half of the top quarter of the image, at z = −1.
const CORNERS: [[f32; 3]; 4] = [[-1.0, 0.5, -1.0], [0.0, 0.5, -1.0], [0.0, 1.0, -1.0], [-1.0, 1.0, -1.0]];
const CORNER: &str = "##..\n....\n....\n....\n";
const MIRRORED: &str = "..##\n....\n....\n....\n";
const NOTHING: &str = "....\n....\n....\n....\n";

/// A maker with a lamp in [`CORNERS`], with this for the rest of its primitive.
fn lamp(corners: &[usize], rest: impl FnOnce(&mut Maker) -> String) -> Maker {
    let mut maker = Maker::new();
    let positions = maker.floats(&corners.iter().map(|i| CORNERS[*i]).collect::<Vec<_>>());
    let rest = rest(&mut maker);
    maker.push("materials", LAMP);
    maker.push(
        "meshes",
        &format!(r#"{{"primitives": [{{"attributes": {{"POSITION": {positions}}}, "material": 0{rest}}}]}}"#),
    );
    maker.node(r#"{"mesh": 0}"#);
    maker
}

#[test]
fn all_modes_and_indices_draw_the_same() {
    let quad = [0, 1, 2, 0, 2, 3];
    let wide = |kind: u32, bytes: Vec<u8>| {
        move |maker: &mut Maker| format!(r#", "indices": {}"#, maker.accessor(kind, "SCALAR", 6, &bytes, ""))
    };
    let mode = |mode: u32| move |_: &mut Maker| format!(r#", "mode": {mode}"#);
    for (what, maker) in [
        ("no indices", lamp(&quad, |_| String::new())),
        ("triangles", lamp(&quad, mode(4))),
        ("strip", lamp(&[0, 1, 3, 2], mode(5))),
        ("fan", lamp(&[0, 1, 2, 3], mode(6))),
        ("bytes", lamp(&[0, 1, 2, 3], wide(5121, quad.map(|i| i as u8).to_vec()))),
        (
            "shorts",
            lamp(&[0, 1, 2, 3], wide(5123, quad.iter().flat_map(|i| (*i as u16).to_le_bytes()).collect())),
        ),
        (
            "words",
            lamp(&[0, 1, 2, 3], wide(5125, quad.iter().flat_map(|i| (*i as u32).to_le_bytes()).collect())),
        ),
    ] {
        assert_eq!(drawing(maker.load().unwrap(), 4), CORNER, "{what}");
        assert_eq!(drawing(load("scene.glb", &maker.glb()).unwrap(), 4), CORNER, "{what} in GLB");
    }
}

#[test]
fn points_and_lines_are_left_out() {
    for mode in 0..4 {
        let loaded = lamp(&[0, 1, 2, 3], |_| format!(r#", "mode": {mode}"#)).load().unwrap();
        assert_warns(&loaded, &["mesh 0, primitive 0", "points or lines"]);
        assert_eq!(loaded.scene.surfaces(), 0);
    }
}

#[test]
fn interleaved_sparse_and_quantized_positions_are_read() {
    // Every second element of 12 bytes is something else
    let mut interleaved = lamp(&[0, 0, 1, 0, 2, 0, 0, 0, 2, 0, 3], |_| String::new());
    interleaved.root["bufferViews"][0]["byteStride"] = 24.into();
    interleaved.root["accessors"][0]["count"] = 6.into();

    // The last two corners replace wrong ones, and all replace none
    let some: Vec<u8> = [CORNERS[2], CORNERS[3]].iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let mut replaced = lamp(&[0, 1, 2, 0, 0, 0], |_| String::new());
    let (at, values) = (replaced.view(&[4, 5], ""), replaced.view(&some, ""));
    replaced.root["accessors"][0]["sparse"] = json(&format!(
        r#"{{"count": 2, "indices": {{"bufferView": {at}, "componentType": 5121}}, "values": {{"bufferView": {values}}}}}"#
    ));
    let mut created = lamp(&[0, 1, 2, 0, 2, 3], |_| String::new());
    let at: Vec<u8> = (0..6u16).flat_map(u16::to_le_bytes).collect();
    let at = created.view(&at, "");
    created.root["accessors"][0]["sparse"] = json(&format!(
        r#"{{"count": 6, "indices": {{"bufferView": {at}, "componentType": 5123}}, "values": {{"bufferView": 0}}}}"#
    ));
    created.root["accessors"][0].as_object_mut().unwrap().remove("bufferView");

    // −127 and 127 are −1 and 1; 64 is about ½
    let mut quantized = lamp(&[], |_| String::new());
    let bytes: Vec<u8> =
        [0, 1, 2, 0, 2, 3].iter().flat_map(|i| CORNERS[*i].map(|x| (x * 127.0) as i8 as u8)).collect();
    quantized.accessor(5120, "VEC3", 6, &bytes, r#", "normalized": true"#);
    quantized.root["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 1.into();
    quantized.root["extensionsRequired"] = json(r#"["KHR_mesh_quantization"]"#);

    for (what, maker) in
        [("interleaved", interleaved), ("replaced", replaced), ("created", created), ("quantized", quantized)]
    {
        assert_eq!(drawing(maker.load().unwrap(), 4), CORNER, "{what}");
    }
}

#[test]
fn nodes_move_meshes() {
    let quad = |nodes: &[&str]| {
        let mut maker = lamp(&[0, 1, 2, 0, 2, 3], |_| String::new());
        maker.root["nodes"][1] = json(nodes[0]);
        for node in &nodes[1..] {
            maker.push("nodes", node);
        }
        drawing(maker.load().unwrap(), 4)
    };
    assert_eq!(quad(&[r#"{"mesh": 0, "translation": [1, 0, 0]}"#]), MIRRORED);
    assert_eq!(quad(&[r#"{"mesh": 0, "translation": [0, -0.5, 0]}"#]), "....\n##..\n....\n....\n");
    // A quarter turn about z, counter-clockwise from the front, with a quaternion that is not quite of length
    // 1
    let turn = r#"{"mesh": 0, "rotation": [0, 0, 0.70711, 0.70711]}"#;
    assert_eq!(quad(&[turn]), "....\n....\n#...\n#...\n");
    // The same by a matrix, whose columns come one after the other
    let turn = r#"{"mesh": 0, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}"#;
    assert_eq!(quad(&[turn]), "....\n....\n#...\n#...\n");
    // The child moves first: x from −1…0 to 0…1, then to 0…½
    let parent = r#"{"scale": [0.5, 1, 1], "children": [2]}"#;
    let child = r#"{"children": [3], "translation": [1, 0, 0]}"#;
    assert_eq!(quad(&[parent, child, r#"{"mesh": 0}"#]), "..#.\n....\n....\n....\n");
    // A lamp shines to its front alone: from behind it cannot be seen
    assert_eq!(quad(&[r#"{"mesh": 0, "rotation": [0, 1, 0, 0], "translation": [0, 0, -2]}"#]), NOTHING);
    // A mirror image has its front where the original has
    assert_eq!(quad(&[r#"{"mesh": 0, "scale": [-1, 1, 1]}"#]), MIRRORED);
    assert_eq!(quad(&[r#"{"mesh": 0, "scale": [1, 1, -1], "translation": [0, 0, -2]}"#]), NOTHING);
}

/// Half the height that is seen is ymag, at any distance.
#[test]
fn orthographic_cameras_see_parallels() {
    let mut maker = lamp(&[0, 1, 2, 0, 2, 3], |_| String::new());
    maker.root["cameras"][0] =
        json(r#"{"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 99}}"#);
    for z in [0, -5] {
        maker.root["nodes"][1]["translation"] = json(&format!("[0, 0, {z}]"));
        assert_eq!(drawing(maker.load().unwrap(), 4), CORNER, "{z}");
    }
}

#[test]
fn what_has_no_area_is_left_out() {
    let mut maker = lamp(&[0, 1, 2, 0, 0, 1], |_| String::new());
    let loaded = maker.load().unwrap();
    assert_warns(&loaded, &["mesh 0, primitive 0", "triangles without area are left out: 1"]);
    assert_eq!(loaded.scene.surfaces(), 1);
    maker.root["nodes"][1]["scale"] = json("[0, 0, 0]");
    assert_warns(&maker.load().unwrap(), &["mesh 0, primitive 0", "no area"]);
}

#[test]
fn the_first_camera_is_used() {
    let mut maker = lamp(&[0, 1, 2, 0, 2, 3], |_| String::new());
    // Two units to the right, turned a quarter turn to the left about y: x = −1…0 is 2…3 away, in the middle
    maker.root["nodes"][0] = json(r#"{"children": [2], "translation": [2, 0.75, -1]}"#);
    maker.push("nodes", r#"{"camera": 0, "rotation": [0, 0.7071068, 0, 0.7071068]}"#);
    maker.node(r#"{"camera": 0}"#);
    // Edge on it is not seen: turn it about y by 45°
    let mut turned = maker.clone();
    turned.root["nodes"][1] = json(r#"{"mesh": 0, "rotation": [0, 0.38268343, 0, 0.92387953]}"#);
    let loaded = maker.load().unwrap();
    assert_warns(&loaded, &["node 3", "its camera is ignored"]);
    assert_eq!(drawing(loaded, 4), NOTHING);
    assert!(drawing(turned.load().unwrap(), 16).contains('#'));
    let mut without = maker;
    without.root["cameras"][0] = json(r#"{"type": "orthographic"}"#);
    let error = without.load().err().map(|e| e.to_string()).unwrap_or_default();
    assert!(error.contains("camera 0: it is no perspective or orthographic camera with its"), "{error}");
}

#[test]
fn without_a_camera_all_is_seen() {
    for scale in [0.01, 1.0, 300.0] {
        let mut maker = Maker::empty();
        let mesh = maker.rectangle([0.0, 1.0], [0.0, 2.0], 3.0, LAMP);
        maker.node(&format!(
            r#"{{"mesh": {mesh}, "scale": [{scale}, {scale}, {scale}], "translation": [1000, 0, 0]}}"#
        ));
        let loaded = maker.load().unwrap();
        assert_warns(&loaded, &["no camera"]);
        let drawing = drawing(loaded, 32);
        let rows: Vec<&str> = drawing.lines().collect();
        // All of it is inside the image, and fills much of it
        let inner = rows.iter().filter(|row| row.contains('#')).count();
        assert!((20..32).contains(&inner), "{drawing}");
        assert!(rows.iter().all(|row| row.starts_with('.') && row.ends_with('.')), "{drawing}");
        assert!(!rows[0].contains('#') && !rows[31].contains('#'), "{drawing}");
    }
}

#[test]
fn what_is_ignored_is_named() {
    let mut maker = lamp(&[0, 1, 2], |_| String::new());
    let primitive = &mut maker.root["meshes"][0]["primitives"][0];
    primitive["attributes"]["COLOR_1"] = 0.into();
    primitive["attributes"]["JOINTS_1"] = 0.into();
    primitive["extensions"] = json(r#"{"EXT_primitive": {}}"#);
    maker.root["meshes"][0]["name"] = "Table".into();
    maker.root["nodes"][1]["name"] = "Legs".into();
    maker.root["nodes"][1]["extensions"] = json(r#"{"EXT_node_elsewhere": {}}"#);
    maker.push("animations", r#"{"name": "walk", "channels": [], "samplers": []}"#);
    // The mesh again: warnings about it come once
    maker.node(r#"{"mesh": 0}"#);
    maker.root["extensionsUsed"] =
        json(r#"["EXT_primitive", "EXT_node_elsewhere", "EXT_elsewhere", "KHR_mesh_quantization"]"#);
    let loaded = maker.load().unwrap();
    for parts in [
        [r#"mesh 0 "Table", primitive 0"#, "second set of vertex colours"],
        [r#"mesh 0 "Table", primitive 0"#, "joints beyond four"],
        [r#"mesh 0 "Table", primitive 0"#, "EXT_primitive"],
        [r#"node 1 "Legs""#, "EXT_node_elsewhere"],
        [r#"animation 0 "walk""#, "ignored"],
        ["extensionsUsed", "EXT_elsewhere"],
    ] {
        assert_warns(&loaded, &parts);
    }
    assert_eq!(loaded.warnings.len(), 6, "{:#?}", loaded.warnings);
}

/// A rectangle whose vertices hang on two joints by halves, one moved by +x: it is moved by half of that, its own
/// node's transform does not count, and a morph target of weight ½ moves it up.
#[test]
fn skins_and_morph_targets_are_at_rest() {
    let mut maker = Maker::new();
    let mesh = maker.rectangle([-0.25, 0.25], [-0.25, 0.25], -1.0, r#"{"emissiveFactor": [1, 1, 1]}"#);
    let joints = maker.accessor(5121, "VEC4", 4, &[0, 1, 0, 0].repeat(4), "");
    let halves: Vec<u8> = [0.5f32, 0.5, 0.0, 0.0].repeat(4).into_iter().flat_map(f32::to_le_bytes).collect();
    let weights = maker.accessor(5126, "VEC4", 4, &halves, "");
    let up = maker.floats(&[[0.0f32, 0.5, 0.0]; 4]);
    let primitive = &mut maker.root["meshes"][mesh]["primitives"][0];
    primitive["attributes"]["JOINTS_0"] = joints.into();
    primitive["attributes"]["WEIGHTS_0"] = weights.into();
    primitive["targets"] = json(&format!(r#"[{{"POSITION": {up}}}]"#));
    maker.root["meshes"][mesh]["weights"] = json("[0.5]");
    // Bound where it is: the inverse of the second joint at its first place, (1, 0, 0)
    let identity = [1.0f32, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let mut inverse = identity;
    inverse[12] = -1.0;
    let matrices: Vec<u8> = [identity, inverse].concat().into_iter().flat_map(f32::to_le_bytes).collect();
    let matrices = maker.accessor(5126, "MAT4", 2, &matrices, "");
    maker.node(&format!(r#"{{"mesh": {mesh}, "skin": 0, "translation": [9, 9, 9]}}"#));
    let first = maker.node("{}");
    let second = maker.node(r#"{"translation": [2, 0, 0]}"#);
    maker.push("skins", &format!(r#"{{"joints": [{first}, {second}], "inverseBindMatrices": {matrices}}}"#));
    let expected = "........\n........\n.....##.\n.....##.\n........\n........\n........\n........\n";
    assert_eq!(drawing(maker.load().unwrap(), 8), expected);
    // Joints that are not in the scene, and matrices too few
    for (pointer, value, what) in [
        ("joints", format!("[{first}, 77]"), "77 does not exist"),
        ("joints", format!("[{first}, {second}, {second}]"), "3 joints, but 2 matrices"),
        ("joints", format!("[{first}]"), "joint 1 is past the 1 of its skin"),
    ] {
        let mut maker = maker.clone();
        maker.root["skins"][0][pointer] = json(&value);
        fails(maker.load(), what);
    }
}

#[test]
fn points_and_lines_alone_are_no_scene() {
    let mut maker = Maker::empty();
    let mesh = maker.rectangle([-1.0, 1.0], [-1.0, 1.0], -1.0, "{}");
    maker.root["meshes"][mesh]["primitives"][0]["mode"] = 1.into();
    maker.node(&format!(r#"{{"mesh": {mesh}}}"#));
    fails(maker.load(), "a scene of only points and lines is not supported");
}

/// Nodes share a mesh that is at rest, but for what shines in it and where a scale flattens it.
#[test]
fn nodes_share_a_mesh() {
    let mut maker = Maker::new();
    let lamp = maker.push("materials", r#"{"emissiveFactor": [1, 1, 1]}"#);
    let mesh = maker.rectangle([-1.0, 1.0], [-1.0, 1.0], -2.0, "{}");
    let mut primitive = maker.root["meshes"][mesh]["primitives"][0].clone();
    primitive["material"] = lamp.into();
    maker.root["meshes"][mesh]["primitives"].as_array_mut().unwrap().push(primitive);
    for x in 0..1000 {
        maker.node(&format!(r#"{{"mesh": {mesh}, "translation": [{x}, 0, 0]}}"#));
    }
    maker.node(&format!(r#"{{"mesh": {mesh}, "scale": [1, 0, 1]}}"#));
    let scene = maker.load().unwrap().scene;
    assert_eq!((scene.surfaces(), scene.instances(), scene.lights()), (2 + 2000, 1000, 2000));
}
